//! Time stamps of external messages.

use crate::log::ros::Time;
use crate::time::Stamp;

/// The header's stamp, or the log time where that is zero or invalid.
pub(super) fn stamp_or_log_time(stamp: Time, log_time: Stamp) -> Stamp {
    Stamp::try_from(stamp).ok().filter(|stamp| stamp.nanos != 0).unwrap_or(log_time)
}
