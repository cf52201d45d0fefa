//! Poses of tags without a survey, from the captured views themselves, before any joint enters.
//!
//! `tagmap` solves cameras and tags together from the fitted views' corner pixels. The known places of some tags (at
//! least the base tag) anchor it, with their standard deviations. The map's tags then replace surveyed ones. Their
//! errors are not independent: a small rotation of the base tag turns the whole map about it (0.2 deg is 7 mm at 2 m).
//! So the joint covariance of all positions, including the anchor, enters the predicted tool error.

use crate::tagmap::constants::tag_mapping::MAX_RELATIVE_STD_M;
use std::collections::BTreeMap;

use nalgebra::{DMatrix, Isometry3, Matrix2, Matrix3};

use crate::file::map_table::{MapResult, MapTag, SurveyCoverage};
use crate::solve::covariance::CommonErrors;
use crate::tagmap::{Body, MapDetection, MapInput, MapMode, MapSettings, MapView, NoiseScale, TagMap, TagPrior, solve};
use crate::views::error::CalibError;
use crate::views::view::{CaptureData, View};
use armcal_core::optics::CameraModel;
use armcal_core::robot::{Robot, SurveyedTag, TagSurvey};
use armcal_core::spatial::{Base, Pose, Tag, skew};

impl Mapped {
    /// Returns the mapped tags as initial guess: unknown tags stay unknown, known ones keep their surveyed places.
    pub(crate) fn start(&self, drawn: &Robot) -> Robot {
        let mut start = drawn.clone();
        for (tag, mapped) in start.tags.iter_mut().zip(&self.robot.tags) {
            if !tag.is_known() {
                tag.base_from_tag = mapped.base_from_tag;
            }
        }
        start
    }
}

/// Maps the tags if some of them are unknown; `None` if the survey knows all of them.
///
/// # Errors
/// [`CalibError::Map`] where the views make no map.
pub(crate) fn map_unknown_tags(
    name: &str,
    data: &mut CaptureData,
    robot: &Robot,
) -> Result<Option<Mapped>, CalibError> {
    if robot.tags.iter().all(SurveyedTag::is_known) {
        return Ok(None);
    }
    let mapped = map_tags(data, robot);
    mapped.map(Some).map_err(|problem| CalibError::Map { recording: name.to_owned(), problem })
}

/// Result of the mapping as input of the estimator.
pub(crate) struct Mapped {
    /// The robot with the map's tags; tags that are left out have no place and are in no view.
    pub robot: Robot,
    pub errors: CommonErrors,
    pub result: MapResult,
}

/// Maps the tags of `data`'s fitted views; removes the detections of tags that the map lacks from all views.
fn map_tags(data: &mut CaptureData, robot: &Robot) -> Result<Mapped, String> {
    let views: Vec<MapView> = data.fit.iter().map(|view| map_view(view, robot)).collect();
    let bodies = [Body { name: robot.base_link.clone(), is_static: true, pose: Some(Isometry3::identity()) }];
    let priors: Vec<TagPrior> = robot.tags.iter().map(prior).collect();
    let cameras: Vec<CameraModel> = robot.cameras().map(|camera| camera.lens).collect();
    let settings = MapSettings {
        mode: MapMode::PartlyKnown,
        corner_std_px: robot.camera.corner_std_px,
        noise: NoiseScale::Estimated,
        ..MapSettings::default()
    };
    let input = MapInput { cameras: &cameras, views: &views, bodies: &bodies, tags: &priors };
    let map = solve(&input, &settings).map_err(|error| error.to_string())?;
    if !map.has_converged {
        return Err("the bundle adjustment did not converge".to_owned());
    }
    let anchor = anchor(&map, robot).ok_or("no tag whose place is known was seen with another in one view")?;
    let mut left_out = BTreeMap::new();
    for tag in &robot.tags {
        if let Some(why) = reason(&map, tag, &anchor) {
            left_out.insert(tag.id, why);
        }
    }
    for view in data.fit.iter_mut().chain(&mut data.held_out).chain(data.identify.values_mut().flatten()) {
        view.tags.retain(|seen| !left_out.contains_key(&seen.id));
    }
    Ok(mapped(&map, robot, &anchor, &left_out, views.iter().filter(|view| !view.tags.is_empty()).count()))
}

