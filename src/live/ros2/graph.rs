//! Topics and services of the other participants in a ROS 2 domain.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use rustdds::{DomainParticipantStatusEvent, GUID, StatusEvented};

use super::{Node, Reader};
use crate::discover::{Domain, Seen, SeenService, SeenTopic};
use crate::{LiveError, ServiceMapping};
use armcal_core::log::ros::JointState;
use armcal_core::log::{Stream, decode};
use armcal_core::time::Stamp;

/// Longest time between two looks at the domain.
const LISTEN: Duration = Duration::from_millis(20);
/// Pause after a longer look, as a multiple of its duration.
const PAUSES_PER_LOOK: u32 = 4;
/// Largest number of stored topics, services, and joint names of one topic.
const MAX_NAMES: usize = 2000;
/// Largest number of topics whose messages are heard: the middleware loses participants that listen to a thousand at
/// once.
const MAX_LISTENED: usize = 200;
/// Vendor id that Cyclone DDS announces.
const CYCLONE_VENDOR: [u8; 2] = [1, 16];

/// Reader or writer of another participant.
struct Endpoint {
    dds_topic: String,
    dds_type: String,
    guid: GUID,
    is_writer: bool,
}

/// Reader of one topic's messages.
struct Listening {
    reader: Reader,
    first: Option<Stamp>,
    last: Stamp,
}

/// Listens to a domain for some seconds, or until `is_over` says so. Nothing is published.
///
/// # Errors
/// [`LiveError::Dds`].
pub fn look_around(domain: &Domain, seconds: f64, is_over: &dyn Fn() -> bool) -> Result<Seen, LiveError> {
    let node = Node::new(domain.number, &domain.networks, "armcal_discover")?;
    let start = Instant::now();
    let mut topics: BTreeMap<(String, String), SeenTopic> = BTreeMap::new();
    let mut heard: BTreeMap<(String, String), Option<Listening>> = BTreeMap::new();
    let mut cyclones = Vec::new();
    let (mut services, mut last_look) = (Vec::new(), Duration::ZERO);
    while start.elapsed().as_secs_f64() < seconds && !is_over() {
        // A domain of thousands of endpoints is looked at less often.
        std::thread::sleep(LISTEN.max(last_look * PAUSES_PER_LOOK));
        let look = Instant::now();
        cyclones.extend(new_cyclones(&node));
        let endpoints = endpoints(&node);
        services = endpoints.iter().filter_map(|endpoint| service(endpoint, &cyclones)).take(MAX_NAMES).collect();
        topics.values_mut().for_each(|topic| (topic.publishers, topic.subscribers) = (0, 0));
        for endpoint in endpoints {
            let Some(key) = topic_of(&endpoint) else { continue };
            if topics.len() >= MAX_NAMES && !topics.contains_key(&key) {
                continue;
            }
            let is_new = heard.len() < MAX_LISTENED && !heard.contains_key(&key);
            if is_new && endpoint.is_writer && is_of_a_stream(&key.1) {
                // Only one type of a name can be listened to; the rest of the domain counts all the same.
                let reader = node.reader(&key.0, &key.1).ok();
                let listening = reader.map(|reader| Listening { reader, first: None, last: Stamp { nanos: 0 } });
                heard.insert(key.clone(), listening);
            }
            let topic = topics.entry(key.clone()).or_insert_with(|| SeenTopic::new(key.0, key.1));
            *if endpoint.is_writer { &mut topic.publishers } else { &mut topic.subscribers } += 1;
        }
        for (key, listening) in heard.iter_mut().filter_map(|(key, own)| own.as_mut().map(|own| (key, own))) {
            topics.entry(key.clone()).and_modify(|topic| listening.take_all(topic));
        }
        last_look = look.elapsed();
    }
    Ok(Seen { domain: domain.clone(), topics: topics.into_values().collect(), services })
}

/// Returns participants that were announced since the last call.
fn new_cyclones(node: &Node) -> Vec<GUID> {
    let events = std::iter::from_fn(|| node.status.try_recv_status());
    let cyclone = |event| match event {
        DomainParticipantStatusEvent::ParticipantDiscovered { dpd } if dpd.vendor_id.vendor_id == CYCLONE_VENDOR => {
            Some(dpd.guid)
        }
        _ => None,
    };
    events.filter_map(cyclone).collect()
}

