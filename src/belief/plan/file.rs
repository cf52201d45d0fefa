//! plan.toml: a plan for operators, checks and renderings.

use crate::plan::constants::file::{COUNT_DIGITS, LEFT_OUT_DIGITS, LENGTH_DIGITS, RAD_DIGITS, TIME_DIGITS};
use armcal_core::codes::Code;
use armcal_core::codes::Warning;
use std::path::Path as FilePath;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::plan::capture_plan::{ArmBelief, CapturePlan, LeastClearance, PlannedVisit};
use crate::plan::clearance::ClosestPair;
use crate::plan::motion::timing::Timing;
use crate::plan::view_planning::StopReason;
use armcal_core::document::{VERSION, parse_file};
use armcal_core::kind::Kind;
use armcal_core::robot::{FileIssue, Robot, RobotError, read_text};
use armcal_core::schema::{first_line, schema_of};
use armcal_core::streams::{CaptureSet, JointAngles, MAX_JOINTS};

/// One plan. Angles are estimated joint angles, rad; counts are the values sent to the arm's controller for them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlanFile {
    /// Version of the format: 1.
    pub version: u32,
    /// [`Kind::Plan`].
    #[serde(default = "Kind::plan")]
    pub kind: Kind,
    /// Name of the routine.
    pub routine: String,
    /// Name of the robot.
    pub robot: String,
    /// Name of the vehicle.
    pub vehicle: String,
    /// Seed of the plan's random numbers.
    pub seed: u64,
    /// Hash of the routine with its overrides, the robot's and the vehicle's files, the prior and the program's
    /// version.
    pub inputs_hash: String,
    /// `datasheet`, or the hash of the messages from which the calibration given as a prior was estimated.
    pub prior: String,
    /// Names of the joints in the order of all lists, base first.
    pub joints: Vec<String>,
    /// Clearance kept in addition to the sensors' error bounds, m.
    pub margin_m: f64,
    /// Estimated angles at the arm's start, rad.
    pub start_rad: Vec<f64>,
    /// Sensor readings at the start by the estimate, counts.
    pub start_counts: Vec<f64>,
    /// Targets of the task that cannot be reached under this estimate, assumptions, and what does not suffice.
    pub warnings: Vec<Warning>,
    /// Totals over the plan.
    pub totals: PlanTotals,
    /// Planned views in the order of visits.
    pub pose: Vec<PoseTable>,
    /// Paths: `path[n]` leads to `pose[n]`.
    pub path: Vec<PathTable>,
    /// Chosen poses that no path leads to.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<LeftOutTable>,
}

/// Totals over a plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlanTotals {
    /// Number of planned views.
    pub poses: usize,
    /// Number of chosen poses that no path leads to.
    pub left_out: usize,
    /// Arm time for paths, settling and dwell, s.
    pub arm_time_s: f64,
    /// Time of the paths alone, s.
    pub motion_s: f64,
    /// Least certified clearance over all paths, for every arm within the error bounds, m.
    pub least_clearance_m: f64,
    /// Predicted root mean square tool error over the task's targets after the last view, m; absent if nothing predicts
    /// it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub predicted_tool_error_m: Option<f64>,
    /// Reason why there are no more views.
    pub stop_reason: StopReason,
}

/// One planned view.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PoseTable {
    /// Number of the view, from 1, in the order of visits.
    pub number: usize,
    /// Use of the view: for the fit, or held out.
    pub set: SetName,
    /// Estimated angles, rad.
    pub angles_rad: Vec<f64>,
    /// Set-point: the sensor readings there by the estimate, counts.
    pub raw_counts: Vec<f64>,
    /// Largest distance of each joint's true angle from the estimated one, rad.
    pub error_bound_rad: Vec<f64>,
    /// Predicted root mean square tool error over the task's targets once this view and those before it are fitted, m;
    /// absent if unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub predicted_tool_error_m: Option<f64>,
    /// Clearance of an arm at the estimated angles, beyond the bound on the vehicle's motion, m; 0.4 stands for all
    /// above.
    pub clearance_m: f64,
    /// Certified clearance of every arm within the error bounds, m.
    pub proven_clearance_m: f64,
    /// Names of the two closest parts; absent if nothing is within 0.4 m.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub clearance_between: Vec<String>,
    /// Arm time since the start when the view is captured, s.
    pub arm_time_s: f64,
    /// Surveyed tags for which the view is planned.
    pub tags: Vec<TagTable>,
}

