//! A file that the images contradict: how the tags stand to one another is seen without the arm.
//!
//! Of two tags a and b in one view, a's pose in the camera `C_a` and the map's `a_from_b` say where b is. Its distance
//! from where it is seen, over the distance between both, is the mismatch; the median over all pairs counts. One scale
//! of all tags is taken out beforehand, by the median ratio of the map's distances to the seen ones. A large mismatch
//! means that map or lens is wrong, and no joint has a part in it. The input that makes it small is named. Where only
//! some tags do not fit the others, they may hang in one another's places: their ids are exchanged.
//!
//! Where a view has one landmark with its rotation, the arm by its datasheet tells where that stands: the rotations of
//! `base_from_tag` over the views must agree but for what sensors may be off.

use std::borrow::Cow;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
use std::fmt;

use nalgebra::{Isometry3, Point3, Quaternion, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::calib::views::view::{CaptureData, TagMeasurement, TagObservation, View};
use armcal_core::codes::{Code, Coded};
use armcal_core::joints::JointAngles;
use armcal_core::optics::{CameraModel, Fisheye, LensModel, Radtan, TagFamily, solve_square_both};
use armcal_core::robot::{Robot, SurveyedTag};
use armcal_core::spatial::Pose;
use armcal_core::stats::quantile;

/// An input that is not what it is said to be, and how well the views fit with it and without.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WrongInput {
    /// Which, and how it should be read.
    pub input: WrongInputKind,
    /// As it is written: of two tags, where the one is not seen over its distance from the other.
    pub mismatch: f64,
    /// The same with the input put right; absent where nothing puts it right.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mismatch_otherwise: Option<f64>,
    /// What of the tags was measured in place of their size, in words, where their print tells it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size_hint: Option<String>,
}

/// What may be wrong.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WrongInputKind {
    /// The map's quaternions are x, y, z, w.
    MapQuaternions,
    /// The recorded rotations are quaternions in the other order.
    RecordedQuaternions,
    /// The recorded poses are those of the camera in the landmark's frame, or the other way round.
    RecordedDirection,
    /// The lens is that of an image of another size: columns and rows by robot.toml, and the largest ones of a corner.
    ImageSize {
        /// By robot.toml.
        stated_px: [u32; 2],
        /// At least.
        seen_px: [f64; 2],
    },
    /// Corners have negative columns or rows; the smallest ones.
    NegativePixels([f64; 2]),
    /// Corners are shares of the image, not pixels.
    ImageShares,
    /// The lens is that of an image of so many times the recorded one's size.
    ImageScale(f64),
    /// The lens has so many times its stated focal length.
    FocalLength(f64),
    /// The lens is of the other model: a fisheye called a pinhole, or the other way round.
    LensModel,
    /// The corners come from images without the distortion that robot.toml states.
    Distortion,
    /// All tags are of so many times their stated size.
    TagSize(f64),
    /// The map's positions are in this unit, and not in metres.
    MapUnit(String),
    /// The map's axes are others, in words: `(y, x, z)`, `(x, -y, z)`.
    MapAxes(String),
    /// All tags of the map are turned alike: the rotation, w, x, y, z, that follows each `quaternion_wxyz`.
    TagFrames([f64; 4]),
    /// These tags hang in one another's places.
    ExchangedIds(Vec<u32>),
    /// The tags do not stand to one another as the map says, whatever is tried.
    OtherMap,
}

/// Mismatches below this are those of good maps and lenses: the tilt of a small tag is not seen better.
const GOOD: f64 = 0.12;
/// Above this a map is of other tags.
const BAD: f64 = 0.3;
/// What puts an input right makes the mismatch this much smaller.
const BETTER: f64 = 0.4;
const MIN_PAIRS: usize = 6;
/// More views tell no more.
const MAX_VIEWS: usize = 40;
/// Image sizes that are tried, over robot.toml's.
const IMAGE_SCALES: [f64; 4] = [0.5, 2.0, 0.25, 4.0];
/// A corner may lie so far outside of the stated image: detectors round.
const BEYOND_IMAGE: f64 = 1.03;
/// A size within this of the stated one is not called wrong.
const SIZE_TOLERANCE: f64 = 0.03;
/// Units that a survey may be in, and how many make a metre.
const UNITS: [(&str, f64); 4] = [("mm", 1e3), ("cm", 1e2), ("inches", 1.0 / 0.0254), ("feet", 1.0 / 0.3048)];
/// Focal lengths that are tried, over robot.toml's: so many steps of a logarithm up and down, to 0.5 and 2.
const FOCAL_STEP: f64 = 0.02;
const FOCAL_STEPS: i32 = 35;
/// Rotations of one landmark: spread that says nothing, and that of good ones, rad.
const SPREAD_RAD: f64 = 0.5;
const GOOD_SPREAD_RAD: f64 = 0.25;
/// Half of the field of view of a fisheye that nobody describes, rad.
const FISHEYE_RAD: f64 = 1.5;
const MIN_ROTATIONS: usize = 5;

