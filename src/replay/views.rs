//! Views of a real arm's recording after calibration: the arm at each rest, and the tags that it observed.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::rerun::{LineStrips3D, Points3D, Scalars, SeriesPoints, TextDocument};
use nalgebra::Point3;

use crate::entities::{BASE, SIGHTING, SUMMARY};
use crate::entity_log::EntityLog;
use crate::error::ReplayError;
use crate::identity::Identity;
use crate::poses::vector;
use crate::recording::scene;
use crate::scene::ReplayInput;
use crate::shapes::path_part;
use crate::{arms, blueprint, colors, plots, residuals, rrd, scenery};
use armcal_belief::calib::{TagObservation, View};
use armcal_core::joints::JointAngles;
use armcal_core::log::Recording;
use armcal_core::robot::Robot;
use armcal_core::streams::{CaptureSet, JointStateBelief, Mark, MarkKind, Message};

/// Views and robots of a calibration that are shown.
pub struct ViewsInput<'a> {
    pub views: &'a [View],
    /// Robot by nominal model and datasheet, with the tags that were around the arm.
    pub drawn: &'a Robot,
    /// Robot with the calibrated camera mount and links.
    pub calibrated: &'a Robot,
    /// Calibrated joint angles of each view, rad.
    pub angles: &'a [JointAngles],
    pub summary_markdown: &'a str,
}

/// Writes `out`, an .rrd file with its blueprint, replacing one of that name.
///
/// # Errors
/// [`ReplayError`]: no views, or a file that cannot be written.
pub fn write_views_rrd(input: &ViewsInput<'_>, out: &Path) -> Result<(), ReplayError> {
    let recording = recording(input);
    let shown = ReplayInput {
        recording: &recording,
        truth: None,
        robot: input.calibrated,
        vehicle: None,
        scene: None,
        believed_links: &[],
        tool_beliefs: &[],
        residuals: &[],
        clearance_m: None,
        online: None,
        summary_markdown: Some(input.summary_markdown),
    };
    let run = scene(&shown)?;
    let mut stream = EntityLog::of_recording();
    scenery::draw(&run, &mut stream);
    residuals::draw(&run, shown.residuals, &mut stream);
    arms::draw_at_rest(&run, &mut stream);
    plots::draw(&run, &mut stream);
    stream.log_static(
        SUMMARY,
        &TextDocument::from_markdown(format!("{}\n\n{LEGEND}", input.summary_markdown.trim_end())),
    );
    let times_s: Vec<f64> = input.views.iter().map(|view| run.tracks.place_s(view.end, view.end)).collect();
    draw_sightings(input, &times_s, &mut stream);
    rrd::write(out, &Identity::of(&shown)?, &blueprint::build_views(&run), stream)
}

const LEGEND: &str = "### How to read the picture\n\n\
    - the arm at each view as calibrated; links without shapes are lines\n\
    - blue cone: the camera's line of sight; blue dots: where it was in the views so far\n\
    - yellow dot: where a tag or board was seen; its plate: where drawing and survey have it; green line: from the \
      camera to the mean of its sightings\n\
    - upper plot: how far a view's sightings are from their mean, by the datasheet and as calibrated\n";

/// Returns a recording with the angles of each view, and a mark.
fn recording(input: &ViewsInput<'_>) -> Recording {
    let messages = input.views.iter().zip(input.angles).flat_map(|(view, angles)| {
        let stamp = view.end;
        let kind = MarkKind::Capture { set: CaptureSet::Fit, pose_idx: view.pose_idx };
        [
            Message::JointStates(JointStateBelief { stamp, angles: *angles }),
            Message::Mark(Mark { start: stamp, end: stamp, kind }),
        ]
        .map(|message| (stamp, message))
    });
    Recording {
        path: PathBuf::new(),
        messages: messages.collect(),
        joint_names: input.drawn.joint_names(),
        ..Recording::default()
    }
}

fn by_datasheet(robot: &Robot, view: &View) -> JointAngles {
    JointAngles::from_fn(robot.n_joints(), |joint| robot.sensors[joint].center_rad + view.travel_rad[joint])
}