fn endpoints(node: &Node) -> Vec<Endpoint> {
    let writers = node.participant.discovered_writers().into_iter().map(|writer| {
        let data = writer.publication_topic_data;
        Endpoint { dds_topic: data.topic_name, dds_type: data.type_name, guid: data.key, is_writer: true }
    });
    let readers = node.participant.discovered_readers().into_iter().map(|reader| {
        let data = reader.subscription_topic_data;
        let (dds_topic, dds_type) = (data.topic_name().clone(), data.type_name().clone());
        Endpoint { dds_topic, dds_type, guid: data.key(), is_writer: false }
    });
    let own = node.guid().prefix;
    writers.chain(readers).filter(|endpoint| endpoint.guid.prefix != own).collect()
}

/// Returns name and type as ROS writes them; `None` if it is no topic of ROS.
fn topic_of(endpoint: &Endpoint) -> Option<(String, String)> {
    let name = endpoint.dds_topic.strip_prefix("rt").filter(|name| name.starts_with('/'))?;
    Some((name.to_owned(), ros_type(&endpoint.dds_type)?))
}

/// Returns a service by the topic that its server reads.
fn service(endpoint: &Endpoint, cyclones: &[GUID]) -> Option<SeenService> {
    let name = endpoint.dds_topic.strip_prefix("rq").and_then(|name| name.strip_suffix("Request"))?;
    let ros_type = ros_type(endpoint.dds_type.replace("_Request_", "_").as_str())?;
    let is_cyclone = cyclones.iter().any(|cyclone| cyclone.prefix == endpoint.guid.prefix);
    let mapping = if is_cyclone { ServiceMapping::Cyclone } else { ServiceMapping::Enhanced };
    (!endpoint.is_writer).then(|| SeenService { name: name.to_owned(), ros_type, mapping })
}

/// Returns the type `package::msg::dds_::Type_` as ROS writes it.
fn ros_type(dds_type: &str) -> Option<String> {
    let mut parts = dds_type.split("::");
    let (package, kind, infix) = (parts.next()?, parts.next()?, parts.next()?);
    let name = parts.next()?.strip_suffix('_')?;
    (infix == "dds_" && parts.next().is_none()).then(|| format!("{package}/{kind}/{name}"))
}

fn is_of_a_stream(ros_type: &str) -> bool {
    Stream::ALL.iter().any(|stream| stream.schema().name == ros_type)
}

impl Listening {
    fn take_all(&mut self, topic: &mut SeenTopic) {
        let taken = std::iter::from_fn(|| self.reader.take()).take(super::MAX_TAKEN);
        for bytes in taken.flatten() {
            topic.messages += 1;
            if topic.ros_type != Stream::JointSensors.schema().name {
                continue;
            }
            let Ok(message) = decode::<JointState>(&bytes) else { continue };
            let room = MAX_NAMES.saturating_sub(topic.joints.len());
            topic.joints.extend(message.name.into_iter().take(room));
            let finite = message.position.into_iter().filter(|value| value.is_finite());
            topic.largest = finite.map(f64::abs).fold(topic.largest, f64::max);
            let Ok(stamp) = Stamp::try_from(message.header.stamp) else { continue };
            let first = *self.first.get_or_insert(stamp);
            self.last = self.last.max(stamp);
            let seconds = self.last.since_s(first);
            topic.rate_hz = (seconds > 0.0).then(|| (topic.messages - 1) as f64 / seconds);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_ros_again() {
        assert_eq!(ros_type("sensor_msgs::msg::dds_::JointState_").as_deref(), Some("sensor_msgs/msg/JointState"));
        assert_eq!(ros_type("DCPSParticipant"), None);
        let endpoint = |topic: &str, name: &str| Endpoint {
            dds_topic: topic.to_owned(),
            dds_type: format!("std_srvs::srv::dds_::{name}"),
            guid: GUID::GUID_UNKNOWN,
            is_writer: false,
        };
        let stop = service(&endpoint("rq/arm/stopRequest", "Trigger_Request_"), &[]).unwrap();
        assert_eq!((stop.name.as_str(), stop.ros_type.as_str()), ("/arm/stop", "std_srvs/srv/Trigger"));
        assert_eq!(service(&endpoint("rt/arm/stop", "Trigger_Request_"), &[]), None);
        assert_eq!(topic_of(&endpoint("rt/arm/held", "Held_")).unwrap().0, "/arm/held");
        assert_eq!(topic_of(&endpoint("rq/arm/heldRequest", "Held_")), None);
    }
}