/// A size that stands beside its print: of tag36h11 the border square has 8 of the 10 cells that the whole print has.
/// `None` where `ratio`, of the true size over the stated one, says neither.
#[must_use]
pub(crate) fn margin_hint(family: TagFamily, ratio: f64) -> Option<String> {
    let (border, whole) = (family.n_cells(), family.n_cells() + 2 * family.n_margin_cells());
    let is = |of: usize, over: usize| (ratio / (of as f64 / over as f64) - 1.0).abs() < 0.02;
    let [print, beyond, square] = match family {
        TagFamily::Tag16h5 | TagFamily::Tag25h9 | TagFamily::Tag36h11 => {
            ["the whole print with its white margin", "the margin", "black square"]
        }
        _ => ["the whole print", "what lies beyond the border", "border square"],
    };
    if is(border, whole) {
        Some(format!("{border}/{whole}: the stated size is that of {print}; state the {square}'s"))
    } else if is(whole, border) {
        let was = format!("{beyond} was taken off a size that had none");
        Some(format!("{whole}/{border}: {was}; state the {square}'s side as measured"))
    } else {
        None
    }
}

/// The input that explains why the views do not fit; `tags` as the map has them.
pub(crate) fn wrong_input(data: &CaptureData, tags: &[SurveyedTag], robot: &Robot) -> Option<WrongInput> {
    let of_first = data.fit.iter().chain(&data.held_out).filter(|view| view.camera == 0);
    let views: Vec<&View> = of_first.take(MAX_VIEWS).collect();
    let lens = &robot.camera.lens;
    let stated_px = lens.resolution_px();
    if let Some(input) = beside_image(stated_px, data) {
        return Some(WrongInput { input, mismatch: 1.0, mismatch_otherwise: None, size_hint: None });
    }
    match mismatch(&views, tags, lens) {
        Some(pairs) => by_pairs(&views, tags, robot, &pairs),
        None => by_rotations(&views, robot),
    }
}

/// Corners that are no pixels of an image of that size.
fn beside_image(stated_px: [u32; 2], data: &CaptureData) -> Option<WrongInputKind> {
    let (smallest_px, largest_px) = (data.smallest_px, data.largest_px);
    let sides_px = stated_px.map(f64::from);
    let is_any = |is_so: &dyn Fn(usize) -> bool| stated_px[0] > 0 && (is_so(0) || is_so(1));
    if is_any(&|axis| largest_px[axis] > BEYOND_IMAGE * sides_px[axis]) {
        Some(WrongInputKind::ImageSize { stated_px, seen_px: largest_px })
    } else if is_any(&|axis| smallest_px[axis] < (1.0 - BEYOND_IMAGE) * sides_px[axis]) {
        Some(WrongInputKind::NegativePixels(smallest_px))
    } else {
        let are_shares = largest_px.iter().all(|px| *px > 0.0 && *px <= BEYOND_IMAGE);
        are_shares.then_some(WrongInputKind::ImageShares)
    }
}

