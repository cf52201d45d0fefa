//! Image plane of the wrist camera: detections, rejects, and predicted tags.

use crate::rerun::{EncodedImage, Image, LineStrips2D, Radius};
use nalgebra::{Isometry3, Point3, Vector2, Vector3};

use crate::colors;
use crate::entities::CAMERA;
use crate::entity_log::EntityLog;
use crate::scene::ReplayScene;
use crate::tracks::Tick;
use armcal_core::optics::CameraModel;
use armcal_core::robot::SurveyedTag;
use armcal_core::streams::{DetectionReject, TagDetection};

/// Largest rate at which the image is drawn, Hz.
const VIEWS_HZ: f64 = 12.5;
/// Time after which detections disappear without a new image, s.
const STALE_S: f64 = 0.6;
/// Time after which the image disappears without a new one, s.
const STALE_IMAGE_S: f64 = 2.5;
/// Offset of a pixel's centre: in Rerun, whole numbers are pixel corners; in the lens model, centres.
const PIXEL_CENTER: f32 = 0.5;
/// Bearings whose circles are drawn, rad.
const RINGS_RAD: [f64; 2] = [std::f64::consts::FRAC_PI_6, std::f64::consts::FRAC_PI_3];

/// Draws the image plane.
pub(super) fn draw(run: &ReplayScene, stream: &mut EntityLog) {
    let lens = &run.robot.camera.lens;
    if !lens.is_known() {
        return;
    }
    let [width, height] = lens.resolution_px();
    let nothing = format!("{CAMERA}/background");
    if run.tracks.images.is_empty() && !stream.is_shown(&nothing) {
        stream.log_static(&nothing, &Image::from_rgb24(background(lens), [width, height]));
    }
    draw_images(run, stream);
    let rings = LineStrips2D::new(RINGS_RAD.iter().map(|&angle_rad| ring(lens, angle_rad)));
    stream.log_static(&format!("{CAMERA}/rings"), &rings.with_radii([0.7]).with_colors([[52, 76, 96, 255]]));
    draw_expected(run, stream);
    draw_seen(run, stream);
    draw_rejected(run, stream);
}

/// Draws the camera's images as they were compressed. Each stays until the next one, or disappears after
/// [`STALE_IMAGE_S`].
fn draw_images(run: &ReplayScene, stream: &mut EntityLog) {
    let entity = format!("{CAMERA}/image");
    for (n, (time_s, image)) in run.tracks.images.iter().enumerate() {
        let picture = EncodedImage::new(image.jpeg.clone()).with_media_type("image/jpeg");
        stream.draw(&entity, *time_s, &picture);
        let next_s = run.tracks.images.get(n + 1).map_or(f64::INFINITY, |(next_s, _)| *next_s);
        if next_s - time_s > STALE_IMAGE_S && time_s + STALE_IMAGE_S < run.tracks.duration_s {
            stream.clear(&entity, time_s + STALE_IMAGE_S);
        }
    }
}

/// Returns an image with dark water in the field of view and black outside.
fn background(lens: &CameraModel) -> Vec<u8> {
    let [width, height] = lens.resolution_px();
    let mut pixels = Vec::with_capacity(3 * width as usize * height as usize);
    for y in 0..height {
        for x in 0..width {
            let inside = lens.sees(&Vector2::new(f64::from(x), f64::from(y)));
            pixels.extend_from_slice(if inside { &[18, 34, 48] } else { &[4, 5, 6] });
        }
    }
    pixels
}

/// Returns the circle of all bearings at an angle from the optical axis.
fn ring(lens: &CameraModel, angle_rad: f64) -> Vec<[f32; 2]> {
    let around = (0..=96).map(|n| f64::from(n) * std::f64::consts::TAU / 96.0);
    let bearings = around.map(|a| Vector3::new(angle_rad.sin() * a.cos(), angle_rad.sin() * a.sin(), angle_rad.cos()));
    bearings.filter_map(|bearing| lens.project(&bearing)).map(|pixel| corner(pixel.into())).collect()
}

fn corner([x, y]: [f64; 2]) -> [f32; 2] {
    [x as f32 + PIXEL_CENTER, y as f32 + PIXEL_CENTER]
}

/// Draws the detected tags, which disappear when images stop.
fn draw_seen(run: &ReplayScene, stream: &mut EntityLog) {
    let entity = format!("{CAMERA}/seen");
    let style = LineStrips2D::update_fields().with_radii([Radius::new_ui_points(1.5)]).with_colors([colors::SEEN]);
    stream.log_static(&entity, &style.with_show_labels(true).with_draw_order(30.0));
    let views = run.tracks.views.iter().map(|(time_s, view)| (*time_s, view.tags.iter().map(seen_quad).collect()));
    draw_quads(run, stream, &entity, views.collect());
}

