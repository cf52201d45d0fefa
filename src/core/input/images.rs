//! Images of a recording that were not searched for tags; this module does not know the detector.

use std::path::Path;

use super::error::InputError;
use super::message_type::check_type;
use crate::log::ros::{CameraInfo, CompressedImage, Image};
use crate::log::{CdrError, RawMessage, RosMessage, decode, for_each_raw};
use crate::optics::{CameraModel, Fisheye, Radtan, TagFamily, check_image_size};

/// An image as recorded.
#[derive(Clone, Debug, PartialEq)]
pub enum RecordedImage {
    /// Pixels.
    Raw(Image),
    /// A PNG or JPEG file.
    Compressed(CompressedImage),
}

/// Id and corners of a tag, raw pixels: bottom left, bottom right, top right, top left as printed.
pub type TagCorners = (u32, [[f64; 2]; 4]);

/// Reason why an image has no tags.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ImageProblem {
    /// The image is damaged; others may be intact.
    Damaged,
    /// The image claims more pixels than its bytes can encode, and is not decoded; others may be intact.
    TooFewBytes,
    /// No image of this kind can be used; the text is the end of a sentence about the image.
    Unusable(String),
}

/// Finds tags in images.
pub trait ImageDetector {
    /// Family of tags that the detector knows.
    fn family(&self) -> TagFamily;

    /// Finds the tags of one image of the robot's camera number `camera`.
    ///
    /// # Errors
    /// [`ImageProblem`].
    fn detect(&mut self, camera: usize, image: &RecordedImage) -> Result<Vec<TagCorners>, ImageProblem>;
}

impl RecordedImage {
    /// Decodes a `sensor_msgs/msg/Image` or `CompressedImage`.
    pub(super) fn of(raw: &RawMessage<'_>) -> Result<Self, CdrError> {
        if raw.schema_name().ends_with("/CompressedImage") {
            decode(raw.data).map(Self::Compressed)
        } else {
            decode(raw.data).map(Self::Raw)
        }
    }
}

/// Lens of a camera_info topic.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraInfoLens {
    /// Lens of the first message that holds a usable one.
    pub lens: CameraModel,
    /// Sentences on messages that were skipped or hold another lens.
    pub notes: Vec<String>,
    /// Focal lengths and centre of rectified images, px, by the message's projection; zeros if it has none.
    pub projection: [f64; 4],
}

impl CameraInfoLens {
    /// Returns a sentence if this lens has a distortion and `images`, by its name a topic of rectified images, cannot
    /// use it.
    #[must_use]
    pub fn rectified_note(&self, images: &str, topic: &str) -> Option<String> {
        let is_rectified = images.split(['/', '_']).any(|part| part.starts_with("rect"));
        let distortion = self.lens.distortion();
        if !is_rectified || distortion.iter().all(|k| *k == 0.0) {
            return None;
        }
        let [fx, fy, cx, cy] = self.projection;
        let numbers = match fx > 0.0 && fy > 0.0 {
            true => format!(": focal_px = [{fx:.3}, {fy:.3}], center_px = [{cx:.3}, {cy:.3}] by its projection"),
            false => String::new(),
        };
        Some(format!(
            "{images} is rectified by its name, and the lens on {topic} has the distortion {distortion:?}; rectified \
             images have none: state their lens as [camera] of robot.toml with model = \"pinhole\" and distortion = \
             [0.0, 0.0, 0.0, 0.0]{numbers}"
        ))
    }
}

/// Returns the lens of the first usable `sensor_msgs/msg/CameraInfo` on `topic`.
///
/// # Errors
/// [`InputError`] if there is none, or its lens is of an unsupported model.
pub fn read_camera_info(path: &Path, topic: &str) -> Result<CameraInfoLens, InputError> {
    let file = path.display().to_string();
    let mut found = CameraInfos::default();
    let mut wrong_type = None;
    for_each_raw(path, |raw| {
        if raw.topic() == topic && wrong_type.is_none() {
            wrong_type = check_type(&file, raw, &[CameraInfo::SCHEMA]).err();
            found.take(raw.data);
        }
    })?;
    if let Some(error) = wrong_type {
        return Err(error);
    }
    let notes = found.notes(topic);
    match (found.lens, found.first_problem) {
        (Some((_, lens)), _) => Ok(CameraInfoLens { lens, notes, projection: found.projection }),
        (None, problem) => {
            let problem = problem.map_or_else(|| "has no message".to_owned(), |(_, problem)| problem);
            Err(InputError::CameraInfo { file, topic: topic.to_owned(), problem })
        }
    }
}

/// Lenses in the messages of one topic.
#[derive(Default)]
struct CameraInfos {
    n: u64,
    /// First usable lens, and its message's number.
    lens: Option<(u64, CameraModel)>,
    /// Projection of the first usable lens.
    projection: [f64; 4],
    /// First reason for an unusable message, and the number of unusable messages.
    first_problem: Option<(u64, String)>,
    /// First message with another lens than the first usable one, its image size, and the number of such messages.
    other: Option<(u64, [u32; 2], u64)>,
}

