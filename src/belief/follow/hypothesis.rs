//! Faults of the arm that may happen between two views: each widens the belief in the parameters that it changes.

use crate::explain::constants::failures::OTHER_GAIN_STD;
use crate::follow::constants::hypothesis::{
    BASE_STD, DRIFT_STD_RAD, LN_PRIOR, LN_PRIOR_OF_DRIFT, LN_PRIOR_OF_WORN, MOST_TAGS, MOUNT_STD, TAG_STD,
};
use nalgebra::{DMatrix, Matrix6};

use crate::follow::filter::Filter;
use crate::model::constants::scales::STEP_STD_RAD;
use crate::model::parameters::{Parameter, ParameterKind, WornSpot};
use crate::say;
use crate::say::finding::FindingKind;
use crate::views::view::View;
use armcal_core::robot::Robot;
use armcal_core::spatial::adjoint;

/// Indices of the tags on one carrier.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct TagSet {
    /// Indices in rising order, those in use first.
    indices: [u16; MOST_TAGS],
    n: u8,
}

impl TagSet {
    /// Returns a set of one tag; `None` if its index is too large.
    #[must_use]
    pub fn of(tag: usize) -> Option<Self> {
        Self { indices: [0; MOST_TAGS], n: 0 }.with(tag)
    }

    /// Returns the set with one more tag; `None` if it is in the set already, or the set is full.
    #[must_use]
    pub fn with(mut self, tag: usize) -> Option<Self> {
        let (tag, n) = (u16::try_from(tag).ok()?, usize::from(self.n));
        if n == MOST_TAGS || self.indices[..n].contains(&tag) {
            return None;
        }
        self.indices[n] = tag;
        self.n += 1;
        self.indices[..=n].sort_unstable();
        Some(self)
    }

    /// Returns the indices, in rising order.
    pub fn iter(&self) -> impl Iterator<Item = usize> + '_ {
        self.indices[..usize::from(self.n)].iter().map(|tag| usize::from(*tag))
    }
}

/// A fault that may have happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Fault {
    /// The sensor of a joint turned on its shaft.
    Slip(usize),
    /// The sensor of a joint has another scale or sign.
    Scale(usize),
    /// The sensor of a joint gives no information any more.
    Failed(usize),
    /// The track of a joint's sensor is worn at a place: a bump of its curve there.
    Worn(usize, WornSpot),
    /// The tag of that index was knocked aside.
    Tag(usize),
    /// Tags on one carrier were knocked aside together.
    Tags(TagSet),
    /// The camera slipped on its mount.
    Mount,
    /// All tags together moved, or the arm's base.
    Base,
    /// All sensors drifted more than expected: nothing to report.
    Drift,
}

impl Fault {
    /// Returns all faults that the views could show, except of ignored sensors. Tags that moved together are found by
    /// the evidence of one.
    pub(crate) fn all(filter: &Filter, views: &[&View]) -> Vec<Self> {
        let (Some(first), Some(last)) = (views.first(), views.last()) else { return Vec::new() };
        let mut tags: Vec<usize> = views.iter().flat_map(|view| &view.tags).map(|tag| tag.tag_idx).collect();
        tags.sort_unstable();
        tags.dedup();
        let joints = filter.offsets().map(|(joint, _)| joint).filter(|&joint| !last.is_free[joint]);
        let joints: Vec<usize> = joints.collect();
        let worn = |&joint: &usize| {
            let spots = [last, first].map(|view| WornSpot::about(view.travel_rad[joint]));
            let is_other = !spots[0].is_about(spots[1].at_rad());
            spots.into_iter().take(1 + usize::from(is_other)).map(move |spot| Self::Worn(joint, spot))
        };
        let of_spots: Vec<Self> = joints.iter().filter(|joint| !filter.has_bump(**joint)).flat_map(worn).collect();
        let of_joint = |joint: usize| [Self::Slip(joint), Self::Scale(joint), Self::Failed(joint)];
        let of_tags = tags.iter().map(|&tag| Self::Tag(tag)).filter(|_| tags.len() > 1);
        let of_mount = filter.mount_column().map(|_| Self::Mount);
        let base = (tags.len() > 1).then_some(Self::Base);
        std::iter::once(Self::Drift)
            .chain(joints.into_iter().flat_map(of_joint))
            .chain(of_spots)
            .chain(of_tags)
            .chain(of_mount)
            .chain(base)
            .collect()
    }