/// Use of a view.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SetName {
    /// Used by the fit.
    Fit,
    /// Held out: used only by the verdict.
    HeldOut,
}

/// A tag for which a view is planned.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TagTable {
    /// Number of the tag.
    pub id: u32,
    /// Probability that the camera sees the tag, under the estimate.
    pub probability: f64,
}

/// The path to one view.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PathTable {
    /// Number of the pose at which the path starts; 0 is the start.
    pub from: usize,
    /// Number of the pose at which the path ends.
    pub to: usize,
    /// Time of the motion alone, s.
    pub duration_s: f64,
    /// Least clearance of an arm at the estimated angles along the path, by samples, m.
    pub clearance_m: f64,
    /// Least certified clearance of every arm within the error bounds along the path, m.
    pub proven_clearance_m: f64,
    /// Estimated angles of all waypoints, both ends included, rad. Straight lines in joint space connect them, each
    /// from rest to rest.
    pub waypoints_rad: Vec<Vec<f64>>,
    /// Sensor readings at the waypoints by the estimate, counts.
    pub waypoints_counts: Vec<Vec<f64>>,
    /// Duration of the edge after each waypoint but the last, s. Edges that must be driven slowly take longer than
    /// their joints need.
    pub edge_durations_s: Vec<f64>,
}

/// A pose that no path leads to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LeftOutTable {
    /// Estimated angles, rad.
    pub angles_rad: Vec<f64>,
    /// Reason why there is no path.
    pub reason: String,
}

/// Returns the schema of a plan.
#[must_use]
pub fn plan_schema() -> serde_json::Value {
    schema_of::<PlanFile>(Kind::Plan)
}

const HEAD: &str = "\
# Poses to look from and the paths between them, planned before anything moves. Angles (rad) are believed ones; raw
# counts are the set-points that an operator commands for them. Every arm within error_bound_rad keeps
# proven_clearance_m.
";

impl PlanFile {
    /// Returns the itinerary with its inputs. `header` gives names and hashes; the rest of it is replaced.
    #[must_use]
    pub fn new(header: PlanHeader, itinerary: &CapturePlan, belief: &ArmBelief, robot: &Robot) -> Self {
        let writer = Writer { belief, robot, timing: Timing::new(robot) };
        let visits = &itinerary.visits;
        let least_m = visits.iter().map(|visit| visit.path_clearance.proven_m).fold(f64::INFINITY, f64::min);
        Self {
            version: VERSION,
            kind: Kind::Plan,
            routine: header.routine,
            robot: robot.name.clone(),
            vehicle: header.vehicle,
            seed: header.seed,
            inputs_hash: header.inputs_hash,
            prior: belief.calibration.as_ref().map_or_else(|| "datasheet".to_owned(), |c| c.messages_hash.clone()),
            joints: robot.joint_names(),
            margin_m: header.margin_m,
            start_rad: radians(&itinerary.start),
            start_counts: writer.counts(&itinerary.start),
            warnings: itinerary.warnings.clone(),
            totals: PlanTotals {
                poses: visits.len(),
                left_out: itinerary.left_out.len(),
                arm_time_s: rounded(itinerary.arm_time_s, TIME_DIGITS),
                motion_s: rounded(visits.iter().map(|visit| visit.duration_s).sum(), TIME_DIGITS),
                least_clearance_m: floored(least_m.min(1.0), LENGTH_DIGITS),
                predicted_tool_error_m: visits.last().and_then(predicted),
                stop_reason: itinerary.stop,
            },
            pose: visits.iter().enumerate().map(|(n, visit)| writer.pose(n + 1, visit)).collect(),
            path: visits.iter().enumerate().map(|(n, visit)| writer.path(n, visit)).collect(),
            left_out: itinerary
                .left_out
                .iter()
                .map(|left| LeftOutTable { angles_rad: radians(&left.angles), reason: left.why.to_string() })
                .collect(),
        }
    }

    /// Returns the text of plan.toml.
    ///
    /// # Panics
    /// Never: every value here has a TOML form.
    #[must_use]
    pub fn to_toml(&self) -> String {
        let body = toml::to_string(self).expect("plain tables and finite numbers have a TOML form");
        format!("{}{HEAD}{body}", first_line(Kind::Plan))
    }

    /// Reads a plan.
    ///
    /// # Errors
    /// [`RobotError`] naming file, key and allowed range.
    pub fn read(file: &FilePath) -> Result<Self, RobotError> {
        let plan: Self = parse_file(Kind::Plan, file, &read_text(file)?)?;
        plan.check(file)?;
        plan.check_totals(file)?;
        Ok(plan)
    }