fn by_pairs(views: &[&View], tags: &[SurveyedTag], robot: &Robot, as_written: &Pairs) -> Option<WrongInput> {
    let lens = &robot.camera.lens;
    let mut found: Option<(WrongInputKind, f64)> = None;
    let mut consider = |input, pairs: Option<Pairs>| {
        let Some(Pairs { mismatch, .. }) = pairs else { return };
        let is_least = found.as_ref().is_none_or(|(_, least)| mismatch < *least);
        if mismatch < GOOD.min(BETTER * as_written.mismatch) && is_least {
            found = Some((input, mismatch));
        }
    };
    let turned: Vec<SurveyedTag> = tags.iter().map(in_other_order).collect();
    consider(WrongInputKind::MapQuaternions, mismatch(views, &turned, lens));
    for scale in IMAGE_SCALES {
        consider(WrongInputKind::ImageScale(scale), mismatch(views, tags, &scaled(lens, 1.0 / scale)));
    }
    consider(WrongInputKind::LensModel, mismatch(views, tags, &of_other_model(lens)));
    consider(WrongInputKind::Distortion, mismatch(views, tags, &without_distortion(lens)));
    for (words, axes) in other_axes() {
        let placed: Vec<SurveyedTag> = tags.iter().map(|tag| with_axes(tag, axes)).collect();
        consider(WrongInputKind::MapAxes(words), mismatch(views, &placed, lens));
    }
    let steps = (-FOCAL_STEPS..=FOCAL_STEPS).map(|k| (f64::from(k) * FOCAL_STEP).exp());
    for ratio in steps.filter(|ratio| (ratio - 1.0).abs() > SIZE_TOLERANCE) {
        consider(WrongInputKind::FocalLength(ratio), mismatch(views, tags, &of_focal_length(lens, ratio)));
    }
    for turn in quarter_turns() {
        let turned: Vec<SurveyedTag> = tags.iter().map(|tag| turned_by(tag, &turn)).collect();
        let [x, y, z] = [turn.i, turn.j, turn.k];
        consider(WrongInputKind::TagFrames([turn.w, x, y, z]), mismatch(views, &turned, lens));
    }
    let wrong = |(input, otherwise): (WrongInputKind, Option<f64>)| WrongInput {
        input,
        mismatch: as_written.mismatch,
        mismatch_otherwise: otherwise,
        size_hint: None,
    };
    if let Some((input, otherwise)) = found {
        return Some(wrong((input, Some(otherwise))));
    }
    if let Some((ids, before, after)) = exchanged_ids(views, tags, lens) {
        let input = WrongInputKind::ExchangedIds(ids);
        return Some(WrongInput { input, mismatch: before, mismatch_otherwise: Some(after), size_hint: None });
    }
    if as_written.mismatch > BAD {
        return Some(wrong((WrongInputKind::OtherMap, None)));
    }
    if let Some((name, _)) = UNITS.iter().find(|(_, per_m)| (as_written.ratio / per_m - 1.0).abs() < SIZE_TOLERANCE)
        && as_written.mismatch < GOOD
    {
        return Some(wrong((WrongInputKind::MapUnit((*name).to_owned()), None)));
    }
    let is_of_size = (as_written.ratio - 1.0).abs() > SIZE_TOLERANCE && as_written.mismatch < GOOD;
    is_of_size.then(|| WrongInput {
        size_hint: margin_hint(robot.tag_family, as_written.ratio),
        ..wrong((WrongInputKind::TagSize(as_written.ratio), None))
    })
}

/// The lens of an image of `scale` times the size.
fn scaled(lens: &CameraModel, scale: f64) -> CameraModel {
    let [fx, fy, cx, cy, k @ ..] = lens.intrinsics();
    let [a, b, c, d] = k;
    lens.with_intrinsics([fx * scale, fy * scale, cx * scale, cy * scale, a, b, c, d])
}

/// The lens with `ratio` times its focal length.
fn of_focal_length(lens: &CameraModel, ratio: f64) -> CameraModel {
    let [fx, fy, rest @ ..] = lens.intrinsics();
    let [cx, cy, a, b, c, d] = rest;
    lens.with_intrinsics([fx * ratio, fy * ratio, cx, cy, a, b, c, d])
}

/// The lens with its stated focal length and centre alone.
fn without_distortion(lens: &CameraModel) -> CameraModel {
    let [fx, fy, cx, cy, ..] = lens.intrinsics();
    lens.with_intrinsics([fx, fy, cx, cy, 0.0, 0.0, 0.0, 0.0])
}

/// An axis each, and its sign.
type SignedAxes = [(usize, f64); 3];

/// Left-handed readings of a position, in words: one axis of the other sign, or two axes exchanged. What is
/// right-handed turns the map as a whole, and the arm has a part in it.
fn other_axes() -> impl Iterator<Item = (String, SignedAxes)> {
    const READINGS: [SignedAxes; 6] = [
        [(0, -1.0), (1, 1.0), (2, 1.0)],
        [(0, 1.0), (1, -1.0), (2, 1.0)],
        [(0, 1.0), (1, 1.0), (2, -1.0)],
        [(1, 1.0), (0, 1.0), (2, 1.0)],
        [(0, 1.0), (2, 1.0), (1, 1.0)],
        [(2, 1.0), (1, 1.0), (0, 1.0)],
    ];
    let word = |(axis, sign): (usize, f64)| format!("{}{}", if sign < 0.0 { "-" } else { "" }, ["x", "y", "z"][axis]);
    READINGS.into_iter().map(move |axes| (format!("({})", axes.map(word).join(", ")), axes))
}

