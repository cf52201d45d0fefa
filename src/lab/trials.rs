//! Trials of the detector: images are rendered, detected in, and compared with the truth.

use nalgebra::{Isometry3, Matrix2, Unit, Vector3};

use crate::scenes::{Condition, Scene, image_spec, lights, wall, wall_place};
use armcal_core::optics::CameraModel;
use armcal_core::streams::RejectReason;
use armcal_detect::{DetectError, DetectorSettings, GreyImage, ImageDetections, TagDetector};
use armcal_sim::WaterKind;
use armcal_sim::imaging::{Imager, Shot};

/// Largest error of a corner, as a share of the tag's shortest side, at which a detection counts as this tag.
const MATCH_SHARE: f64 = 0.3;

#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    #[error(transparent)]
    Detect(#[from] DetectError),
    #[error("{0}")]
    Watcher(String),
}

/// Observer of a study; it has the only clock.
pub trait Watcher {
    fn wall_s(&self) -> f64;

    /// Takes each image after its detection, in the grey levels that were searched.
    ///
    /// # Errors
    /// Any failure of the observer; it ends the study.
    fn image(&mut self, name: &str, image: GreyImage, n_done: usize, n_all: usize) -> Result<(), StudyError>;
}

/// Outcome for one tag.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    Missed,
    Rejected(RejectReason),
    Found { corners_px: [[f64; 2]; 4], covariances_px2: [Matrix2<f64>; 4] },
}

/// One tag in one image.
#[derive(Clone, Debug, PartialEq)]
pub struct TagTrial {
    pub image: String,
    pub condition: Condition,
    pub id: u32,
    pub incidence_rad: f64,
    /// Angle from the optical axis, rad.
    pub view_angle_rad: f64,
    pub shortest_side_px: f64,
    pub truth_px: [[f64; 2]; 4],
    pub outcome: Outcome,
}

#[derive(Clone, Debug, PartialEq)]
pub struct DetectionStudy {
    /// Tags whose corners all lie in the image.
    pub trials: Vec<TagTrial>,
    /// Number of detections that match no tag: a wrong id or a wrong place.
    pub n_false: usize,
    pub n_images: usize,
    /// Rendering time of each image by the watcher's clock, s.
    pub render_s: Vec<f64>,
    pub detect_s: Vec<f64>,
}

/// Renders all conditions and detects in the images.
///
/// # Errors
/// [`StudyError`] of detector or watcher.
pub fn detection_study(
    lens: &CameraModel,
    settings: &DetectorSettings,
    conditions: &[Condition],
    seed: u64,
    watcher: &mut dyn Watcher,
) -> Result<DetectionStudy, StudyError> {
    let mut detector = TagDetector::new(lens, settings.clone())?;
    let mut imager: Option<(WaterKind, Imager)> = None;
    let mut grey = Vec::new();
    let mut study = DetectionStudy { trials: vec![], n_false: 0, n_images: 0, render_s: vec![], detect_s: vec![] };
    for (n, condition) in conditions.iter().enumerate() {
        let start_s = watcher.wall_s();
        let scene = Scene::new(lens, condition, seed);
        let imager = match &mut imager {
            Some((water, imager)) if *water == condition.water => imager,
            other => {
                let mut made = Imager::new(lens, &image_spec(condition.water), &lights(), seed);
                made.set_solids(&[wall()]);
                &mut other.insert((condition.water, made)).1
            }
        };
        shoot(imager, &scene, condition, n as u64, &mut grey);
        let [width, height] = lens.resolution_px().map(|n| n as usize);
        let image = GreyImage { width, height, data: &grey };
        let rendered_s = watcher.wall_s();
        let detected = detector.detect(image)?;
        study.render_s.push(rendered_s - start_s);
        study.detect_s.push(watcher.wall_s() - rendered_s);
        let name = format!("{n:04}.png");
        study.add(&Trial { lens, scene: &scene, condition, image: &name }, &detected);
        study.n_images += 1;
        watcher.image(&name, image, n + 1, conditions.len())?;
    }
    Ok(study)
}

fn shoot(imager: &mut Imager, scene: &Scene, condition: &Condition, number: u64, grey: &mut Vec<u8>) {
    // A wall far behind everything, in scenes that have none.
    let far = Isometry3::translation(0.0, 0.0, 1e3);
    let place = if scene.has_wall { wall_place(condition.range_m) } else { far };
    let planes = scene.planes();
    let shot = Shot {
        base_from_camera: scene.from_camera,
        tags: &planes,
        solids: &[[place; 3]],
        up: Unit::new_normalize(-Vector3::y()),
        is_silty: false,
        number,
    };
    imager.take_image(&shot).grey(grey);
}

/// One image, and the scene that it shows.
struct Trial<'a> {
    lens: &'a CameraModel,
    scene: &'a Scene,
    condition: &'a Condition,
    image: &'a str,
}

impl DetectionStudy {
    /// Compares the detections in an image with the projected tags.
    fn add(&mut self, trial: &Trial<'_>, detected: &ImageDetections) {
        let mut n_matched = 0;
        for tag in &trial.scene.tags {
            let Some(truth_px) = trial.scene.corners_px(trial.lens, tag) else {
                // The image's edge cuts this tag off, so a detection of it counts as no error.
                n_matched += detected.tags.iter().filter(|found| found.detection.id == tag.id).count();
                continue;
            };
            let shortest_side_px = shortest_side_px(&truth_px);
            let is_here = |corners: &[[f64; 2]; 4]| largest_px(corners, &truth_px) < MATCH_SHARE * shortest_side_px;
            let found = detected.tags.iter().find(|t| t.detection.id == tag.id && is_here(&t.detection.corners_px));
            let rejected = || detected.rejects.iter().find(|r| r.id == tag.id && is_here(&r.corners_px));
            let outcome = match found {
                Some(found) => {
                    n_matched += 1;
                    let corners_px = found.detection.corners_px;
                    Outcome::Found { corners_px, covariances_px2: found.covariances_px2 }
                }
                None => rejected().map_or(Outcome::Missed, |reject| Outcome::Rejected(reject.reason)),
            };
            let center_m = tag.camera_from_tag.translation.vector;
            self.trials.push(TagTrial {
                image: trial.image.to_owned(),
                condition: *trial.condition,
                id: tag.id,
                incidence_rad: tag.incidence_rad,
                view_angle_rad: center_m.xy().norm().atan2(center_m.z),
                shortest_side_px,
                truth_px,
                outcome,
            });
        }
        self.n_false += detected.tags.len() - n_matched;
    }
}

fn shortest_side_px(corners: &[[f64; 2]; 4]) -> f64 {
    (0..4).map(|k| distance(corners[k], corners[(k + 1) % 4])).fold(f64::INFINITY, f64::min)
}

fn largest_px(a: &[[f64; 2]; 4], b: &[[f64; 2]; 4]) -> f64 {
    a.iter().zip(b).map(|(a, b)| distance(*a, *b)).fold(0.0, f64::max)
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}
