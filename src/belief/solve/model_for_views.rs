//! The choice of the estimated quantities, by the contents of a recording.

use crate::model::blocks::{Block, Shown};
use crate::model::estimated::Model;
use crate::model::parameters::ParameterKind;
pub use crate::solve::constants::model_for_views::MIN_GRIPPER_VIEWS;
use crate::solve::constants::model_for_views::{DIVED_PA, WARMED_K};
use crate::views::view::View;
use armcal_core::robot::Robot;
use armcal_core::sensor::{Conditions, N_SHAPE};

/// All coefficients of the nonlinearity.
pub(crate) fn shape_kinds() -> impl Iterator<Item = ParameterKind> {
    (0..N_SHAPE).map(|h| ParameterKind::Shape(h as u8))
}

/// Model by what the recording can tell: terms whose cause did not change have no column.
#[must_use]
pub fn model_for(robot: &Robot, views: &[View]) -> Model {
    let spread = |f: &dyn Fn(&Conditions) -> Option<f64>| {
        let values = views.iter().filter_map(|v| f(&v.conditions));
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        if high > low { high - low } else { 0.0 }
    };
    let warmed = spread(&|c| c.oil_c) > WARMED_K;
    let dived = spread(&|c| c.pressure_pa) > DIVED_PA;
    let gripper_tag = views.iter().filter(|view| view.gripper_tag.is_some()).count() >= MIN_GRIPPER_VIEWS;
    let from_both_sides =
        |joint: usize| [-1.0, 1.0].iter().all(|side| views.iter().any(|v| v.approach[joint] == *side));
    let shown = Shown { motion: false, gripper_tag, by_camera: &|camera| has_views(views, camera) };
    model_of(robot, &Scope { warmed, dived, from_both_sides: &from_both_sides, shown })
}

/// Returns true where the camera of that number shows tags, as the first one always does.
pub(crate) fn has_views(views: &[View], camera: usize) -> bool {
    camera == 0 || views.iter().any(|view| view.camera == camera && !view.tags.is_empty())
}

/// Effects that a recording can constrain.
pub(crate) struct Scope<'a> {
    /// The oil's temperature and the pressure change.
    pub warmed: bool,
    pub dived: bool,
    /// True for a joint (by index) that came to rest from both sides.
    pub from_both_sides: &'a dyn Fn(usize) -> bool,
    pub shown: Shown<'a>,
}

/// Sensors before the camera, or before the tag on the gripper, with the mount and the tags.
pub(crate) fn model_of(robot: &Robot, scope: &Scope<'_>) -> Model {
    let gripper_joints = robot.gripper_tag.filter(|_| scope.shown.gripper_tag).map_or(0, |tag| tag.mount.n_joints);
    let last = gripper_joints.max(robot.n_seen_joints());
    let joint = |joint: usize| {
        let spec = &robot.sensors[joint];
        // A datasheet that leaves nothing open leaves nothing to estimate.
        if joint >= last || (spec.gain_std <= 0.0 && spec.offset_std_rad <= 0.0) {
            return Vec::new();
        }
        let wanted = [
            (spec.gain_std > 0.0, ParameterKind::Gain),
            (spec.offset_std_rad > 0.0, ParameterKind::Offset),
            (scope.warmed, ParameterKind::OffsetPerK),
            (scope.warmed, ParameterKind::GainPerK),
            (scope.dived, ParameterKind::OffsetPerMpa),
            ((scope.from_both_sides)(joint), ParameterKind::HalfBacklash),
        ];
        let kinds = wanted.into_iter().filter(|(wanted, _)| *wanted).map(|(_, kind)| kind);
        kinds.chain(shape_kinds().filter(|_| spec.linearity_std_rad > 0.0)).collect()
    };
    let joints = (0..robot.n_joints()).map(joint).collect();
    let blocks = Block::all(robot).filter(|block| block.is_told(robot, &scope.shown));
    Model { joints, ..Model::of_blocks(0, blocks) }
}

/// The middle of the views' conditions.
#[must_use]
pub fn reference(views: &[View]) -> Conditions {
    let mean = |f: &dyn Fn(&Conditions) -> Option<f64>| {
        let values: Vec<f64> = views.iter().filter_map(|v| f(&v.conditions)).collect();
        (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
    };
    let stamps = views.iter().filter_map(|v| v.conditions.stamp);
    let (first, last) = (stamps.clone().min(), stamps.max());
    let middle = first.zip(last).map(|(a, b)| a.plus_s(0.5 * b.since_s(a)));
    Conditions { oil_c: mean(&|c| c.oil_c), pressure_pa: mean(&|c| c.pressure_pa), stamp: middle }
}