impl CameraInfos {
    fn take(&mut self, data: &[u8]) {
        self.n += 1;
        let read = decode::<CameraInfo>(data).map_err(|error| format!("cannot be decoded: {error}"));
        let read = read.and_then(|info| Ok((lens_of_camera_info(&info)?, info.p)));
        match (read, &self.lens) {
            (Ok((lens, p)), None) => {
                (self.lens, self.projection) = (Some((self.n, lens)), [p[0], p[5], p[2], p[6]]);
            }
            (Ok((lens, _)), Some((_, first))) if lens != *first => {
                self.other.get_or_insert((self.n, lens.resolution_px(), 0)).2 += 1;
            }
            (Ok(_), Some(_)) => {}
            (Err(problem), _) => self.first_problem.get_or_insert((0, problem)).0 += 1,
        }
    }

    fn notes(&self, topic: &str) -> Vec<String> {
        let Some((message, lens)) = &self.lens else { return Vec::new() };
        let n = self.n;
        let skipped = self.first_problem.iter().map(|(skipped, problem)| {
            format!("{skipped} of {n} messages on {topic} are no usable lens and skipped; the first {problem}")
        });
        let [width, height] = lens.resolution_px();
        let others = self.other.iter().map(|(at, [other_width, other_height], others)| {
            format!(
                "{others} of {n} messages on {topic} hold another lens: message {message} is for {width} x {height} \
                 pixels and is used, message {at} for {other_width} x {other_height}; state the right lens as [camera] \
                 of robot.toml"
            )
        });
        skipped.chain(others).collect()
    }
}

/// Returns the lens of a `CameraInfo`.
///
/// # Errors
/// The end of a sentence about the message, with the remedy.
pub fn lens_of_camera_info(info: &CameraInfo) -> Result<CameraModel, String> {
    const ALLOWED: &str = "armcal knows \"plumb_bob\" and \"rational_polynomial\" without its last three coefficients, \
        and \"equidistant\"; give another lens in robot.toml";
    let (focal_px, center_px) = ([info.k[0], info.k[4]], [info.k[2], info.k[5]]);
    let resolution_px = [info.width, info.height];
    if info.k.iter().all(|value| *value == 0.0) {
        return Err("has no calibration: its matrix k is all zeros; calibrate the camera and record again, or state \
                    the lens as [camera] of robot.toml"
            .to_owned());
    }
    check_image_size(resolution_px)
        .map_err(|problem| format!("is for {problem}: state the lens as [camera] of robot.toml"))?;
    if !focal_px.iter().all(|f| (1.0..=1e6).contains(f)) || !center_px.iter().all(|c| c.abs() <= 1e6) {
        return Err(format!(
            "is no calibration: focal lengths {focal_px:?} px, centre {center_px:?} px; state the lens as [camera] of \
             robot.toml"
        ));
    }
    if !info.d.iter().all(|d| d.abs() <= 10.0) {
        return Err(format!("has the distortion {:?}; -10 .. 10 are allowed", info.d));
    }
    if let Some(part) = part_of_image(info) {
        return Err(part);
    }
    match (info.distortion_model.as_str(), &info.d[..]) {
        ("equidistant" | "fisheye", &[k1, k2, k3, k4]) => {
            Ok(Fisheye::with_widest_view(focal_px, center_px, [k1, k2, k3, k4], resolution_px).into())
        }
        // A rectified image has neither a model nor coefficients.
        ("plumb_bob" | "", d) if matches!(d.len(), 0 | 4 | 5) => Ok(radtan(focal_px, center_px, d, resolution_px)),
        ("rational_polynomial", d) if d.len() >= 8 && d[5..].iter().all(|k| *k == 0.0) => {
            Ok(radtan(focal_px, center_px, &d[..5], resolution_px))
        }
        (model, d) => Err(format!("has the model {model:?} with {} coefficients; {ALLOWED}", d.len())),
    }
}

/// Describes the lens of a binned or cropped image, whose pixels `k` does not describe; `None` for a whole image.
fn part_of_image(info: &CameraInfo) -> Option<String> {
    let (roi, binning) = (&info.roi, [info.binning_x.max(1), info.binning_y.max(1)]);
    let offset = [roi.x_offset, roi.y_offset];
    let full = [info.width, info.height];
    let size = [roi.width, roi.height];
    // Zeros mean the whole image.
    let size =
        if size.contains(&0) { [full[0].saturating_sub(offset[0]), full[1].saturating_sub(offset[1])] } else { size };
    if binning == [1, 1] && offset == [0, 0] && size == full {
        return None;
    }
    let pixels: [u32; 2] = std::array::from_fn(|k| size[k] / binning[k]);
    let focal_px: [f64; 2] = std::array::from_fn(|k| info.k[4 * k] / f64::from(binning[k]));
    // The centre of the first pixel is 0, so half a pixel is added before the division and subtracted after it.
    let center_px: [f64; 2] =
        std::array::from_fn(|k| (info.k[2 + 3 * k] - f64::from(offset[k]) + 0.5) / f64::from(binning[k]) - 0.5);
    Some(format!(
        "is for a part of {} x {} pixels: binning {} x {}, offset {}, {}, so that its images have {} x {}; state their \
         lens as [camera] of robot.toml: resolution_px = {pixels:?}, focal_px = {focal_px:.3?}, center_px = \
         {center_px:.3?}",
        full[0], full[1], binning[0], binning[1], offset[0], offset[1], pixels[0], pixels[1]
    ))
}

