//! Undecoded messages with their channel and schema.

use std::collections::BTreeMap;
use std::rc::Rc;

use crate::time::Stamp;

/// Type of a topic's messages, as the file declares it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Schema {
    pub name: String,
    pub encoding: String,
    pub data: Vec<u8>,
}

/// A topic, as the file declares it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Channel {
    pub topic: String,
    pub message_encoding: String,
    pub metadata: BTreeMap<String, String>,
    /// `None` where the channel declares no type, or one that the file lacks.
    pub schema: Option<Rc<Schema>>,
}

/// One message, undecoded.
#[derive(Clone, Copy, Debug)]
pub struct RawMessage<'a> {
    pub channel: &'a Channel,
    /// Recorder's clock, nanoseconds since the Unix epoch.
    pub log_time_nanos: u64,
    /// Sender's clock, or the log time.
    pub publish_time_nanos: u64,
    pub sequence: u32,
    pub data: &'a [u8],
}

impl RawMessage<'_> {
    #[must_use]
    pub fn topic(&self) -> &str {
        &self.channel.topic
    }

    /// Name of the type, such as `sensor_msgs/msg/JointState`; empty where the file has none.
    #[must_use]
    pub fn schema_name(&self) -> &str {
        self.channel.schema.as_ref().map_or("", |schema| &schema.name)
    }

    /// Log time; past the year 2262 (only in damaged or external files) that year's last stamp.
    #[must_use]
    pub fn log_time(&self) -> Stamp {
        Stamp { nanos: i64::try_from(self.log_time_nanos).unwrap_or(i64::MAX) }
    }
}
