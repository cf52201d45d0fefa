//! The service that stops an arm.

use serde::{Deserialize, Serialize};

use crate::ServiceMapping;

/// Request of std_srvs/srv/Trigger; an empty request is one byte.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct TriggerRequest {
    pub structure_needs_at_least_one_member: u8,
}

impl ros2_client::Message for TriggerRequest {}

/// Response of std_srvs/srv/Trigger.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct TriggerResponse {
    pub success: bool,
    pub message: String,
}

impl ros2_client::Message for TriggerResponse {}

/// Returns the middleware's name of a mapping.
pub(crate) fn service_mapping(mapping: ServiceMapping) -> ros2_client::ServiceMapping {
    match mapping {
        ServiceMapping::Enhanced => ros2_client::ServiceMapping::Enhanced,
        ServiceMapping::Cyclone => ros2_client::ServiceMapping::Cyclone,
    }
}