/// The tag at its position read by these axes; its rotation stays.
fn with_axes(tag: &SurveyedTag, axes: SignedAxes) -> SurveyedTag {
    let pose = tag.base_from_tag.isometry();
    let place = Vector3::from(axes.map(|(axis, sign)| sign * pose.translation.vector[axis]));
    let placed = Isometry3::from_parts(place.into(), pose.rotation);
    SurveyedTag { base_from_tag: Pose::from_isometry(placed), ..tag.clone() }
}

/// In what medium a lens shows a focal length of `ratio` times the stated one: sea water has the refractive index 1.34,
/// by which a flat window in front of the lens multiplies the focal length (Treibitz et al. 2012).
pub(crate) fn medium_of_lens(ratio: f64) -> &'static str {
    const WATER: f64 = 1.34;
    const NEAR: f64 = 0.04;
    match ratio {
        r if (r / WATER - 1.0).abs() < NEAR => ". A lens of air shows this factor in water",
        r if (r * WATER - 1.0).abs() < NEAR => ". A lens of water shows this factor in air",
        _ => "",
    }
}

/// A lens of the same focal length and centre, without distortion: a fisheye for a pinhole, and the other way round.
fn of_other_model(lens: &CameraModel) -> CameraModel {
    let (focal_px, center_px, resolution_px) = (lens.focal_px(), lens.center_px(), lens.resolution_px());
    let other: CameraModel = match lens.lens {
        LensModel::Radtan(_) => {
            Fisheye { focal_px, center_px, distortion: [0.0; 4], resolution_px, max_view_angle_rad: FISHEYE_RAD }.into()
        }
        _ => Radtan::new(focal_px, center_px, [0.0; 5], resolution_px).into(),
    };
    CameraModel { port: lens.port, ..other }
}

/// The 23 rotations that take a cube to itself and are not the identity, w at least 0: the conventions of tag frames
/// differ by one of them, whichever corner is the first and wherever z points.
pub(crate) fn quarter_turns() -> impl Iterator<Item = UnitQuaternion<f64>> {
    let about = |axis: Vector3<f64>, n: u8| UnitQuaternion::from_scaled_axis(axis * (f64::from(n) * FRAC_PI_2));
    let faces = (0..4).map(move |n| about(Vector3::x(), n)).chain([1, 3].map(|n| about(Vector3::y(), n)));
    let all = faces.flat_map(move |face| (0..4).map(move |n| face * about(Vector3::z(), n)));
    all.filter(|turn| turn.angle() > FRAC_PI_4)
        .map(|turn| if turn.w < 0.0 { UnitQuaternion::new_unchecked(-turn.into_inner()) } else { turn })
}

fn turned_by(tag: &SurveyedTag, turn: &UnitQuaternion<f64>) -> SurveyedTag {
    SurveyedTag { base_from_tag: Pose::from_isometry(tag.base_from_tag.isometry() * turn), ..tag.clone() }
}

/// A tag whose quaternion was written x, y, z, w.
fn in_other_order(tag: &SurveyedTag) -> SurveyedTag {
    let pose = tag.base_from_tag.isometry();
    let turned = Isometry3::from_parts(pose.translation, reordered(&pose.rotation));
    SurveyedTag { base_from_tag: Pose::from_isometry(turned), ..tag.clone() }
}

/// `[w, x, y, z]` as read, of what was `[x, y, z, w]`.
fn reordered(read: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    let [x, y, z, w] = [read.w, read.i, read.j, read.k];
    UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))
}

/// The same the other way: `[x, y, z, w]` as read, of what was `[w, x, y, z]`.
fn reordered_back(read: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    let [w, x, y, z] = [read.i, read.j, read.k, read.w];
    UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))
}

/// Of all pairs of tags in one view: the map's distances over those seen, and the mismatch with that scale.
struct Pairs {
    ratio: f64,
    mismatch: f64,
}

/// A tag as one view has it.
struct PosedTag<'a> {
    surveyed: &'a SurveyedTag,
    /// In the camera; two where a square has two.
    poses: Vec<Isometry3<f64>>,
}

