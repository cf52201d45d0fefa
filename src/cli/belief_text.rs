//! The online estimate of an arm, in words.

use crate::cli::exit::{Exit, UsageError};
use crate::cli::stdout::warn;
use armcal_belief::calib::online::{BeliefRow, Follower};
use armcal_core::codes::{Code, Coded};
use armcal_core::stats::Summary;

/// Estimate at the end, with a note on the tags that were not used.
///
/// # Errors
/// No view was used; the error gives the reason.
pub(super) fn belief(follower: &Follower) -> Result<BeliefRow, UsageError> {
    let tags = follower.estimator().robot().tags.iter().filter(|tag| !tag.is_known());
    let ids: Vec<String> = tags.map(|tag| tag.id.to_string()).collect();
    let unknown = format!("tags {}", ids.join(", "));
    match follower.belief() {
        None if ids.is_empty() => {
            Err(UsageError::new(Code::TagsNotSeen, "no view with tags: there is nothing to believe".to_owned()))
        }
        None => Err(UsageError::new(
            Code::TagsNotSeen,
            format!(
                "no view of a tag whose place is known ({unknown} have none): map them with `armcal tagmap` and give \
                 the map with --tag-map"
            ),
        )),
        Some(row) => {
            if !ids.is_empty() {
                warn(Code::TagsUnknown, format_args!("the place of {unknown} is not known: they are not used"));
            }
            Ok(row)
        }
    }
}

fn mm(summary: &Summary) -> String {
    format!("{:.2} mm median, {:.2} mm worst", 1e3 * summary.median, 1e3 * summary.max)
}

/// Summary of the estimate at the end.
pub(super) fn summary(follower: &Follower, row: &BeliefRow) -> String {
    let doubt = doubt(follower).map(|doubt| format!("not good enough: {doubt}"));
    let health = doubt.as_deref().unwrap_or(match follower.is_good_enough() {
        Some(true) => "good enough for the task, as far as the sensors go (links and tool point are taken as drawn)",
        Some(false) => "not good enough for the task: views are needed",
        None => "no task is named: no limit to compare with",
    });
    format!(
        "views        {}\n\
         tool error   {} over the targets now\n             {} over the targets in an hour without views\n\
         health       {health}",
        row.views,
        mm(&row.tool_error_m),
        mm(&row.tool_error_in_an_hour_m),
    )
}

/// Estimate at one time, in one line.
pub(super) fn line(follower: &Follower, row: &BeliefRow) -> String {
    let health = match follower.is_good_enough() {
        Some(true) => ", good enough",
        Some(false) => ", NOT good enough",
        None => "",
    };
    let (now, later) = (mm(&row.tool_error_m), mm(&row.tool_error_in_an_hour_m));
    let doubt = doubt(follower).map(|doubt| format!(": {doubt}")).unwrap_or_default();
    format!("{} views, tool error {now}; in an hour {later}{health}{doubt}", row.views)
}

/// Reason not to rely on the belief as a whole, with its code.
fn doubt(follower: &Follower) -> Option<String> {
    follower.doubt().map(|doubt| format!("{doubt} [{}]", doubt.code()))
}

/// Exit by the estimate at the end; `else_by_data` if it is good enough or has no limit.
pub(super) fn exit_of(follower: &Follower, else_by_data: Exit) -> Exit {
    if follower.is_good_enough() == Some(false) { Exit::Refused } else { else_by_data }
}
