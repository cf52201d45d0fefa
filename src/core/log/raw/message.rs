//! Undecoded messages with their channel and schema.

use std::collections::BTreeMap;
use std::rc::Rc;

use crate::time::Stamp;

/// Type of a topic's messages, as the file declares it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Schema {
    /// Full name, such as `sensor_msgs/msg/JointState`.
    pub name: String,
    /// Form of `data`, such as `ros2msg`.
    pub encoding: String,
    /// Definition of the type.
    pub data: Vec<u8>,
}

/// A topic, as the file declares it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Channel {
    /// Name of the topic, such as `/joint_sensors`.
    pub topic: String,
    /// Encoding of the messages, such as `cdr`.
    pub message_encoding: String,
    /// Key-value pairs that the writer gave; empty in our recordings.
    pub metadata: BTreeMap<String, String>,
    /// Type of the messages; `None` if the channel declares no type, or one that the file lacks.
    pub schema: Option<Rc<Schema>>,
}

/// An undecoded message.
#[derive(Clone, Copy, Debug)]
pub struct RawMessage<'a> {
    /// Topic and type of the message.
    pub channel: &'a Channel,
    /// Recorder's clock, nanoseconds since the Unix epoch.
    pub log_time_nanos: u64,
    /// Sender's clock, or the log time.
    pub publish_time_nanos: u64,
    /// Counter of the sender or recorder within the topic.
    pub sequence: u32,
    /// Part of the file in which the message lies; messages of one chunk have the same part.
    pub part: u64,
    /// Encoded fields, without the record's header.
    pub data: &'a [u8],
}

impl RawMessage<'_> {
    /// Returns the topic of the message's channel.
    #[must_use]
    pub fn topic(&self) -> &str {
        &self.channel.topic
    }

    /// Returns the name of the type, such as `sensor_msgs/msg/JointState`; empty if the file has none.
    #[must_use]
    pub fn schema_name(&self) -> &str {
        self.channel.schema.as_ref().map_or("", |schema| &schema.name)
    }

    /// Returns the log time. Past the year 2262 (only in damaged or external files) it is that year's last stamp.
    #[must_use]
    pub fn log_time(&self) -> Stamp {
        Stamp { nanos: i64::try_from(self.log_time_nanos).unwrap_or(i64::MAX) }
    }
}
