//! All ways to stop an arm over DDS.

use super::{Node, TriggerRequest, TriggerResponse, Writer, service_mapping};
use crate::messages::{BOOL, Bool};
use crate::{Connection, LiveError};
use armcal_core::log::encode;

/// Tells an arm to stop, by topic and by service.
pub(super) struct Stopper {
    topic: Option<Writer>,
    service: Option<ros2_client::Client<TriggerRequest, TriggerResponse>>,
}

impl Stopper {
    pub fn new(node: &mut Node, connection: &Connection) -> Result<Self, LiveError> {
        let stop = &connection.stop;
        let topic = (!stop.topic.is_empty()).then(|| node.writer(&stop.topic, BOOL)).transpose()?;
        let service = (!stop.service.is_empty()).then(|| trigger(node, connection)).transpose()?;
        Ok(Self { topic, service })
    }

    pub fn stop(&self) -> Result<(), LiveError> {
        let by_service = self.service.as_ref().map(|client| {
            let sent = client.send_request(TriggerRequest::default());
            sent.map(|_| ()).map_err(LiveError::dds("the stop service"))
        });
        let by_topic = self.topic.as_ref().map(|topic| {
            let mut bytes = Vec::new();
            encode(&Bool { data: true }, &mut bytes).map_err(|error| LiveError::Encode(error.into()))?;
            topic.write(bytes)
        });
        let mut all = by_service.into_iter().chain(by_topic);
        all.try_for_each(|sent| sent)
    }
}

fn trigger(
    node: &mut Node,
    connection: &Connection,
) -> Result<ros2_client::Client<TriggerRequest, TriggerResponse>, LiveError> {
    let name = ros2_client::Name::parse(&connection.stop.service).map_err(LiveError::dds("stop.service"))?;
    let mapping = service_mapping(connection.stop.mapping);
    let qos = ros2_client::QosProfile::publisher_default();
    let type_name = ros2_client::ServiceTypeName::new("std_srvs", "Trigger");
    node.ros.create_client(mapping, &name, &type_name, qos.clone(), qos).map_err(LiveError::dds("stop.service"))
}