fn radtan(focal_px: [f64; 2], center_px: [f64; 2], d: &[f64], resolution_px: [u32; 2]) -> CameraModel {
    let distortion = std::array::from_fn(|at| d.get(at).copied().unwrap_or(0.0));
    Radtan::new(focal_px, center_px, distortion, resolution_px).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::ros::RegionOfInterest;
    use crate::optics::LensModel;

    fn info(model: &str, d: &[f64]) -> CameraInfo {
        CameraInfo {
            width: 640,
            height: 480,
            distortion_model: model.into(),
            d: d.to_vec(),
            k: [500.0, 0.0, 320.0, 0.0, 510.0, 240.0, 0.0, 0.0, 1.0],
            ..CameraInfo::default()
        }
    }

    #[test]
    fn lenses_of_ros_become_those_of_the_same_equations() {
        let LensModel::Radtan(pinhole) =
            lens_of_camera_info(&info("plumb_bob", &[0.1, -0.2, 0.01, 0.02, 0.3])).expect("known").lens
        else {
            panic!("a pinhole")
        };
        assert_eq!((pinhole.focal_px, pinhole.center_px), ([500.0, 510.0], [320.0, 240.0]));
        assert_eq!((pinhole.distortion, pinhole.resolution_px), ([0.1, -0.2, 0.01, 0.02, 0.3], [640, 480]));
        let rational = lens_of_camera_info(&info("rational_polynomial", &[0.1, -0.2, 0.01, 0.02, 0.3, 0.0, 0.0, 0.0]));
        assert_eq!(rational.expect("known").lens, LensModel::Radtan(pinhole));
        let LensModel::Equidistant(fisheye) =
            lens_of_camera_info(&info("equidistant", &[0.01, 0.0, 0.0, 0.0])).expect("known").lens
        else {
            panic!("a fisheye")
        };
        assert!(fisheye.distortion == [0.01, 0.0, 0.0, 0.0] && fisheye.max_view_angle_rad > 0.5);
    }

    #[test]
    fn lenses_that_are_not_known_are_named() {
        let uncalibrated = CameraInfo { k: [0.0; 9], ..info("plumb_bob", &[]) };
        let binned = CameraInfo { binning_x: 2, binning_y: 2, ..info("plumb_bob", &[]) };
        let roi = RegionOfInterest { x_offset: 100, y_offset: 20, height: 300, width: 400, do_rectify: false };
        let part = CameraInfo { roi, ..info("plumb_bob", &[]) };
        let faults = [
            info("rational_polynomial", &[0.1, 0.0, 0.0, 0.0, 0.0, 0.2, 0.0, 0.0]),
            info("plumb_bob", &[0.0; 3]),
            info("equidistant", &[f64::NAN; 4]),
            CameraInfo { width: 0, ..info("plumb_bob", &[]) },
            CameraInfo { width: 20_000, height: 20_000, ..info("plumb_bob", &[]) },
            CameraInfo { width: 50_000, ..info("plumb_bob", &[]) },
            uncalibrated,
            binned,
            part,
        ];
        insta::assert_snapshot!(
            "camera_info",
            faults.map(|info| lens_of_camera_info(&info).expect_err("refused")).join("\n")
        );
    }

    #[test]
    fn rectified_images_of_a_lens_with_distortion_are_named_with_the_projection() {
        let of = |d: &[f64], projection: [f64; 4]| {
            let lens = lens_of_camera_info(&info("plumb_bob", d)).expect("known");
            CameraInfoLens { lens, notes: Vec::new(), projection }
        };
        let distorted = of(&[0.1, -0.2, 0.01, 0.02, 0.0], [480.5, 482.0, 318.0, 241.5]);
        let note = |lens: &CameraInfoLens, images: &str| lens.rectified_note(images, "/cam/camera_info");
        for images in ["/cam/image_raw", "/direct/image", "/detections"] {
            assert_eq!(note(&distorted, images), None, "{images}");
        }
        assert_eq!(note(&of(&[0.0; 5], [480.5, 482.0, 318.0, 241.5]), "/cam/image_rect"), None);
        let told = [
            note(&distorted, "/cam/image_rect"),
            note(&distorted, "/left/image_rect_color/compressed"),
            note(&of(&[0.0, 0.0, 0.001, 0.0], [0.0; 4]), "/rectified/image"),
        ];
        insta::assert_snapshot!("rectified", told.map(|note| note.expect("a note")).join("\n"));
    }
}
