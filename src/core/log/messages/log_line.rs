//! Lines of text for people.

use serde::{Deserialize, Serialize};

use super::basic::Time;
use crate::log::error::{DecodeRejection, EncodeError};
use crate::log::schema::{RosMessage, RosSchema};
use crate::streams::{LogLevel, LogLine};

/// rcl_interfaces/msg/Log; levels 10 debug, 20 info, 30 warn, 40 error, 50 fatal.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Log {
    /// Sender's clock.
    pub stamp: Time,
    /// Severity; a number between two levels means the lower one.
    pub level: u8,
    /// Part of the program that writes the line.
    pub name: String,
    /// Content of the line.
    pub msg: String,
    /// Source file; empty in our recordings.
    pub file: String,
    /// Function of the source; empty in our recordings.
    pub function: String,
    /// Line of the source; 0 in our recordings.
    pub line: u32,
}

message!(
    Log,
    "rcl_interfaces/msg/Log",
    "byte DEBUG=10\nbyte INFO=20\nbyte WARN=30\nbyte ERROR=40\nbyte FATAL=50\n",
    "builtin_interfaces/Time stamp\nuint8 level\nstring name\nstring msg\nstring file\nstring function\nuint32 line\n",
    time!(),
);

/// Number of each level in a file, ascending.
const LEVELS: [(u8, LogLevel); 4] =
    [(10, LogLevel::Debug), (20, LogLevel::Info), (30, LogLevel::Warn), (40, LogLevel::Error)];

pub(in crate::log) fn to_ros(m: &LogLine) -> Result<Log, EncodeError> {
    let (level, _) = LEVELS.into_iter().find(|(_, level)| *level == m.level).expect("every level has a number");
    Ok(Log { stamp: m.stamp.try_into()?, level, name: m.name.clone(), msg: m.text.clone(), ..Log::default() })
}

/// Converts a line; a level between two levels becomes the lower one.
pub(in crate::log) fn from_ros(m: Log) -> Result<LogLine, DecodeRejection> {
    let level =
        LEVELS.into_iter().rev().find(|(least, _)| m.level >= *least).map_or(LogLevel::Debug, |(_, level)| level);
    Ok(LogLine { stamp: m.stamp.try_into()?, level, name: m.name, text: m.msg })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_in_between_are_the_lower_one() {
        let level = |level| from_ros(Log { level, ..Log::default() }).unwrap().level;
        assert_eq!([0, 9, 19].map(level), [LogLevel::Debug; 3]);
        assert_eq!([20, 29, 30, 39].map(level), [LogLevel::Info, LogLevel::Info, LogLevel::Warn, LogLevel::Warn]);
        assert_eq!([40, 50, 255].map(level), [LogLevel::Error; 3]);
    }
}
