//! The arm at rest for a reach: readings and believed tool position, from the recording's reach marks.
//!
//! Conditions and readings are averaged over each mark; the sensors are those believed at its start.

use crate::views::conditions::ConditionHistory;
use crate::views::dropouts::replace_dropouts;
use armcal_core::kinematics::LinkCorrections;
use armcal_core::log::Recording;
use armcal_core::robot::Robot;
use armcal_core::sensor::{ArmSensors, Conditions};
use armcal_core::spatial::{Base, Pose, Tool};
use armcal_core::streams::{JointAngles, MarkKind, Message, ReachAttempt};
use armcal_core::time::Stamp;

/// The arm at rest for one target.
#[derive(Clone, Debug)]
pub struct ReachRest {
    /// State of the mark: before or after a calibration.
    pub attempt: ReachAttempt,
    /// Number of the task's target, from 0.
    pub target_idx: usize,
    /// Position of the target, base frame, m.
    pub target_m: [f64; 3],
    /// Start of the mark, by the joint sensors' clock.
    pub start: Stamp,
    /// End of the mark, by the joint sensors' clock.
    pub end: Stamp,
    /// Mean conditions over the mark, as far as they are recorded.
    pub conditions: Conditions,
    /// Believed joint angles, by the sensors at that time and these conditions, rad.
    pub believed: JointAngles,
    /// Believed pose of the tool, by the links at that time.
    pub believed_tool: Pose<Base, Tool>,
}

/// Belief of the arm from a stamp on.
#[derive(Clone, Copy, Debug)]
pub struct Belief<'a> {
    /// Start of the belief.
    pub from: Stamp,
    /// The believed sensors.
    pub sensors: &'a ArmSensors,
    /// Link corrections relative to the nominal model.
    pub links: LinkCorrections,
}

/// Returns the belief at `stamp`, or the first one before the first stamp. `beliefs` are in the order of time.
fn believed_at<'a>(beliefs: &[Belief<'a>], stamp: Stamp) -> Option<Belief<'a>> {
    let later = beliefs.partition_point(|belief| belief.from <= stamp);
    beliefs.get(later.saturating_sub(1)).copied()
}

