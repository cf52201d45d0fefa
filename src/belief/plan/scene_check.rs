//! Checks of arm, vehicle, scene and task for errors that can be detected before any motion.

use crate::plan::constants::scene_check::{DRAWS_PER_TAG, EVEN_DRAWS, INSIDE_M};
use armcal_core::codes::{Code, Warning};
use std::collections::BTreeMap;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::plan::bounds::joint_bounds::JointErrorBounds;
use crate::plan::clearance::ClearanceModel;
use crate::plan::targets::plan_task;
use crate::plan::view_planning::camera_ik::CameraGoal;
use crate::plan::visibility::VisibilityModel;
use armcal_core::kinematics::JointLimits;
use armcal_core::optics::square_corners;
use armcal_core::robot::Robot;
use armcal_core::routine::{Routine, Step};
use armcal_core::streams::JointAngles;
use armcal_core::text::counted;

/// Inputs of the check.
pub struct SceneCheck<'a> {
    /// Nominal arm on its vehicle.
    pub robot: &'a Robot,
    /// Task, script and margins.
    pub routine: &'a Routine,
    /// Clearance model with the jaws at rest.
    pub clearance: &'a ClearanceModel<'a>,
    /// Clearance model with the jaws as they are at the task's targets.
    pub clearance_at_targets: &'a ClearanceModel<'a>,
}

/// Issues found by the check.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SceneIssues {
    /// Issues for which a run would be refused, or contradictions between the files.
    pub errors: Vec<String>,
    /// Issues that do not prevent a run.
    pub warnings: Vec<Warning>,
}

impl SceneCheck<'_> {
    /// Checks the stowed arm, the tags and the targets.
    #[must_use]
    pub fn issues(&self, rng: &mut ChaCha8Rng) -> SceneIssues {
        let mut issues = SceneIssues::default();
        for pair in self.clearance.overlaps(&self.robot.stowed) {
            issues.errors.push(format!("the arm is stowed inside something: {pair} overlap at stowed_rad"));
        }
        issues.errors.extend(self.tags_inside());
        if self.routine.steps.iter().any(|step| matches!(step, Step::Capture(_))) {
            self.look_for_tags(&mut issues, rng);
        }
        let bounds = JointErrorBounds::datasheet(self.robot);
        let targets = plan_task(self.robot, self.clearance_at_targets, &bounds, self.routine, rng);
        issues.errors.extend(targets.into_iter().filter_map(Result::err).map(|error| error.to_string()));
        issues
    }

    fn tags_inside(&self) -> Vec<String> {
        let base_from_tags = self.robot.base_from_tags(&self.robot.stowed);
        let inside = |tag: &armcal_core::robot::SurveyedTag| {
            let holder = square_corners(tag.size_m).iter().find_map(|corner| {
                let at = base_from_tags * tag.base_from_tag.isometry() * corner;
                self.clearance.holder(&at.coords, INSIDE_M)
            })?;
            Some(format!("tag {}: a corner is inside `{holder}`", tag.id))
        };
        self.robot.tags.iter().filter(|tag| tag.is_known()).filter_map(inside).collect()
    }

    /// Reports the tags that no drawn pose sees.
    fn look_for_tags(&self, issues: &mut SceneIssues, rng: &mut ChaCha8Rng) {
        let (robot, visibility) = (self.robot, VisibilityModel::default());
        let limits = JointErrorBounds::none(robot).safe_limits(robot);
        let mut seen = vec![false; robot.tags.len()];
        let mut hidden = vec![BTreeMap::<String, usize>::new(); robot.tags.len()];
        for draw in 0..EVEN_DRAWS + DRAWS_PER_TAG * robot.tags.len() {
            if seen.iter().zip(&robot.tags).all(|(seen, tag)| *seen || !tag.is_known()) {
                break;
            }
            let even = drawn(&limits, rng);
            let aim = if draw < EVEN_DRAWS { None } else { CameraGoal::draw(robot, &visibility, rng) };
            let angles = aim.map_or(even, |aim| aim.solve(robot, &limits, &even));
            let poses = robot.chain.link_poses(&angles);
            let news: Vec<usize> = visibility.in_view(robot, &poses).filter(|&tag| !seen[tag]).collect();
            if news.is_empty() || self.clearance.is_nearer_than(&angles, 1e-6) {
                continue;
            }
            for tag in news {
                match visibility.tag_hidden_by(robot, self.clearance, &poses, tag) {
                    None => seen[tag] = true,
                    Some(by) => *hidden[tag].entry(by.to_owned()).or_default() += 1,
                }
            }
        }
        for (tag, by) in robot.tags.iter().zip(&hidden).zip(&seen).filter_map(|(found, &seen)| (!seen).then_some(found))
        {
            let why = match by.iter().max_by_key(|(_, n)| **n) {
                Some((name, n)) => format!("in {n} of them `{name}` hides it"),
                None => "it is out of the camera's view in all".to_owned(),
            };
            let text = format!("tag {} is visible from none of the tried poses: {why}", tag.id);
            issues.warnings.push(Warning::new(Code::TagHidden, text));
        }
        let n_seen = seen.iter().filter(|seen| **seen).count();
        let min_tags = self.routine.capture.min_tags as usize;
        if n_seen < min_tags && robot.tags.iter().all(|tag| tag.is_known()) {
            issues
                .errors
                .push(format!("only {} can be seen at all; capture.min_tags is {min_tags}", counted(n_seen, "tag")));
        }
    }
}

