//! The arm's geometry as built: joints in their parent links, tool point, frame of the tag survey.
//!
//! The errors have the standard deviations of `[geometry]` in robot.toml, the same that the estimator assumes,
//! independent per axis.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3, Vector6};
use serde::{Deserialize, Serialize};

use crate::as_built::normal::normal_vector;
use crate::as_built::pose::normal_twist;
use crate::as_built::tags::TagAsBuilt;
use crate::spec::GeometrySpec;
use armcal_core::kinematics::{LinkCorrection, LinkCorrections};
use armcal_core::robot::Robot;

/// Geometry errors of one arm against its nominal model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GeometryAsBuilt {
    /// Shift of the tool point along the axes of its link.
    pub tool_shift_m: [f64; 3],
    /// Error of the tag survey's frame at the first joint's origin, along and about the base's axes.
    pub survey: PlaceError,
    /// Errors of the joints' poses in their parent links, base first.
    pub joints: Vec<PlaceError>,
}

/// Error of a pose, along and about the axes of the frame in which it is stated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PlaceError {
    /// Shift of the origin.
    pub shift_m: [f64; 3],
    /// Rotation vector, about the origin.
    pub turn_rad: [f64; 3],
}

impl GeometryAsBuilt {
    /// Draws the errors; `None` in a world whose arm is as in the URDF.
    pub(super) fn draw(robot: &Robot, spec: &GeometrySpec, seed: u64) -> Option<Self> {
        let ratio = spec.error_ratio;
        if ratio <= 0.0 {
            return None;
        }
        let sigmas = &robot.geometry;
        let place = |stream: &str| {
            let stream = format!("as_built/geometry/{stream}");
            let [shift, turn] = [sigmas.link_position_std_m, sigmas.link_rotation_std_rad].map(|std| ratio * std);
            PlaceError::of(&normal_twist(seed, &stream, shift, turn))
        };
        let tool = normal_vector(seed, "geometry/tool", ratio * sigmas.tool_position_std_m);
        let joints = robot.chain.joints().iter().map(|joint| place(&format!("joint/{}", joint.name)));
        Some(Self { tool_shift_m: tool.into(), survey: place("survey"), joints: joints.collect() })
    }

    /// Returns the nominal arm with these errors.
    pub(super) fn applied_to(&self, nominal: &Robot) -> Robot {
        let mut corrections = LinkCorrections::default();
        for (place, error) in corrections.places.iter_mut().zip(&self.joints) {
            *place = LinkCorrection { shift_m: error.shift_m.into(), turn_rad: error.turn_rad.into() };
        }
        let mut arm = Robot { chain: nominal.chain.corrected(&corrections), ..nominal.clone() };
        arm.tool.mount.link_from_frame.translation.vector += Vector3::from(self.tool_shift_m);
        arm
    }

    /// Moves the tags with the frame of their survey. Tags on a link turn about that link's own origin.
    pub(super) fn move_survey(&self, nominal: &Robot, tags: &mut [TagAsBuilt]) {
        let pivot = if nominal.is_watched() { Isometry3::identity() } else { nominal.chain.first_place() };
        let motion = self.survey.about(&pivot.translation.vector);
        tags.iter_mut().for_each(|tag| tag.move_by(&motion));
    }
}

impl PlaceError {
    fn of(twist: &Vector6<f64>) -> Self {
        let three = |first: usize| twist.fixed_rows::<3>(first).into_owned().into();
        Self { shift_m: three(0), turn_rad: three(3) }
    }