fn mismatch(views: &[&View], tags: &[SurveyedTag], lens: &CameraModel) -> Option<Pairs> {
    let posed: Vec<Vec<PosedTag<'_>>> = views.iter().map(|view| posed_tags(view, tags, lens)).collect();
    let pairs: Vec<(&PosedTag<'_>, &PosedTag<'_>)> = posed.iter().flat_map(|of_view| ordered_pairs(of_view)).collect();
    if pairs.len() < MIN_PAIRS {
        return None;
    }
    let of_pair = |(a, b): &(&PosedTag<'_>, &PosedTag<'_>)| {
        let by_map = a.surveyed.base_from_tag.isometry().inv_mul(b.surveyed.base_from_tag.isometry());
        by_map.translation.vector.norm() / (a.center() - b.center()).norm().max(1e-9)
    };
    let ratio = quantile(&pairs.iter().map(of_pair).collect::<Vec<f64>>(), 0.5)?;
    let mismatches: Vec<f64> = pairs.iter().map(|(a, b)| a.mismatch_of(b, ratio)).collect();
    Some(Pairs { ratio, mismatch: quantile(&mismatches, 0.5)? })
}

fn ordered_pairs<'a, 'b>(tags: &'b [PosedTag<'a>]) -> impl Iterator<Item = (&'b PosedTag<'a>, &'b PosedTag<'a>)> {
    let each = move |(n, a)| tags.iter().enumerate().filter(move |(m, _)| *m != n).map(move |(_, b)| (a, b));
    tags.iter().enumerate().flat_map(each)
}

fn posed_tags<'a>(view: &View, tags: &'a [SurveyedTag], lens: &CameraModel) -> Vec<PosedTag<'a>> {
    let posed = |seen: &TagObservation| {
        let surveyed = tags.get(seen.tag_idx).filter(|tag| tag.is_known())?;
        let poses = match &seen.measured {
            TagMeasurement::Corners(corners) => {
                let (best, other) = solve_square_both(lens, surveyed.size_m, &corners.corners_px).ok()?;
                [Some(best), other].into_iter().flatten().map(|pose| *pose.camera_from_tag.isometry()).collect()
            }
            TagMeasurement::Pose(pose) => vec![*pose],
            TagMeasurement::Board(seen) => vec![seen.camera_from_board],
            TagMeasurement::Position => return None,
        };
        Some(PosedTag { surveyed, poses })
    };
    view.tags.iter().filter_map(posed).collect()
}

impl PosedTag<'_> {
    fn center(&self) -> Vector3<f64> {
        self.poses[0].translation.vector
    }

    /// Where this tag and the map have `other`, against where it is seen.
    fn mismatch_of(&self, other: &Self, ratio: f64) -> f64 {
        let (from, to) = (self.surveyed.base_from_tag.isometry(), other.surveyed.base_from_tag.isometry());
        let place = Point3::from(from.inv_mul(to).translation.vector / ratio);
        let off = |pose: &Isometry3<f64>| ((pose * place).coords - other.center()).norm();
        let least = self.poses.iter().map(off).fold(f64::INFINITY, f64::min);
        least / (self.center() - other.center()).norm().max(1e-9)
    }
}

/// Tags that hang in one another's places, as the others have them: their ids, and their mismatch as written and so
/// taken. The tag that fits the others least is set aside, until those that are left fit one another.
fn exchanged_ids(views: &[&View], tags: &[SurveyedTag], lens: &CameraModel) -> Option<(Vec<u32>, f64, f64)> {
    let posed: Vec<Vec<PosedTag<'_>>> = views.iter().map(|view| posed_tags(view, tags, lens)).collect();
    let (mut sound, mut doubtful) = (tags.iter().filter(|tag| tag.is_known()).collect::<Vec<_>>(), Vec::new());
    loop {
        let mismatch = |tag: &SurveyedTag| mismatch_at(&posed, tag.id, tag, &sound).unwrap_or(0.0);
        let mismatches = sound.iter().map(|tag| mismatch(tag)).enumerate();
        let (worst, most) = mismatches.max_by(|a, b| a.1.total_cmp(&b.1))?;
        if most < GOOD {
            break;
        }
        doubtful.push(sound.remove(worst));
        if sound.len() < doubtful.len() {
            return None;
        }
    }
    let (mut before, mut after) = (Vec::new(), Vec::new());
    for tag in &doubtful {
        let places = doubtful.iter().filter(|place| place.id != tag.id);
        let nearest = places.filter_map(|place| mismatch_at(&posed, tag.id, place, &sound)).reduce(f64::min)?;
        if nearest > GOOD {
            return None;
        }
        before.push(mismatch_at(&posed, tag.id, tag, &sound)?);
        after.push(nearest);
    }
    let mut ids: Vec<u32> = doubtful.iter().map(|tag| tag.id).collect();
    ids.sort_unstable();
    (ids.len() > 1).then_some((ids, quantile(&before, 0.5)?, quantile(&after, 0.5)?))
}