fn map_view(view: &View, robot: &Robot) -> MapView {
    let corners = view.tags.iter().filter_map(|tag| Some((tag.id, tag.corners()?)));
    let tags = corners.map(|(id, seen)| {
        let variance_px2 = robot.camera_at(view.camera).corner_std_px.powi(2) / seen.n_frames.max(1) as f64;
        let covariance_px2 = Some([Matrix2::from_diagonal_element(variance_px2); 4]);
        MapDetection { id, corners_px: seen.corners_px, covariance_px2 }
    });
    MapView { camera: view.camera, stamp: view.end, tags: tags.collect(), attitude: None }
}

fn prior(tag: &SurveyedTag) -> TagPrior {
    let (position, rotation) = (tag.position_std_m, tag.rotation_std_rad);
    let std = [position, position, position, rotation, rotation, rotation];
    TagPrior {
        id: tag.id,
        size_m: tag.size_m,
        body: 0,
        pose: tag.is_known().then(|| *tag.base_from_tag.isometry()),
        // The solver needs all of them above zero, or none.
        std: (position > 0.0 && rotation > 0.0).then_some(std),
    }
}

/// The known tag that others are compared with.
struct Anchor {
    id: u32,
    group: usize,
    /// Sigma of its place if the solver held it: all tags share its error. `None` if the map's covariance includes it.
    held_std: Option<[f64; 6]>,
}

/// The base tag, or the first known one in the map.
fn anchor(map: &TagMap, robot: &Robot) -> Option<Anchor> {
    let base = robot.tags.iter().filter(|tag| Some(tag.id) == robot.base_tag);
    let others = robot.tags.iter().filter(|tag| Some(tag.id) != robot.base_tag);
    let mut known = base.chain(others).filter(|tag| tag.is_known());
    known.find_map(|tag| {
        let found = map.tag(tag.id)?;
        let (position, rotation) = (tag.position_std_m, tag.rotation_std_rad);
        let std = [position, position, position, rotation, rotation, rotation];
        Some(Anchor { id: tag.id, group: found.group, held_std: found.is_fixed.then_some(std) })
    })
}

/// Reason why a tag is left out; `None` for one that is in the map.
fn reason(map: &TagMap, tag: &SurveyedTag, anchor: &Anchor) -> Option<String> {
    let Some(found) = map.tag(tag.id) else { return Some("was seen in no view together with another tag".to_owned()) };
    if found.group != anchor.group {
        return Some(format!("no chain of views ties it to tag {}", anchor.id));
    }
    let std_m = relative_std_m(map, tag.id, anchor.id)?;
    (std_m > MAX_RELATIVE_STD_M || std_m.is_nan())
        .then(|| format!("its place is known to {:.0} mm only, from {} views", std_m * 1e3, found.n_views))
}

/// Root mean square over the axes of the standard deviation of a tag's position in the anchor's frame, m.
///
/// `q = R0^T (p - p0)`, so `dq = R0^T R rho - rho0 + [q]x omega0` for perturbations on the right.
fn relative_std_m(map: &TagMap, id: u32, anchor: u32) -> Option<f64> {
    if id == anchor {
        return Some(0.0);
    }
    let joint = map.joint_covariance(&[anchor, id])?;
    let anchor_from_other = map.tag(anchor)?.frame_from_tag.inv_mul(&map.tag(id)?.frame_from_tag);
    let mut jacobian = DMatrix::<f64>::zeros(3, 12);
    let turn = *anchor_from_other.rotation.to_rotation_matrix().matrix();
    jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(&-Matrix3::identity());
    jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(&skew(&anchor_from_other.translation.vector));
    jacobian.fixed_view_mut::<3, 3>(0, 6).copy_from(&turn);
    Some(((&jacobian * joint * jacobian.transpose()).trace() / 3.0).max(0.0).sqrt())
}