fn drawn(limits: &[JointLimits], rng: &mut ChaCha8Rng) -> JointAngles {
    JointAngles::from_fn(limits.len(), |j| {
        rng.random_range(limits[j].lower_rad..=limits[j].upper_rad.max(limits[j].lower_rad))
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use armcal_core::robot::{Part, PlacedShape, Shape, Vehicle};
    use armcal_core::routine;
    use armcal_core::stats::stream_rng;

    struct Site {
        routine: Routine,
        robot: Robot,
        vehicle: Vehicle,
    }

    fn site(name: &str) -> Site {
        let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("routines");
        let routine = routine::load(&root.join(name)).expect("the routine reads");
        let (robot, vehicle) = routine.load_arm().expect("the arm reads");
        Site { routine, robot, vehicle }
    }

    impl Site {
        fn issues(&self) -> SceneIssues {
            let Self { routine, robot, vehicle } = self;
            let clearance = &ClearanceModel::new(robot, vehicle, &routine.scene);
            let check = SceneCheck { robot, routine, clearance, clearance_at_targets: clearance };
            check.issues(&mut stream_rng(1, "check"))
        }

        /// Adds a box at a point of the vehicle's frame.
        fn with_box(mut self, name: &str, at_m: [f64; 3], size_m: [f64; 3]) -> Self {
            let owner_from_shape = nalgebra::Isometry3::translation(at_m[0], at_m[1], at_m[2]);
            let placed = PlacedShape { owner_from_shape, shape: Shape::Box { size_m }, color_rgb: [0; 3] };
            self.routine.scene.obstacles.push(Part { name: name.to_owned(), placed });
            self
        }

        fn tag_in_vehicle_m(&self, tag: usize) -> [f64; 3] {
            let at = self.vehicle.vehicle_from_base.isometry() * self.robot.tags[tag].base_from_tag.isometry();
            at.translation.vector.into()
        }
    }

    #[test]
    fn the_routines_of_the_house_have_no_issues() {
        for name in ["titan4-quickstart.toml", "kraft-open-frame.toml", "tight-basket.toml", "under-ice.toml"] {
            assert_eq!(site(name).issues(), SceneIssues::default(), "{name}");
        }
    }

    #[test]
    fn what_is_wrong_is_named() {
        let stowed = site("titan4-quickstart.toml").with_box("crate", [2.3, -0.6, 0.6], [1.2; 3]);
        let around = site("titan4-quickstart.toml");
        let at_m = around.tag_in_vehicle_m(5);
        let around = around.with_box("lamp", at_m, [0.3; 3]);
        // A plate directly in front of the tag, which faces starboard.
        let covered = site("titan4-quickstart.toml");
        let [x, y, z] = covered.tag_in_vehicle_m(6);
        let covered = covered.with_box("plate", [x, y - 0.08, z], [0.5, 0.02, 0.5]);
        let mut far = site("titan4-quickstart.toml");
        far.routine.task.targets_m[3] = [5.0, 0.0, 0.0];
        let words = [stowed, around, covered, far].map(|site| {
            let SceneIssues { errors, warnings } = site.issues();
            let warnings = warnings.iter().map(|warning| format!("{warning}\n"));
            format!("errors:\n{}\nwarnings:\n{}", errors.join("\n"), warnings.collect::<String>())
        });
        insta::assert_snapshot!("scenes", words.join("\n"));
    }
}