/// Where the tag `id` is seen against where the tags `others` have it, if it hangs at `place`; median.
fn mismatch_at(posed: &[Vec<PosedTag<'_>>], id: u32, place: &SurveyedTag, others: &[&SurveyedTag]) -> Option<f64> {
    let is_other = |of: u32| of != id && others.iter().any(|other| other.id == of);
    let pairs = posed.iter().flat_map(|of_view| ordered_pairs(of_view));
    let of_tag = pairs.filter(|(a, b)| b.surveyed.id == id && is_other(a.surveyed.id));
    let mismatch = |(a, b): (&PosedTag<'_>, &PosedTag<'_>)| {
        a.mismatch_of(&PosedTag { surveyed: place, poses: b.poses.clone() }, 1.0)
    };
    quantile(&of_tag.map(mismatch).collect::<Vec<f64>>(), 0.5)
}

/// How a recorded pose may be meant.
type Reading<'a> = &'a dyn Fn(&Isometry3<f64>) -> Isometry3<f64>;

/// Of recorded poses of one landmark a view.
fn by_rotations(views: &[&View], robot: &Robot) -> Option<WrongInput> {
    let base_from_camera = |view: &View| {
        let angle_rad = |joint: usize| robot.sensors[joint].center_rad + view.travel_rad[joint];
        robot.tags_from_camera(&JointAngles::from_fn(view.travel_rad.len(), angle_rad))
    };
    let posed: Vec<(usize, Isometry3<f64>, Isometry3<f64>)> = views
        .iter()
        .flat_map(|view| {
            let camera = base_from_camera(view);
            view.tags.iter().filter_map(move |seen| match &seen.measured {
                TagMeasurement::Pose(pose) => Some((seen.tag_idx, camera, *pose)),
                _ => None,
            })
        })
        .collect();
    let spread = |read: &dyn Fn(&Isometry3<f64>) -> Isometry3<f64>| {
        let turned = |&(tag, camera, pose): &(usize, Isometry3<f64>, Isometry3<f64>)| (tag, camera * read(&pose));
        spread_rad(&posed.iter().map(turned).collect::<Vec<_>>())
    };
    let as_written = spread(&|pose| *pose)?;
    let with = |pose: &Isometry3<f64>, turn: fn(&UnitQuaternion<f64>) -> UnitQuaternion<f64>| {
        Isometry3::from_parts(pose.translation, turn(&pose.rotation))
    };
    let readings: [(WrongInputKind, Reading<'_>); 5] = [
        (WrongInputKind::RecordedQuaternions, &|pose| with(pose, reordered)),
        (WrongInputKind::RecordedQuaternions, &|pose| with(pose, reordered_back)),
        (WrongInputKind::RecordedQuaternions, &|pose| with(&pose.inverse(), reordered).inverse()),
        (WrongInputKind::RecordedQuaternions, &|pose| with(&pose.inverse(), reordered_back).inverse()),
        (WrongInputKind::RecordedDirection, &|pose: &Isometry3<f64>| pose.inverse()),
    ];
    let spreads = readings.into_iter().filter_map(|(input, read)| Some((input, spread(read)?)));
    let (input, least) = spreads.min_by(|a, b| a.1.total_cmp(&b.1))?;
    let is_better = as_written > SPREAD_RAD && least < GOOD_SPREAD_RAD.min(BETTER * as_written);
    is_better.then_some(WrongInput { input, mismatch: as_written, mismatch_otherwise: Some(least), size_hint: None })
}

/// Median angle of a landmark's rotations from the one that is nearest to all others; the largest of all landmarks.
fn spread_rad(poses: &[(usize, Isometry3<f64>)]) -> Option<f64> {
    let mut tags: Vec<usize> = poses.iter().map(|(tag, _)| *tag).collect();
    tags.sort_unstable();
    tags.dedup();
    let of_tag = |tag: usize| {
        let turns: Vec<_> = poses.iter().filter(|(of, _)| *of == tag).map(|(_, pose)| pose.rotation).collect();
        let median = |from: &UnitQuaternion<f64>| {
            quantile(&turns.iter().map(|turn| from.angle_to(turn)).collect::<Vec<f64>>(), 0.5)
        };
        let spreads = turns.iter().filter_map(median);
        (turns.len() >= MIN_ROTATIONS).then(|| spreads.fold(f64::INFINITY, f64::min))
    };
    tags.into_iter().filter_map(of_tag).reduce(f64::max)
}

impl Coded for WrongInput {
    fn code(&self) -> Code {
        match &self.input {
            WrongInputKind::MapQuaternions => Code::InputOrder,
            WrongInputKind::RecordedQuaternions => Code::InputRotation,
            WrongInputKind::RecordedDirection => Code::InputDirection,
            WrongInputKind::ImageSize { .. }
            | WrongInputKind::ImageScale(_)
            | WrongInputKind::NegativePixels(_)
            | WrongInputKind::ImageShares => Code::InputImageSize,
            WrongInputKind::LensModel | WrongInputKind::Distortion => Code::InputLensModel,
            WrongInputKind::FocalLength(_) => Code::LensContradicted,
            WrongInputKind::TagSize(_) => Code::InputTagSize,
            WrongInputKind::ExchangedIds(_) => Code::InputTagIds,
            WrongInputKind::MapUnit(_) => Code::InputMapUnit,
            WrongInputKind::MapAxes(_) => Code::InputMapAxes,
            WrongInputKind::TagFrames(_) => Code::InputTagFrames,
            WrongInputKind::OtherMap => Code::InputTagMap,
        }
    }
}

impl WrongInput {
    /// What to do about it.
    #[must_use]
    pub fn remedy(&self) -> Cow<'static, str> {
        let WrongInputKind::TagFrames(turn) = &self.input else { return self.usual_remedy().into() };
        let [w, x, y, z] = turn.map(|value| format!("{value:.4}"));
        format!("multiply quaternion_wxyz of each tag in the tag map by [{w}, {x}, {y}, {z}] from the right").into()
    }

    fn usual_remedy(&self) -> &'static str {
        match &self.input {
            WrongInputKind::TagFrames(_) => "",
            WrongInputKind::MapUnit(_) => "write position_m and position_std_m of the tag map in metres",
            WrongInputKind::MapAxes(_) => "write position_m of the tag map in a right-handed frame",
            WrongInputKind::NegativePixels(_) => {
                "record columns and rows in pixels from the top left corner of the image, or state the lens of the \
                 image that these count from in [camera] of robot.toml"
            }
            WrongInputKind::ImageShares => {
                "multiply the recorded columns and rows by the width and height of the image"
            }
            WrongInputKind::Distortion => {
                "set distortion of [camera] in robot.toml to zeros, and the focal length and centre to those of the \
                 rectified images"
            }
            WrongInputKind::MapQuaternions => "write quaternion_wxyz of the tag map in the order w, x, y, z",
            WrongInputKind::RecordedQuaternions => {
                "set the other one of quaternion_wxyz and quaternion_xyzw as \
                                                    tags.columns.rotation_form of the input map"
            }
            WrongInputKind::RecordedDirection => {
                "set the other one of camera_from_tag and tag_from_camera as tags.columns.direction of the input map"
            }
            WrongInputKind::ImageSize { .. } | WrongInputKind::ImageScale(_) => {
                "state the lens of the recorded image size in [camera] of robot.toml, or record images of the size \
                 that it was measured for"
            }
            WrongInputKind::FocalLength(_) => {
                "measure the intrinsics in the water or air that the arm works in, and state them in [camera] of \
                 robot.toml"
            }
            WrongInputKind::LensModel => "state the model and the distortion of that lens in [camera] of robot.toml",
            WrongInputKind::TagSize(_) => {
                "measure the border square of one tag (of tag36h11 the black one) and correct size_m"
            }
            WrongInputKind::ExchangedIds(_) => "give each of them the id that is printed there",
            WrongInputKind::OtherMap => {
                "give the tag map of this site with --tag-map, check the tag ids, or make a map with `armcal tagmap`; \
                 if the map is right, check the lens in [camera] of robot.toml"
            }
        }
    }
}