    /// Returns `ln` of its prior odds against no fault.
    pub(crate) fn ln_prior(self) -> f64 {
        match self {
            Self::Drift => LN_PRIOR_OF_DRIFT,
            Self::Worn(..) => LN_PRIOR_OF_WORN,
            _ => LN_PRIOR,
        }
    }

    /// Widens the belief in the parameters that the fault changes.
    pub(crate) fn open(self, filter: &mut Filter, robot: &Robot) {
        match self {
            Self::Slip(joint) => {
                let columns: Vec<_> = column(filter, joint, ParameterKind::Offset).into_iter().collect();
                filter.widen(&columns.iter().map(|at| (*at, STEP_STD_RAD.powi(2))).collect::<Vec<_>>());
            }
            Self::Scale(joint) => {
                let gain = column(filter, joint, ParameterKind::Gain).map(|at| (at, OTHER_GAIN_STD.powi(2)));
                let offset = column(filter, joint, ParameterKind::Offset).map(|at| (at, STEP_STD_RAD.powi(2)));
                filter.widen(&gain.into_iter().chain(offset).collect::<Vec<_>>());
            }
            Self::Drift => {
                let columns: Vec<_> = filter.offsets().map(|(_, at)| (at, DRIFT_STD_RAD.powi(2))).collect();
                filter.widen(&columns);
            }
            // A failed sensor changes how views are taken in, not the belief.
            Self::Failed(_) => {}
            Self::Worn(joint, spot) => {
                filter.add_parameter(robot, Parameter { joint, kind: ParameterKind::Bump(spot) });
            }
            Self::Tag(tag) => filter.widen(&six(filter.tag_column(tag), TAG_STD)),
            Self::Tags(tags) => filter.widen_along(&carrier_directions(filter, tags)),
            Self::Mount => filter.widen(&six(filter.mount_column(), MOUNT_STD)),
            Self::Base => {
                let along = base_directions(filter, robot);
                filter.widen_along(&along);
            }
        }
    }

    /// Returns the number of parameters that the fault opens from the start.
    pub(crate) fn numbers(self) -> usize {
        match self {
            Self::Slip(_) | Self::Worn(..) => 1,
            Self::Scale(_) => 2,
            Self::Tags(_) | Self::Mount | Self::Base => 6,
            // The number depends on the views.
            Self::Failed(_) | Self::Tag(_) | Self::Drift => 0,
        }
    }

    /// True if both faults are of the same sensor.
    pub(crate) fn is_of_same_sensor(self, other: Self) -> bool {
        let joint = |fault| match fault {
            Self::Slip(joint) | Self::Scale(joint) | Self::Failed(joint) | Self::Worn(joint, _) => Some(joint),
            _ => None,
        };
        joint(self).is_some() && joint(self) == joint(other)
    }

    /// Returns the kind as files write it.
    #[must_use]
    pub fn kind(self) -> FindingKind {
        match self {
            Self::Slip(_) => FindingKind::SensorSlip,
            Self::Scale(_) => FindingKind::SensorScale,
            Self::Failed(_) => FindingKind::SensorFailed,
            Self::Tag(_) => FindingKind::TagMoved,
            Self::Tags(_) => FindingKind::TagsMoved,
            Self::Mount => FindingKind::CameraMount,
            Self::Base => FindingKind::Base,
            Self::Worn(..) | Self::Drift => FindingKind::SensorWorn,
        }
    }

    /// Returns the name of the joint or tag.
    #[must_use]
    pub fn name(self, robot: &Robot) -> String {
        match self {
            Self::Slip(joint) | Self::Scale(joint) | Self::Failed(joint) | Self::Worn(joint, _) => {
                robot.sensors[joint].joint.clone()
            }
            Self::Tag(tag) => robot.tags[tag].id.to_string(),
            Self::Tags(tags) => {
                let ids: Vec<String> = tags.iter().map(|tag| robot.tags[tag].id.to_string()).collect();
                ids.split_last().map_or_else(String::new, |(last, first)| format!("{} and {last}", first.join(", ")))
            }
            Self::Mount => "camera mount".to_owned(),
            Self::Base => "base".to_owned(),
            Self::Drift => "sensors".to_owned(),
        }
    }