/// Observation of a tag in a view: number of the view, index of the tag, position in the frame of the tags, m.
type Sighting = (usize, usize, Point3<f64>);

fn sightings(views: &[View], robot: &Robot, angles: &[JointAngles]) -> Vec<Sighting> {
    let of_view = |(at, view): (usize, &View)| {
        let tags_from_camera = robot.tags_from(robot.camera_at(view.camera), &angles[at]);
        let place =
            move |seen: &TagObservation| (at, seen.tag_idx, tags_from_camera * Point3::from(seen.center_in_camera_m));
        view.tags.iter().map(place).collect::<Vec<Sighting>>()
    };
    views.iter().enumerate().flat_map(of_view).collect()
}

/// Returns the mean position of each tag.
fn means(sightings: &[Sighting]) -> BTreeMap<usize, Point3<f64>> {
    let mut sums: BTreeMap<usize, (nalgebra::Vector3<f64>, f64)> = BTreeMap::new();
    for (_, tag, place) in sightings {
        let (sum, n) = sums.entry(*tag).or_default();
        *sum += place.coords;
        *n += 1.0;
    }
    sums.into_iter().map(|(tag, (sum, n))| (tag, Point3::from(sum / n))).collect()
}

/// Draws the RMS distance of each view's tags from the mean positions of the tags: by datasheet, and as calibrated.
fn draw_sightings(input: &ViewsInput<'_>, times_s: &[f64], stream: &mut EntityLog) {
    let by_datasheet: Vec<JointAngles> = input.views.iter().map(|view| by_datasheet(input.drawn, view)).collect();
    let drawn = sightings(input.views, input.drawn, &by_datasheet);
    let found = sightings(input.views, input.calibrated, input.angles);
    for (name, all, shade) in [("by datasheet", &drawn, colors::PAST), ("as calibrated", &found, colors::TARGET)] {
        let means = means(all);
        let entity = format!("{SIGHTING}/{}", path_part(name));
        let points = SeriesPoints::new().with_names([name]).with_colors([shade]);
        stream.log_static(&entity, &points.with_marker_sizes([3.0]));
        for (at, view) in times_s.iter().enumerate() {
            let of_view = all.iter().filter(|(view, ..)| *view == at);
            let off_mm: Vec<f64> = of_view.map(|(_, tag, place)| 1000.0 * (place - means[tag]).norm()).collect();
            if !off_mm.is_empty() {
                let rms = (off_mm.iter().map(|mm| mm * mm).sum::<f64>() / off_mm.len() as f64).sqrt();
                stream.draw(&entity, *view, &Scalars::single(rms));
            }
        }
    }
    draw_places(input, &found, times_s, stream);
}

fn draw_places(input: &ViewsInput<'_>, found: &[Sighting], times_s: &[f64], stream: &mut EntityLog) {
    let means = means(found);
    for (at, (angles, view)) in input.angles.iter().zip(input.views).enumerate() {
        let base_from_tags = input.calibrated.base_from_tags(angles);
        let camera = base_from_tags * input.calibrated.tags_from(input.calibrated.camera_at(view.camera), angles);
        let of_view: Vec<&Sighting> = found.iter().filter(|(view, ..)| *view == at).collect();
        let places = of_view.iter().map(|(_, _, place)| vector(&(base_from_tags * place).coords));
        let points = Points3D::new(places.clone()).with_colors([colors::TARGET]).with_radii([0.012]);
        stream.draw(&format!("{BASE}/sightings"), times_s[at], &points);
        let eye = vector(&camera.translation.vector);
        let rays = of_view.iter().map(|(_, tag, _)| vec![eye, vector(&(base_from_tags * means[tag]).coords)]);
        let rays = LineStrips3D::new(rays.collect::<Vec<_>>()).with_colors([colors::SEEN]).with_radii([0.002]);
        stream.draw(&format!("{BASE}/lines_of_sight"), times_s[at], &rays);
    }
}
