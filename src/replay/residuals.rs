//! Names of the tags, and the residuals of each tag after a calibration: a frame about it, green if it fits, else with
//! a figure.

use std::collections::BTreeMap;

use crate::rerun::{Boxes3D, FillMode, Points3D};

use crate::colors::{self, Rgba};
use crate::entities::BASE;
use crate::entity_log::EntityLog;
use crate::poses::{quaternion, vector};
use crate::scene::ReplayScene;
use crate::scenery::LANDMARK_M;
use armcal_belief::calib::{ObservedTag, ViewResidual};
use armcal_belief::tagmap::files::{FIRST_NAMED_ID, spoken_name};
use armcal_core::robot::SurveyedTag;
use armcal_core::time::Stamp;

/// Multiples of the median tag's residual. A tag fits if its residual is at most the first multiple or the first of
/// `FINE_PX`, the larger of the two. It does not fit if it exceeds the larger of the second values.
const TIMES_MEDIAN: [f64; 2] = [1.5, 3.0];
/// Root mean squares of corner residuals that are acceptable in any case, px; tags without corners have no such limit.
const FINE_PX: [f64; 2] = [0.5, 1.0];
const NAME_COLOR: Rgba = [225, 225, 225, 255];
/// Side of a frame over the side of its tag: about the plate.
const FRAME_SIDE: f64 = 1.5;

/// Residual of one tag.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Left {
    /// Root mean square of its corner residuals, px.
    Corners(f64),
    /// Root mean square of its position residuals, m: the recording has no corners of it.
    Place(f64),
    /// No residual, because the fit rejected all observations of the tag.
    Rejected,
}

/// Draws the names and, from each calibration on, the residuals.
pub(super) fn draw(run: &ReplayScene, residuals: &[(Stamp, &[ViewResidual])], stream: &mut EntityLog) {
    let tags = &run.robot.tags;
    if tags.is_empty() {
        return;
    }
    let names = |left: &BTreeMap<u32, (Left, Rgba)>| {
        let label = |tag: &SurveyedTag| match left.get(&tag.id) {
            // Only the name of a tag that fits: many figures hide the scene.
            None | Some((_, colors::HIT)) => name(run, tag),
            Some((left, _)) => format!("{}: {}", name(run, tag), left.in_words()),
        };
        let color = |tag: &SurveyedTag| left.get(&tag.id).map_or(NAME_COLOR, |(_, color)| *color);
        let anchors = tags.iter().map(|tag| vector(&tag.base_from_tag.origin().vector()));
        let anchors = Points3D::new(anchors).with_radii([0.004]).with_labels(tags.iter().map(label));
        anchors.with_show_labels(true).with_colors(tags.iter().map(color))
    };
    let entity = format!("{BASE}/tags/ids");
    let nothing = BTreeMap::new();
    if residuals.is_empty() {
        stream.log_static(&entity, &names(&nothing));
        return;
    }
    stream.draw(&entity, 0.0, &names(&nothing));
    for (since, views) in residuals {
        let (time_s, left) = (run.tracks.place_s(*since, *since), judged(&left_of(views)));
        stream.draw(&entity, time_s, &names(&left));
        stream.draw(&format!("{BASE}/tags/residuals"), time_s, &frames(run, &left));
    }
}

fn name(run: &ReplayScene, tag: &SurveyedTag) -> String {
    match tag.id {
        id if Some(id) == run.robot.base_tag && id < FIRST_NAMED_ID => format!("base tag {id}"),
        id => spoken_name(id, run.robot.tags.iter().map(|tag| tag.id)),
    }
}

impl Left {
    fn in_words(self) -> String {
        match self {
            Self::Corners(px) => format!("{px:.2} px"),
            Self::Place(m) => format!("{:.1} mm", 1e3 * m),
            Self::Rejected => "rejected".to_owned(),
        }
    }
}

/// Returns the residual of each tag over all views.
fn left_of(views: &[ViewResidual]) -> BTreeMap<u32, Left> {
    let mut seen: BTreeMap<u32, Vec<&ObservedTag>> = BTreeMap::new();
    for tag in views.iter().flat_map(|view| &view.tags) {
        seen.entry(tag.id).or_default().push(tag);
    }
    let left = |tags: &[&ObservedTag]| {
        let used: Vec<&&ObservedTag> = tags.iter().filter(|tag| tag.is_used).collect();
        let corners = used.iter().flat_map(|tag| tag.corners.iter().flatten()).filter(|corner| corner.is_used);
        let corners_px2: Vec<f64> = corners.map(|c| c.off_px.iter().map(|px| px * px).sum()).collect();
        match (used.len(), corners_px2.len()) {
            (0, _) => Left::Rejected,
            (n, 0) => Left::Place((used.iter().map(|tag| tag.off_m.powi(2)).sum::<f64>() / n as f64).sqrt()),
            (_, n) => Left::Corners((corners_px2.iter().sum::<f64>() / n as f64).sqrt()),
        }
    };
    seen.into_iter().map(|(id, tags)| (id, left(&tags))).collect()
}

/// Adds a colour to each residual: green, amber or red.
fn judged(left: &BTreeMap<u32, Left>) -> BTreeMap<u32, (Left, Rgba)> {
    let median = |of: fn(&Left) -> Option<f64>| {
        let mut all: Vec<f64> = left.values().filter_map(of).collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len().saturating_sub(1) / 2).copied().unwrap_or(0.0)
    };
    let median_px = median(|left| if let Left::Corners(px) = left { Some(*px) } else { None });
    let median_m = median(|left| if let Left::Place(m) = left { Some(*m) } else { None });
    let color = |left: &Left| {
        let (value, limits) = match left {
            Left::Corners(px) => (*px, [0, 1].map(|at| FINE_PX[at].max(TIMES_MEDIAN[at] * median_px))),
            Left::Place(m) => (*m, TIMES_MEDIAN.map(|times| times * median_m)),
            Left::Rejected => (f64::INFINITY, [0.0; 2]),
        };
        match limits {
            [fits, _] if value <= fits => colors::HIT,
            [_, near] if value <= near => colors::TARGET,
            _ => colors::MISS,
        }
    };
    left.iter().map(|(id, left)| (*id, (*left, color(left)))).collect()
}

fn frames(run: &ReplayScene, left: &BTreeMap<u32, (Left, Rgba)>) -> Boxes3D {
    let (mut centers, mut sizes, mut turns, mut shades) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for tag in &run.robot.tags {
        let Some((_, color)) = left.get(&tag.id) else { continue };
        let half_m = (0.5 * FRAME_SIDE * if tag.size_m.is_nan() { LANDMARK_M } else { tag.size_m }) as f32;
        centers.push(vector(&tag.base_from_tag.origin().vector()));
        turns.push(quaternion(&tag.base_from_tag.rotation()));
        sizes.push([half_m, half_m, 0.004]);
        shades.push(*color);
    }
    let frames = Boxes3D::from_centers_and_half_sizes(centers, sizes).with_quaternions(turns).with_colors(shades);
    frames.with_fill_mode(FillMode::MajorWireframe).with_radii([0.006])
}