fn mapped(map: &TagMap, robot: &Robot, anchor: &Anchor, left_out: &BTreeMap<u32, String>, views: usize) -> Mapped {
    let used: Vec<usize> = (0..robot.tags.len()).filter(|&k| !left_out.contains_key(&robot.tags[k].id)).collect();
    let ids: Vec<u32> = used.iter().map(|&k| robot.tags[k].id).collect();
    let zeros = || DMatrix::zeros(6 * ids.len(), 6 * ids.len());
    let joint = map.joint_covariance(&ids).unwrap_or_else(zeros) + shared_error(map, &ids, anchor);
    let mut survey = robot.survey();
    let mut tags = Vec::new();
    for (n, &k) in used.iter().enumerate() {
        let Some(found) = map.tag(ids[n]) else { continue };
        let pose: Pose<Base, Tag> = Pose::from_isometry(found.frame_from_tag);
        let std = |row: usize| joint[(6 * n + row, 6 * n + row)].max(0.0).sqrt();
        let tag = &mut survey.tags[k];
        tag.base_from_tag = pose;
        // Sigma as in the residuals: joints absorb the error of the whole map.
        tag.position_std_m = relative_std_m(map, ids[n], anchor.id).unwrap_or(0.0);
        tag.rotation_std_rad = ([3, 4, 5].map(|row| std(row).powi(2)).iter().sum::<f64>() / 3.0).sqrt();
        tags.push(MapTag {
            id: ids[n],
            size_m: tag.size_m,
            position_m: pose.origin().to_array(),
            quaternion_wxyz: pose.quaternion_wxyz(),
            position_std_m: position_std_m(&joint, n, &pose),
            rotation_std_rad: [3, 4, 5].map(std),
            n_views: found.n_views,
        });
    }
    let errors = CommonErrors {
        tags_m2: positions_m2(&survey, &used, &joint),
        ..CommonErrors::priors(&Robot { tags: Vec::new(), ..robot.clone() })
    };
    let n_known = robot.tags.iter().filter(|tag| tag.is_known()).count();
    let result = MapResult {
        frame: robot.base_link.clone(),
        base_tag: robot.base_tag.unwrap_or(anchor.id),
        known: if n_known > 1 { SurveyCoverage::Partly } else { SurveyCoverage::BaseTagAlone },
        views,
        rms_px: map.rms_px,
        rejected: map.rejected.len(),
        left_out: left_out.iter().map(|(id, why)| format!("tag {id}: {why}")).collect(),
        tag: tags,
    };
    Mapped { robot: robot.clone().with_survey(survey), errors, result }
}

/// Standard deviation of the position of the tag in row `n` of the joint covariance, along the base frame's axes, m.
fn position_std_m(joint: &DMatrix<f64>, n: usize, pose: &Pose<Base, Tag>) -> [f64; 3] {
    let turn = *pose.rotation().to_rotation_matrix().matrix();
    let covariance = turn * joint.fixed_view::<3, 3>(6 * n, 6 * n) * turn.transpose();
    [0, 1, 2].map(|k| covariance[(k, k)].max(0.0).sqrt())
}

/// Contribution of a held anchor to the joint covariance of `ids`: its error moves the whole map.
///
/// With `T = A X` and `A exp(xi0)`, the tag moves by `X^-1 xi0 X`: `omega = R^T omega0`,
/// `rho = R^T (rho0 - [t]x omega0)`.
fn shared_error(map: &TagMap, ids: &[u32], anchor: &Anchor) -> DMatrix<f64> {
    let n = 6 * ids.len();
    let Some((std, held)) = anchor.held_std.zip(map.tag(anchor.id)) else { return DMatrix::zeros(n, n) };
    let mut jacobian = DMatrix::<f64>::zeros(n, 6);
    for (row, tag) in ids.iter().enumerate().filter_map(|(row, id)| Some((row, map.tag(*id)?))) {
        let from_anchor = held.frame_from_tag.inv_mul(&tag.frame_from_tag);
        let back = from_anchor.rotation.to_rotation_matrix().matrix().transpose();
        jacobian.fixed_view_mut::<3, 3>(6 * row, 0).copy_from(&back);
        jacobian.fixed_view_mut::<3, 3>(6 * row, 3).copy_from(&(-back * skew(&from_anchor.translation.vector)));
        jacobian.fixed_view_mut::<3, 3>(6 * row + 3, 3).copy_from(&back);
    }
    let variances = DMatrix::from_diagonal(&nalgebra::DVector::from_iterator(6, std.iter().map(|std| std * std)));
    &jacobian * variances * jacobian.transpose()
}

/// Covariance of all tags' positions in the base frame, three rows per tag; zero for tags that are left out.
fn positions_m2(survey: &TagSurvey, used: &[usize], joint: &DMatrix<f64>) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(3 * survey.tags.len(), 3 * survey.tags.len());
    let turn = |k: usize| *survey.tags[k].base_from_tag.rotation().to_rotation_matrix().matrix();
    for (row, &i) in used.iter().enumerate() {
        for (column, &j) in used.iter().enumerate() {
            let block = turn(i) * joint.fixed_view::<3, 3>(6 * row, 6 * column) * turn(j).transpose();
            out.fixed_view_mut::<3, 3>(3 * i, 3 * j).copy_from(&block);
        }
    }
    out
}