impl WrongInput {
    /// Causes in the tag map.
    fn fmt_of_map(&self, f: &mut fmt::Formatter<'_>, of_pairs: &str) -> fmt::Result {
        match &self.input {
            WrongInputKind::TagSize(ratio) => {
                write!(f, "the size of all tags differs by {:+.1} % from the stated size", 100.0 * (ratio - 1.0))?;
                self.size_hint.as_ref().map_or(Ok(()), |hint| write!(f, ", {hint}"))
            }
            WrongInputKind::MapUnit(unit) => {
                write!(
                    f,
                    "the positions of the tag map are in {unit}, not in metres: so many of them are seen as one metre"
                )
            }
            WrongInputKind::MapAxes(axes) => {
                write!(f, "the positions of the tag map are those of a mirrored frame: read as {axes}, ")?;
                write!(f, "the tags of a view fit each other within {of_pairs}")
            }
            WrongInputKind::TagFrames(turn) => {
                write!(f, "the frames of all tags are turned alike against the tag map, by {}: ", turn_in_words(turn))?;
                write!(f, "turned so, the tags of a view fit each other within {of_pairs}")
            }
            WrongInputKind::ExchangedIds(ids) => {
                let ids: Vec<String> = ids.iter().map(ToString::to_string).collect();
                write!(f, "the tag map has the ids {} exchanged: corrected, ", ids.join(", "))?;
                write!(f, "the tags of a view fit each other within {of_pairs}")
            }
            WrongInputKind::OtherMap => write!(
                f,
                "the tags are not placed as the tag map says: within one view they differ by {} of their distances, \
                 regardless of the arm",
                format_args!("{:.0} %", 100.0 * self.mismatch)
            ),
            _ => Ok(()),
        }
    }
}