    /// Returns the user's text for one of several hypotheses.
    pub(crate) fn phrase(self, robot: &Robot) -> String {
        match self {
            Self::Drift => say::drift(),
            _ => say::explanation(self.kind(), &self.name(robot)),
        }
    }

    /// Returns the size of the fault: the displacement from belief `before` to belief `after`, m. For tags on one
    /// carrier it is the median displacement, m; for the camera mount the rotation, rad. For a slip it is the increase
    /// of the sensor's reading, rad; for a worn spot that at its middle, rad. For a scale fault it is the slope of the
    /// angle by the reading. `None` without a size.
    pub(crate) fn size(self, before: &Filter, after: &Filter) -> Option<f64> {
        match self {
            Self::Slip(joint) => {
                let offset = |filter: &Filter| filter.parameters().offset_rad[joint];
                // The angle falls by the increase of the reading.
                Some(offset(before) - offset(after))
            }
            Self::Scale(joint) => Some(after.parameters().gain[joint]),
            Self::Worn(joint, _) => Some(-after.parameters().terms[joint].bump.height_rad),
            Self::Failed(_) | Self::Drift => None,
            Self::Tag(tag) => Some(moved_m(before, after, tag)),
            Self::Tags(tags) => {
                let mut all_m: Vec<f64> = tags.iter().map(|tag| moved_m(before, after, tag)).collect();
                all_m.sort_by(f64::total_cmp);
                all_m.get(all_m.len() / 2).copied()
            }
            Self::Mount => Some((before.mount().rotation.inverse() * after.mount().rotation).angle()),
            Self::Base => Some(moved_m(before, after, 0)),
        }
    }
}

fn moved_m(before: &Filter, after: &Filter, tag: usize) -> f64 {
    (after.tag(tag).translation.vector - before.tag(tag).translation.vector).norm()
}

fn column(filter: &Filter, joint: usize, kind: ParameterKind) -> Option<usize> {
    filter.joint_parameters().iter().position(|p| *p == Parameter { joint, kind })
}

fn six(at: Option<usize>, [shift, turn]: [f64; 2]) -> Vec<(usize, f64)> {
    let variance = |k: usize| if k < 3 { shift * shift } else { turn * turn };
    at.into_iter().flat_map(|at| (0..6).map(move |k| (at + k, variance(k)))).collect()
}

/// Returns the directions of tags that move with their first tag as one body, each column times its std.
fn carrier_directions(filter: &Filter, tags: TagSet) -> DMatrix<f64> {
    let mut along = DMatrix::zeros(filter.n_columns(), 6);
    let std = Matrix6::from_diagonal(&nalgebra::Vector6::from_fn(|k, _| TAG_STD[k / 3]));
    let Some(first) = tags.iter().next().map(|tag| *filter.tag(tag)) else { return along };
    for tag in tags.iter() {
        let Some(at) = filter.tag_column(tag) else { continue };
        let by_first = adjoint(&filter.tag(tag).inv_mul(&first)) * std;
        along.fixed_view_mut::<6, 6>(at, 0).copy_from(&by_first);
    }
    along
}

/// Returns the directions of all tags that move with their common frame, each column times its std.
fn base_directions(filter: &Filter, robot: &Robot) -> DMatrix<f64> {
    let mut along = DMatrix::zeros(filter.n_columns(), 6);
    let std = Matrix6::from_diagonal(&nalgebra::Vector6::from_fn(|k, _| BASE_STD[k / 3]));
    for tag in 0..robot.tags.len() {
        let Some(at) = filter.tag_column(tag) else { continue };
        let by_base = adjoint(&filter.tag(tag).inverse()) * std;
        along.fixed_view_mut::<6, 6>(at, 0).copy_from(&by_base);
    }
    along
}