/// Draws rejected detections with their reasons.
fn draw_rejected(run: &ReplayScene, stream: &mut EntityLog) {
    if run.tracks.rejects.is_empty() {
        return;
    }
    let entity = format!("{CAMERA}/rejected");
    let style = LineStrips2D::update_fields().with_radii([Radius::new_ui_points(1.0)]).with_colors([colors::REJECTED]);
    stream.log_static(&entity, &style.with_show_labels(true).with_draw_order(25.0));
    let views =
        run.tracks.rejects.iter().map(|(time_s, view)| (*time_s, view.rejects.iter().map(rejected_quad).collect()));
    draw_quads(run, stream, &entity, views.collect());
}

/// Draws outlines by time. Each stays until the next, or disappears after [`STALE_S`].
fn draw_quads(run: &ReplayScene, stream: &mut EntityLog, entity: &str, mut views: Vec<(f64, Vec<Quad>)>) {
    views.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut drawn: Option<f64> = None;
    for (n, (time_s, view)) in views.iter().enumerate() {
        // If two frames have the same time, the later one stays.
        let next_s = views.get(n + 1).map_or(f64::INFINITY, |(next_s, _)| *next_s);
        let is_last_for_long = next_s.min(run.tracks.duration_s) - time_s > STALE_S;
        // The first view of each time slot is drawn, so that the start of the drawing does not matter.
        let slot = (time_s * VIEWS_HZ).floor();
        if drawn == Some(slot) && !is_last_for_long {
            continue;
        }
        stream.draw(entity, *time_s, &quads(view.iter().cloned()));
        drawn = Some(slot);
        if is_last_for_long && time_s + STALE_S < run.tracks.duration_s {
            stream.draw(entity, time_s + STALE_S, &quads(std::iter::empty()));
        }
    }
}

/// A closed outline and its label.
type Quad = (Vec<[f32; 2]>, String);

fn seen_quad(tag: &TagDetection) -> Quad {
    (closed(tag.corners_px.map(corner)), format!("{}", tag.id))
}

fn rejected_quad(reject: &DetectionReject) -> Quad {
    (closed(reject.corners_px.map(corner)), format!("{}: {}", reject.id, reject.reason.name().replace('_', " ")))
}

fn closed(corners: [[f32; 2]; 4]) -> Vec<[f32; 2]> {
    corners.into_iter().chain([corners[0]]).collect()
}

fn quads(quads: impl Iterator<Item = Quad>) -> LineStrips2D {
    let (strips, labels): (Vec<_>, Vec<_>) = quads.unzip();
    LineStrips2D::update_fields().with_strips(strips).with_labels(labels)
}

/// Draws surveyed tags where the estimate predicts them.
fn draw_expected(run: &ReplayScene, stream: &mut EntityLog) {
    let entity = format!("{CAMERA}/expected");
    let style = LineStrips2D::update_fields().with_radii([Radius::new_ui_points(1.0)]).with_colors([colors::BELIEVED]);
    stream.log_static(&entity, &style.with_draw_order(20.0));
    let mut drawn: Option<Vec<Vec<[f32; 2]>>> = None;
    for Tick { time_s, is_drawn } in run.tracks.ticks_with_lead(VIEWS_HZ, 1) {
        let Some(angles) = run.tracks.believed.at(time_s) else { continue };
        let poses = run.believed_poses(time_s, angles).in_frame(&run.robot.tag_frame);
        let tags_from_camera = poses.frame(&run.robot.camera.mount);
        let strips: Vec<_> =
            run.robot.tags.iter().filter_map(|tag| expected_outline(run, &tags_from_camera, tag)).collect();
        if is_drawn && drawn.as_ref() != Some(&strips) {
            stream.draw(&entity, time_s, &LineStrips2D::update_fields().with_strips(strips.clone()));
        }
        drawn = Some(strips);
    }
}

/// Returns the outline of a tag in the image, rounded to a tenth of a pixel; `None` if the camera cannot see it.
fn expected_outline(run: &ReplayScene, tags_from_camera: &Isometry3<f64>, tag: &SurveyedTag) -> Option<Vec<[f32; 2]>> {
    let lens = &run.robot.camera.lens;
    let camera_from_tag = tags_from_camera.inv_mul(tag.base_from_tag.isometry());
    let normal = camera_from_tag.rotation * Vector3::z();
    if normal.dot(&camera_from_tag.translation.vector) >= 0.0 {
        return None;
    }
    let mut outline = [[0.0; 2]; 4];
    for (pixel, point) in outline.iter_mut().zip(armcal_core::optics::square_corners(tag.size_m)) {
        let in_camera: Point3<f64> = camera_from_tag * point;
        let projected = lens.project(&in_camera.coords)?;
        if !lens.contains(&projected) {
            return None;
        }
        *pixel = corner(projected.into()).map(|v| (v * 10.0).round() / 10.0);
    }
    Some(closed(outline))
}