/// The cause and its evidence.
impl fmt::Display for WrongInput {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent = |share: f64| format!("{:.0} %", 100.0 * share);
        let degrees = |rad: f64| format!("{:.0} deg", rad.to_degrees());
        let otherwise = self.mismatch_otherwise.unwrap_or(f64::NAN);
        let of_pairs = format!("{} of their distances instead of {}", percent(otherwise), percent(self.mismatch));
        let of_turns = format!("{} instead of {}", degrees(otherwise), degrees(self.mismatch));
        match &self.input {
            WrongInputKind::MapQuaternions => {
                write!(
                    f,
                    "the quaternions of the tag map are in the order x, y, z, w: read so, the tags of a view fit "
                )?;
                write!(f, "each other within {of_pairs}")
            }
            WrongInputKind::RecordedQuaternions => {
                write!(
                    f,
                    "the recorded quaternions are in the other order: read so, the rotations of the landmark over "
                )?;
                write!(f, "the views agree within {of_turns}")
            }
            WrongInputKind::RecordedDirection => {
                write!(f, "the recorded poses are inverse: inverted, the rotations of the landmark over ")?;
                write!(f, "the views agree within {of_turns}")
            }
            WrongInputKind::ImageSize { stated_px: [columns, rows], seen_px: [x, y] } => write!(
                f,
                "the lens of robot.toml belongs to an image of {columns} x {rows} px, but corners reach ({x:.0}, \
                 {y:.0}) px"
            ),
            WrongInputKind::ImageScale(scale) => {
                write!(f, "the lens of robot.toml belongs to an image {scale} times the size of the recorded image: ")?;
                write!(f, "scaled, the tags of a view fit each other within {of_pairs}")
            }
            WrongInputKind::FocalLength(ratio) => {
                write!(f, "the lens is not that of robot.toml: with {ratio:.2} times its focal length ")?;
                write!(f, "the tags of a view fit each other within {of_pairs}{}", medium_of_lens(*ratio))
            }
            WrongInputKind::NegativePixels([x, y]) => write!(
                f,
                "corners of the recording have negative columns or rows, down to ({x:.0}, {y:.0}) px: they do not \
                 count from the image's top left corner"
            ),
            WrongInputKind::ImageShares => {
                f.write_str("all corners of the recording are within 1 px: they are shares of the image, not pixels")
            }
            WrongInputKind::Distortion => {
                write!(f, "the corners come from rectified images: without the distortion of robot.toml ")?;
                write!(f, "the tags of a view fit each other within {of_pairs}")
            }
            WrongInputKind::LensModel => {
                write!(
                    f,
                    "the lens has another model than robot.toml says (fisheye or pinhole): with the other model "
                )?;
                write!(f, "the tags of a view fit each other within {of_pairs}")
            }
            _ => self.fmt_of_map(f, &of_pairs),
        }
    }
}

/// `180 deg about x`, `120 deg about (1, 1, -1)`.
pub(crate) fn turn_in_words([w, x, y, z]: &[f64; 4]) -> String {
    let turn = UnitQuaternion::new_normalize(Quaternion::new(*w, *x, *y, *z));
    let axis = turn.axis().map_or(Vector3::z(), |axis| axis.into_inner() / axis.amax());
    let signs = [axis.x, axis.y, axis.z].map(|along| along.round() as i32);
    let name = match signs {
        [1, 0, 0] => "x".to_owned(),
        [-1, 0, 0] => "-x".to_owned(),
        [0, 1, 0] => "y".to_owned(),
        [0, -1, 0] => "-y".to_owned(),
        [0, 0, 1] => "z".to_owned(),
        [0, 0, -1] => "-z".to_owned(),
        [a, b, c] => format!("({a}, {b}, {c})"),
    };
    format!("{:.0} deg about {name}", turn.angle().to_degrees())
}

#[cfg(test)]
mod tests;