    /// Returns the rigid motion of a body with this error, turned about `pivot`.
    fn about(&self, pivot: &Vector3<f64>) -> Isometry3<f64> {
        let turn = UnitQuaternion::from_scaled_axis(Vector3::from(self.turn_rad));
        Translation3::from(pivot + Vector3::from(self.shift_m)) * turn * Translation3::from(-pivot)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::as_built::AsBuilt;
    use crate::as_built::tests::{assert_normal, robot};
    use crate::spec::WorldSpec;
    use armcal_core::robot::geometry::GeometryPriors;

    fn drawn(ratio: f64) -> WorldSpec {
        WorldSpec { geometry: GeometrySpec { error_ratio: ratio }, ..WorldSpec::default() }
    }

    #[test]
    fn without_the_key_the_arm_is_as_in_the_urdf() {
        let robot = robot();
        let built = AsBuilt::draw(&robot, &WorldSpec::default(), 3);
        assert_eq!(built.geometry, None);
        let arm = built.arm(&robot);
        for (as_built, nominal) in arm.chain.joints().iter().zip(robot.chain.joints()) {
            assert_eq!(as_built.parent_from_joint, nominal.parent_from_joint);
        }
        assert_eq!(arm.tool.mount.link_from_frame, robot.tool.mount.link_from_frame);
    }

    /// Each error is normal with its own standard deviation in robot.toml, times the ratio.
    #[test]
    fn errors_have_the_stated_sigmas() {
        const SEEDS: u64 = 1000;
        let mut robot = robot();
        robot.geometry = GeometryPriors {
            link_position_std_m: 1e-3,
            link_rotation_std_rad: 2e-3,
            tool_position_std_m: 3e-3,
            ..robot.geometry
        };
        for ratio in [1.0, 2.5] {
            let draw = |seed| GeometryAsBuilt::draw(&robot, &drawn(ratio).geometry, seed).expect("a geometry");
            let all: Vec<GeometryAsBuilt> = (0..SEEDS).map(draw).collect();
            let column = |f: &dyn Fn(&GeometryAsBuilt) -> f64| all.iter().map(f).collect::<Vec<f64>>();
            for axis in 0..3 {
                assert_normal("tool", &column(&|g| g.tool_shift_m[axis]), ratio * 3e-3);
                assert_normal("survey shift", &column(&|g| g.survey.shift_m[axis]), ratio * 1e-3);
                assert_normal("survey turn", &column(&|g| g.survey.turn_rad[axis]), ratio * 2e-3);
                for joint in 0..robot.n_joints() {
                    assert_normal("joint shift", &column(&|g| g.joints[joint].shift_m[axis]), ratio * 1e-3);
                    assert_normal("joint turn", &column(&|g| g.joints[joint].turn_rad[axis]), ratio * 2e-3);
                }
            }
        }
    }

    /// The arm has the errors at the poses that the estimator corrects, and the tags move as one.
    #[test]
    fn arm_and_tags_have_the_drawn_errors_and_nothing_else_moves() {
        let robot = robot();
        let [plain, built] = [&WorldSpec::default(), &drawn(1.0)].map(|spec| AsBuilt::draw(&robot, spec, 4));
        let geometry = built.geometry.as_ref().expect("a geometry");
        let arm = built.arm(&robot);
        for ((joint, nominal), error) in arm.chain.joints().iter().zip(robot.chain.joints()).zip(&geometry.joints) {
            let (place, at) = (joint.parent_from_joint, nominal.parent_from_joint);
            let shift = place.translation.vector - at.translation.vector - Vector3::from(error.shift_m);
            let turn = (place.rotation * at.rotation.inverse()).scaled_axis() - Vector3::from(error.turn_rad);
            assert!(shift.norm() < 1e-15 && turn.norm() < 1e-12, "{shift} {turn}");
        }
        let [tool, nominal] = [&arm, &robot].map(|robot| robot.tool.mount.link_from_frame.translation.vector);
        assert!((tool - nominal - Vector3::from(geometry.tool_shift_m)).norm() < 1e-15);

        let pivot = robot.chain.first_place().translation.vector;
        let motion = geometry.survey.about(&pivot);
        let moved = (motion * nalgebra::Point3::from(pivot)).coords - pivot;
        assert!((moved - Vector3::from(geometry.survey.shift_m)).norm() < 1e-15);
        for (tag, before) in built.tags.iter().zip(&plain.tags) {
            let expected = motion * before.base_from_tag().isometry();
            let apart = expected.inverse() * tag.base_from_tag().isometry();
            assert!(apart.translation.vector.norm() < 1e-12 && apart.rotation.angle() < 1e-12, "{apart}");
        }
        let AsBuilt { geometry: _, tags: _, joints, camera_mount, gripper_tag, .. } = built;
        assert_eq!((joints, camera_mount, gripper_tag), (plain.joints, plain.camera_mount, plain.gripper_tag));
    }
}