    /// Refuses totals that contradict the poses and paths below them.
    fn check_totals(&self, file: &FilePath) -> Result<(), FileIssue> {
        let least_m = self.path.iter().map(|path| path.proven_clearance_m).fold(1.0, f64::min);
        let totals = &self.totals;
        for (key, value, expected) in [
            ("totals.poses", totals.poses as f64, self.pose.len() as f64),
            ("totals.left_out", totals.left_out as f64, self.left_out.len() as f64),
            ("totals.least_clearance_m", totals.least_clearance_m, least_m),
        ] {
            if (value - expected).abs() > 0.5 / LENGTH_DIGITS {
                let problem = format!("is {value}, and the tables below give {expected}: it was edited; plan again");
                return Err(FileIssue::new(Code::KeysConflict, file, key, problem));
            }
        }
        Ok(())
    }

    fn check(&self, file: &FilePath) -> Result<(), FileIssue> {
        let range = |key: &str, value: f64, range| FileIssue::check_range(file, key, value, range).map(|_| ());
        range("joints (number)", self.joints.len() as f64, 1.0..=MAX_JOINTS as f64)?;
        range("margin_m", self.margin_m, 0.0..=1.0)?;
        let numbers = |key: String, list: &[f64]| {
            if list.len() != self.joints.len() {
                let problem = format!("has {} numbers, there are {} joints", list.len(), self.joints.len());
                return Err(FileIssue::new(Code::ValueCount, file, key, problem));
            }
            list.iter().try_for_each(|&value| range(&key, value, -1e9..=1e9))
        };
        numbers("start_rad".to_owned(), &self.start_rad)?;
        numbers("start_counts".to_owned(), &self.start_counts)?;
        if self.path.len() != self.pose.len() {
            let problem = format!(
                "{} paths for {} poses; each pose has the one that leads to it",
                self.path.len(),
                self.pose.len()
            );
            return Err(FileIssue::new(Code::ValueCount, file, "path", problem));
        }
        for (n, pose) in self.pose.iter().enumerate() {
            let key = |name: &str| format!("pose {}: {name}", n + 1);
            range(&key("number"), pose.number as f64, (n + 1) as f64..=(n + 1) as f64)?;
            numbers(key("angles_rad"), &pose.angles_rad)?;
            numbers(key("raw_counts"), &pose.raw_counts)?;
            numbers(key("error_bound_rad"), &pose.error_bound_rad)?;
            range(&key("clearance_m"), pose.clearance_m, 0.0..=1e3)?;
            range(&key("proven_clearance_m"), pose.proven_clearance_m, 0.0..=1e3)?;
            range(&key("arm_time_s"), pose.arm_time_s, 0.0..=1e9)?;
            pose.predicted_tool_error_m.map_or(Ok(()), |m| range(&key("predicted_tool_error_m"), m, 0.0..=1e3))?;
            pose.tags.iter().try_for_each(|tag| range(&key("tags.probability"), tag.probability, 0.0..=1.0))?;
        }
        for (n, path) in self.path.iter().enumerate() {
            let key = |name: &str| format!("path {}: {name}", n + 1);
            range(&key("from"), path.from as f64, n as f64..=n as f64)?;
            range(&key("to"), path.to as f64, (n + 1) as f64..=(n + 1) as f64)?;
            range(&key("duration_s"), path.duration_s, 0.0..=1e9)?;
            range(&key("waypoints_rad (number)"), path.waypoints_rad.len() as f64, 2.0..=1e6)?;
            let n_counts = path.waypoints_counts.len() as f64;
            range(
                &key("waypoints_counts (number)"),
                n_counts,
                path.waypoints_rad.len() as f64..=path.waypoints_rad.len() as f64,
            )?;
            let n_edges = path.waypoints_rad.len() as f64 - 1.0;
            range(&key("edge_durations_s (number)"), path.edge_durations_s.len() as f64, n_edges..=n_edges)?;
            path.edge_durations_s.iter().try_for_each(|&s| range(&key("edge_durations_s"), s, 0.0..=1e9))?;
            path.waypoints_rad.iter().try_for_each(|waypoint| numbers(key("waypoints_rad"), waypoint))?;
            path.waypoints_counts.iter().try_for_each(|waypoint| numbers(key("waypoints_counts"), waypoint))?;
        }
        Ok(())
    }
}

