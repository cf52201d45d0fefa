//! Participant of a ROS 2 domain, with readers and writers of raw messages.

use std::net::Ipv4Addr;
use std::sync::mpsc::channel;
use std::time::Duration;

use rustdds::no_key::{DataWriter, SimpleDataReader};
use rustdds::policy::{History, Reliability, ResourceLimits};
use rustdds::{
    DomainParticipant, DomainParticipantBuilder, DomainParticipantStatusEvent, DomainParticipantStatusListener, GUID,
    QosPolicies, QosPolicyBuilder, RTPSEntity, StatusEvented, TopicKind,
};

use super::raw::Raw;
use crate::LiveError;
use armcal_core::log::Stream;

/// Number of messages that a reader keeps while nobody listens; `IMAGE_DEPTH` is that of images. The middleware also
/// keeps messages that were taken.
const DEPTH: i32 = 200;
const IMAGE_DEPTH: i32 = 4;
/// Longest time for which the middleware may leave the domain: a flood of participants keeps it busy for minutes.
const LEAVE_LIMIT: Duration = Duration::from_secs(2);

/// Our participant of the domain.
pub(crate) struct Node {
    pub ros: ros2_client::Node,
    publisher: rustdds::Publisher,
    subscriber: rustdds::Subscriber,
    pub(super) status: DomainParticipantStatusListener,
    pub(super) participant: DomainParticipant,
    /// Last field, so that everything else of the node is dropped before.
    _leaving: Leaving,
}

/// Leaves the domain on another thread, and waits for that no longer than the limit.
struct Leaving(Option<DomainParticipant>);

impl Drop for Leaving {
    fn drop(&mut self) {
        let participant = self.0.take();
        let (told, left) = channel();
        let leave = move || {
            drop(participant);
            // Nobody may wait any more.
            let _ = told.send(());
        };
        if std::thread::Builder::new().name("leaving".to_owned()).spawn(leave).is_ok() {
            let _ = left.recv_timeout(LEAVE_LIMIT);
        }
    }
}

/// Reads one topic.
pub(crate) struct Reader(pub SimpleDataReader<Vec<u8>, Raw>);

/// Writes one topic.
pub(crate) struct Writer(DataWriter<Vec<u8>, Raw>);

impl Node {
    pub fn new(domain: u16, networks: &[Ipv4Addr], name: &str) -> Result<Self, LiveError> {
        let mut builder = DomainParticipantBuilder::new(domain);
        if !networks.is_empty() {
            builder = builder.with_only_networks(networks.iter().copied());
        }
        let participant = builder.build().map_err(LiveError::dds("the domain cannot be joined"))?;
        let status = participant.status_listener();
        let context = ros2_client::Context::from_domain_participant(participant.clone());
        let name = ros2_client::NodeName::new("/", name).map_err(LiveError::dds("the node"))?;
        let options = ros2_client::NodeOptions::new().enable_rosout(false).start_parameter_services(false);
        let ros = context
            .map_err(LiveError::dds("the node"))?
            .new_node(name, options)
            .map_err(LiveError::dds("the node cannot be made"))?;
        let publisher =
            participant.create_publisher(&reliable()).map_err(LiveError::dds("no publisher can be made"))?;
        let subscriber =
            participant.create_subscriber(&best_effort(DEPTH)).map_err(LiveError::dds("no subscriber can be made"))?;
        Ok(Self { _leaving: Leaving(Some(participant.clone())), participant, publisher, subscriber, status, ros })
    }

    /// Returns our participant's id, whose prefix all our endpoints have.
    pub fn guid(&self) -> GUID {
        self.participant.guid()
    }

    pub fn reader(&self, topic: &str, ros_type: &str) -> Result<Reader, LiveError> {
        let qos = best_effort(if ros_type == Stream::Images.schema().name { IMAGE_DEPTH } else { DEPTH });
        let dds_topic = self.topic(topic, ros_type, &qos)?;
        let reader = self.subscriber.create_simple_datareader_no_key(&dds_topic, Some(qos));
        Ok(Reader(reader.map_err(LiveError::dds(topic))?))
    }

    pub fn writer(&self, topic: &str, ros_type: &str) -> Result<Writer, LiveError> {
        let qos = reliable();
        let dds_topic = self.topic(topic, ros_type, &qos)?;
        Ok(Writer(self.publisher.create_datawriter_no_key(&dds_topic, Some(qos)).map_err(LiveError::dds(topic))?))
    }

    fn topic(&self, topic: &str, ros_type: &str, qos: &QosPolicies) -> Result<rustdds::Topic, LiveError> {
        let created = self.participant.create_topic(format!("rt{topic}"), dds_type(ros_type), qos, TopicKind::NoKey);
        created.map_err(LiveError::dds(topic))
    }

    /// Warns of endpoints of the other side that do not match ours.
    pub fn warn_of_mismatches(&self) {
        while let Some(event) = self.status.try_recv_status() {
            if let DomainParticipantStatusEvent::RemoteReaderQosIncompatible { requested_qos, .. } = event {
                tracing::warn!("somebody asks for a quality of service that is not offered here: {requested_qos:?}");
            } else if let DomainParticipantStatusEvent::RemoteWriterQosIncompatible { offered_qos, .. } = event {
                tracing::warn!("somebody offers a quality of service that is too low for us: {offered_qos:?}");
            }
        }
    }
}

impl Reader {
    /// Returns the oldest message that was not taken; `None` if there is none, the text if it could not be read.
    pub fn take(&self) -> Option<Result<Vec<u8>, String>> {
        self.0.drain_read_notifications();
        match self.0.try_take_one() {
            Ok(None) => None,
            Ok(Some(sample)) => Some(Ok(sample.into_value())),
            Err(error) => Some(Err(format!("{error:?}"))),
        }
    }
}

impl Writer {
    pub fn write(&self, bytes: Vec<u8>) -> Result<(), LiveError> {
        self.0.write(bytes, Some(rustdds::Timestamp::now())).map_err(|error| LiveError::Dds {
            what: "a message cannot be sent".to_owned(),
            problem: format!("{:?}", error.forget_data()),
        })
    }
}

/// Returns settings that match every writer.
fn best_effort(depth: i32) -> QosPolicies {
    let limits = ResourceLimits { max_samples: depth, max_instances: depth, max_samples_per_instance: depth };
    let builder = QosPolicyBuilder::new().reliability(Reliability::BestEffort).resource_limits(limits);
    builder.history(History::KeepLast { depth }).build()
}

/// Returns settings that match every reader.
fn reliable() -> QosPolicies {
    let max_blocking_time = rustdds::Duration::from_millis(10);
    let builder = QosPolicyBuilder::new().reliability(Reliability::Reliable { max_blocking_time });
    builder.history(History::KeepLast { depth: 10 }).build()
}

/// Returns the type `package/msg/Type` as DDS writes it.
fn dds_type(ros_type: &str) -> String {
    let mut parts = ros_type.split('/');
    let (package, kind, name) = (parts.next(), parts.next(), parts.next());
    format!("{}::{}::dds_::{}_", package.unwrap_or_default(), kind.unwrap_or_default(), name.unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_are_named_as_dds_has_them() {
        assert_eq!(dds_type("sensor_msgs/msg/JointState"), "sensor_msgs::msg::dds_::JointState_");
    }
}