/// Returns every reach of a recording, in the order of its marks. Marks without readings or without a target are
/// skipped.
#[must_use]
pub fn reaches(recording: &Recording, robot: &Robot, beliefs: &[Belief<'_>]) -> Vec<ReachRest> {
    let task = recording.messages.iter().find_map(|(_, message)| match message {
        Message::Task(task) => Some(task),
        _ => None,
    });
    let Some(task) = task else { return Vec::new() };
    let readings: Vec<_> = recording
        .messages
        .iter()
        .filter_map(|(_, message)| match message {
            Message::JointSensors(sample) => Some(sample),
            _ => None,
        })
        .collect();
    let surroundings = ConditionHistory::of(recording);
    let marks = recording.messages.iter().filter_map(|(_, message)| match message {
        Message::Mark(mark) => Some(mark),
        _ => None,
    });
    marks
        .filter_map(|mark| {
            let MarkKind::Reach { attempt, target_idx } = mark.kind else { return None };
            let target_m = *task.targets_m.get(target_idx as usize)?;
            let Belief { sensors, links, .. } = believed_at(beliefs, mark.start)?;
            let from = readings.partition_point(|sample| sample.stamp < mark.start);
            let to = readings.partition_point(|sample| sample.stamp <= mark.end);
            let span = readings.get(from..to).filter(|span| !span.is_empty())?;
            let conditions = surroundings.over(mark.start, mark.end);
            // Angles are averaged, not raw words, because words wrap.
            let mut readings: Vec<JointAngles> =
                span.iter().map(|sample| sensors.angles_under(&sample.counts, &conditions)).collect();
            replace_dropouts(&mut readings);
            let mut believed = JointAngles::zeros(robot.n_joints());
            for angles in &readings {
                for (sum, angle) in believed.iter_mut().zip(angles.iter()) {
                    *sum += angle / span.len() as f64;
                }
            }
            let tool = robot.chain.corrected_link_poses(&believed, &links).frame(&robot.tool.mount);
            Some(ReachRest {
                attempt,
                target_idx: target_idx as usize,
                target_m,
                start: mark.start,
                end: mark.end,
                conditions,
                believed,
                believed_tool: Pose::from_isometry(tool),
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::JointParameters;
    use armcal_core::streams::{JointSensorSample, Mark, ReachTask, TemperatureSample, Thermometer};
    use armcal_core::time::SIMULATION_EPOCH;

    /// Ten of 61 readings are dropouts of a wiper that has lost its track.
    #[test]
    fn dropouts_at_a_rest_do_not_move_the_tool_that_is_believed() {
        let folder = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots/titan4");
        let robot = armcal_core::robot::load(&folder).expect("the robot reads");
        let sensors = ArmSensors::nominal(&robot);
        let sound = sensors.counts(&robot.stowed);
        let mut lost = sound;
        lost[0] = sensors.counts(&JointAngles::from_fn(robot.n_joints(), |j| robot.stowed[j] + 1.0))[0];
        let at = |seconds: f64| SIMULATION_EPOCH.plus_s(seconds);
        let targets_m = vec![[1.0, 0.0, 0.0]];
        let task = Message::Task(ReachTask { stamp: at(0.0), targets_m, tolerance_m: 0.01, poses: Vec::new() });
        let reading = |k: usize| {
            let counts = if k % 6 == 5 { lost } else { sound };
            Message::JointSensors(JointSensorSample { stamp: at(10.0 + 0.01 * k as f64), counts })
        };
        let kind = MarkKind::Reach { attempt: ReachAttempt::After, target_idx: 0 };
        let mark = Message::Mark(Mark { start: at(10.0), end: at(10.6), kind });
        let messages = [task].into_iter().chain((0..=60).map(reading)).chain([mark]);
        let recording = Recording {
            path: "synthetic.mcap".into(),
            messages: messages.map(|message| (SIMULATION_EPOCH, message)).collect(),
            joint_names: robot.joint_names(),
            ..Default::default()
        };
        let belief = Belief { from: at(0.0), sensors: &sensors, links: LinkCorrections::default() };
        let rests = reaches(&recording, &robot, &[belief]);
        let off = rests[0].believed.iter().zip(robot.stowed.iter()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 1e-9, "{off} rad");
        let data = crate::views::association::associate(&recording, &robot);
        let rest = data.rests.get(&0).expect("a rest");
        assert!((rest[0] - robot.stowed[0]).abs() < 1e-9, "{rest:?}");
    }

    /// Two rests have the same readings, but the oil warms by 10 K in between.
    #[test]
    fn a_rest_is_believed_under_its_own_conditions() {
        let folder = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots/titan4");
        let robot = armcal_core::robot::load(&folder).expect("the robot reads");
        let at = |seconds: f64| SIMULATION_EPOCH.plus_s(seconds);
        let counts = ArmSensors::nominal(&robot).counts(&robot.stowed);
        let targets_m = vec![[1.0, 0.0, 0.0]];
        let mut messages =
            vec![Message::Task(ReachTask { stamp: at(0.0), targets_m, tolerance_m: 0.01, poses: Vec::new() })];
        for (start_s, temperature_c) in [(10.0, 20.0), (500.0, 30.0)] {
            let thermometer = Thermometer::Oil;
            let stamp = at(start_s - 5.0);
            messages.push(Message::Temperature(TemperatureSample {
                stamp,
                thermometer,
                temperature_c,
                variance_c2: 0.1,
            }));
            let stamp = at(start_s + 0.2);
            messages.push(Message::JointSensors(JointSensorSample { stamp, counts }));
            let kind = MarkKind::Reach { attempt: ReachAttempt::After, target_idx: 0 };
            messages.push(Message::Mark(Mark { start: at(start_s), end: at(start_s + 0.6), kind }));
        }
        let recording = Recording {
            path: "synthetic.mcap".into(),
            messages: messages.into_iter().map(|message| (SIMULATION_EPOCH, message)).collect(),
            joint_names: robot.joint_names(),
            ..Default::default()
        };
        let reference = Conditions { oil_c: Some(20.0), ..Conditions::default() };
        let mut parameters = JointParameters { reference, ..JointParameters::default() };
        parameters.terms[1].offset_rad_per_k = 1e-3;
        let sensors = parameters.sensors(&robot);
        let rests = reaches(
            &recording,
            &robot,
            &[Belief { from: at(0.0), sensors: &sensors, links: LinkCorrections::default() }],
        );
        let believed: Vec<f64> = rests.iter().map(|rest| rest.believed[1] - robot.stowed[1]).collect();
        assert!(believed[0].abs() < 1e-9 && (believed[1] - 1e-2).abs() < 1e-9, "{believed:?}");
        assert_eq!(rests[1].conditions.oil_c, Some(30.0));
        assert_ne!(rests[0].believed_tool.origin().vector(), rests[1].believed_tool.origin().vector());
    }
}