/// Names and hashes of the inputs of a plan.
#[derive(Clone, Debug)]
pub struct PlanHeader {
    /// Name of the routine.
    pub routine: String,
    /// Name of the vehicle.
    pub vehicle: String,
    /// Seed of the plan's random numbers.
    pub seed: u64,
    /// Hash of all inputs, see [`PlanFile::inputs_hash`].
    pub inputs_hash: String,
    /// Clearance kept, m, see [`PlanFile::margin_m`].
    pub margin_m: f64,
}

/// Converts visits to tables.
struct Writer<'a> {
    belief: &'a ArmBelief,
    robot: &'a Robot,
    timing: Timing,
}

impl Writer<'_> {
    fn counts(&self, angles: &JointAngles) -> Vec<f64> {
        let counts = self.belief.sensors.counts(angles);
        let with_digits = |(joint, &counts): (usize, &f64)| {
            let digits = digits_in_file(self.robot.sensors[joint].counts_per_rad);
            rounded(counts, 10f64.powi(digits as i32))
        };
        counts.iter().enumerate().map(with_digits).collect()
    }

    fn pose(&self, number: usize, visit: &PlannedVisit) -> PoseTable {
        let (pose, LeastClearance { believed_m, proven_m }) = (&visit.pose, visit.clearance);
        let ClosestPair { first, second, .. } = &visit.nearest;
        PoseTable {
            number,
            set: match pose.set {
                CaptureSet::Fit => SetName::Fit,
                CaptureSet::HeldOut => SetName::HeldOut,
            },
            angles_rad: radians(&pose.angles),
            raw_counts: self.counts(&pose.angles),
            error_bound_rad: radians(&visit.error_bound_rad),
            predicted_tool_error_m: predicted(visit),
            clearance_m: floored(believed_m, LENGTH_DIGITS),
            proven_clearance_m: floored(proven_m, LENGTH_DIGITS),
            clearance_between: [first, second].into_iter().filter(|name| !name.is_empty()).cloned().collect(),
            arm_time_s: rounded(visit.arm_time_s, TIME_DIGITS),
            tags: pose
                .tags
                .iter()
                .filter_map(|&(idx, probability)| {
                    let id = self.robot.tags.get(idx)?.id;
                    Some(TagTable { id, probability: rounded(probability, 1e3) })
                })
                .collect(),
        }
    }

    fn path(&self, from: usize, visit: &PlannedVisit) -> PathTable {
        let edges_s = visit.path.edges().map(|edge| self.timing.edge_duration_s(&edge));
        PathTable {
            from,
            to: from + 1,
            duration_s: rounded(visit.duration_s, TIME_DIGITS),
            clearance_m: floored(visit.path_clearance.believed_m, LENGTH_DIGITS),
            proven_clearance_m: floored(visit.path_clearance.proven_m, LENGTH_DIGITS),
            waypoints_rad: visit.path.waypoints.iter().map(radians).collect(),
            waypoints_counts: visit.path.waypoints.iter().map(|waypoint| self.counts(waypoint)).collect(),
            edge_durations_s: edges_s.map(|duration_s| rounded(duration_s, TIME_DIGITS)).collect(),
        }
    }
}

/// Returns the digits after the point of a set-point in the table for people.
#[must_use]
pub fn count_digits(counts_per_rad: f64) -> usize {
    digits_in_file(counts_per_rad) - LEFT_OUT_DIGITS
}

/// Digits after the point that a set-point needs for a millionth of a radian, at least those left out for people.
fn digits_in_file(counts_per_rad: f64) -> usize {
    let [least, most] = COUNT_DIGITS;
    let digits = (RAD_DIGITS / counts_per_rad.abs()).log10().ceil().max(0.0);
    (digits as usize).clamp(least, most)
}

fn predicted(visit: &PlannedVisit) -> Option<f64> {
    let predicted_m = visit.pose.predicted_tool_error_m;
    predicted_m.is_finite().then(|| rounded(predicted_m, 1e6))
}

fn radians(angles: &JointAngles) -> Vec<f64> {
    angles.iter().map(|&angle| rounded(angle, RAD_DIGITS)).collect()
}

fn rounded(value: f64, digits: f64) -> f64 {
    // Adding zero turns -0 into 0.
    (value * digits).round() / digits + 0.0
}

/// Rounds a clearance down, because it is guaranteed.
fn floored(value: f64, digits: f64) -> f64 {
    (value * digits).floor() / digits
}
