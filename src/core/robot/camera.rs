//! `[camera]` and `[[further_camera]]` of robot.toml.

use crate::codes::Code;
use std::ops::RangeInclusive;
use std::path::Path;

use schemars::JsonSchema;
use serde::Deserialize;

use super::error::FileIssue;
use super::part::check_place;
use crate::kinematics::Attachment;
use crate::optics::{CameraModel, Fisheye, FlatPort, Radtan, check_image_size};
use crate::spatial::{Camera, Link, Pose};

mod further;

pub use further::MAX_FURTHER_CAMERAS;
pub(super) use further::check_further_cameras;

/// The nominal camera.
#[derive(Clone, Debug)]
pub struct CameraSpec {
    /// Name of the camera's frame in recordings.
    pub name: String,
    /// Nominal `link_from_camera` on the link that carries it.
    pub mount: Attachment,
    /// Nominal lens; [`CameraModel::unknown`] if the folder gives none.
    pub lens: CameraModel,
    /// Standard deviation of each coordinate of a detected corner; 0.3 px if the folder gives none (assumed).
    pub corner_std_px: f64,
    /// Prior standard deviations of the lens parameters.
    pub lens_priors: LensPriors,
    /// Standard deviation of the mount's position error, per axis.
    pub mount_std_m: f64,
    /// Standard deviation of the mount's rotation error, per axis.
    pub mount_std_rad: f64,
}

/// Standard deviations of a calibrated lens; the defaults are those of a usual calibration with a board (assumed).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensPriors {
    /// Relative standard deviation of the focal length.
    pub focal_std: f64,
    /// Standard deviation of the centre along each axis.
    pub center_std_px: f64,
    /// Standard deviation of each distortion coefficient.
    pub distortion_std: f64,
}

impl Default for LensPriors {
    fn default() -> Self {
        Self { focal_std: 2.5e-3, center_std_px: 1.0, distortion_std: 1e-3 }
    }
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct CameraFile {
    /// Name of the camera.
    pub(super) name: String,
    /// Link of the URDF that carries the camera; if no joint moves the link, the camera is stationary.
    pub(super) link: String,
    /// Position of the camera in the frame of that link; absent: at its origin.
    #[schemars(inner(range(min = -1e4, max = 1e4)))]
    position_m: Option<[f64; 3]>,
    /// Attitude of the camera in that link: x right, y down, z along the view; absent: not turned.
    quaternion_wxyz: Option<[f64; 4]>,
    /// Lens model: fisheye of Kannala and Brandt, or pinhole; with the next keys, all or none.
    #[schemars(extend("enum" = ["pinhole", "equidistant"]))]
    model: Option<String>,
    /// Width and height of the image.
    resolution_px: Option<[u32; 2]>,
    /// Focal lengths along u and v.
    #[schemars(inner(range(min = 1.0, max = 1e6)))]
    focal_px: Option<[f64; 2]>,
    /// Principal point; the centre of the first pixel is (0, 0).
    #[schemars(inner(range(min = -1e6, max = 1e6)))]
    center_px: Option<[f64; 2]>,
    /// Coefficients: k1 to k4 of `equidistant`; none, k1, k2, p1, p2 or these and k3 of `pinhole` (OpenCV).
    #[schemars(inner(range(min = -10.0, max = 10.0)))]
    distortion: Option<Vec<f64>>,
    /// Half of the field of view of `equidistant`; that of a pinhole follows from its image.
    #[schemars(range(min = 0.1, max = 3.0))]
    max_view_angle_rad: Option<f64>,
    /// Flat window between lens and water. With it the lens is calibrated in air, without it in its medium.
    port: Option<PortFile>,
    /// Noise of a tag's corner, standard deviation per coordinate; absent: 0.3 px.
    #[schemars(range(min = 1e-3, max = 100.0))]
    corner_std_px: Option<f64>,
    /// Relative standard deviation of the focal length; absent: 0.0025 (assumed).
    #[schemars(range(min = 0.0, max = 0.1))]
    focal_std: Option<f64>,
    /// Standard deviation of the principal point, per axis; absent: 1 px (assumed).
    #[schemars(range(min = 0.0, max = 100.0))]
    center_std_px: Option<f64>,
    /// Standard deviation of each distortion coefficient; absent: 0.001 (assumed).
    #[schemars(range(min = 0.0, max = 1.0))]
    distortion_std: Option<f64>,
    /// Standard deviation of the camera's position in its link, per axis.
    #[schemars(range(min = 0.0, max = 1.0))]
    mount_std_m: f64,
    /// Standard deviation of the camera's attitude in its link, per axis.
    #[schemars(range(min = 0.0, max = 1.0))]
    mount_std_rad: f64,
}

/// Keys of a lens: all of them, or none for a camera that gives poses and no images.
pub(super) const LENS_KEYS: [&str; 5] = ["model", "resolution_px", "focal_px", "center_px", "distortion"];
/// Corner noise of a usual detector, px. Assumed.
const CORNER_STD_PX: f64 = 0.3;

/// A lens as stated in the file.
struct LensFile<'a> {
    model: &'a str,
    resolution_px: [u32; 2],
    focal_px: [f64; 2],
    center_px: [f64; 2],
    distortion: &'a [f64],
    max_view_angle_rad: Option<f64>,
}

/// The table of a camera: its file and the table's name.
#[derive(Clone, Copy)]
pub(super) struct CameraTable<'a> {
    pub file: &'a Path,
    /// Name of the table: `camera`, or `further_camera` with its number.
    pub name: &'a str,
}

impl CameraTable<'_> {
    fn issue(&self, key: &str, problem: impl Into<String>) -> FileIssue {
        FileIssue::new(Code::ValueInvalid, self.file, format!("{}.{key}", self.name), problem)
    }

    fn check(&self, key: &str, value: f64, range: RangeInclusive<f64>) -> Result<f64, FileIssue> {
        FileIssue::check_range(self.file, &format!("{}.{key}", self.name), value, range)
    }
}

impl CameraFile {
    /// Returns the mount on a link whose frame is at `link`: the link's own frame, unless the file states a pose.
    ///
    /// # Errors
    /// [`FileIssue`] naming the key.
    fn mount(&self, table: CameraTable<'_>, link: Attachment) -> Result<Attachment, FileIssue> {
        if self.position_m.is_none() && self.quaternion_wxyz.is_none() {
            return Ok(link);
        }
        let position_m = self.position_m.unwrap_or_default();
        check_place(table.file, &format!("{}.position_m", table.name), &position_m)?;
        let quaternion_wxyz = self.quaternion_wxyz.unwrap_or([1.0, 0.0, 0.0, 0.0]);
        let place: Pose<Link, Camera> = Pose::from_position_quaternion_wxyz(position_m, quaternion_wxyz)
            .ok_or_else(|| table.issue("quaternion_wxyz", "must be finite, not zero"))?;
        Ok(Attachment { link_from_frame: link.link_from_frame * place.isometry(), ..link })
    }

    /// Returns the lens keys; `None` if the file has none of them.
    fn lens(&self, table: CameraTable<'_>) -> Result<Option<LensFile<'_>>, FileIssue> {
        let given = (&self.model, self.resolution_px, self.focal_px, self.center_px, &self.distortion);
        if let (Some(model), Some(resolution_px), Some(focal_px), Some(center_px), Some(distortion)) = given {
            let max_view_angle_rad = self.max_view_angle_rad;
            return Ok(Some(LensFile { model, resolution_px, focal_px, center_px, distortion, max_view_angle_rad }));
        }
        let has = [given.0.is_some(), given.1.is_some(), given.2.is_some(), given.3.is_some(), given.4.is_some()];
        if !has.contains(&true) && self.max_view_angle_rad.is_none() && self.port.is_none() {
            return Ok(None);
        }
        let missing = LENS_KEYS.iter().zip(has).filter(|(_, has)| !has).map(|(key, _)| *key);
        let problem = format!("lacks {}; a lens needs all of them", missing.collect::<Vec<_>>().join(", "));
        Err(FileIssue::new(Code::KeyMissing, table.file, format!("[{}]", table.name), problem))
    }
}

/// A flat window in front of the lens.
#[derive(Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct PortFile {
    /// Distance from the lens's pupil to the window.
    #[schemars(range(min = 0.0, max = 0.5))]
    distance_m: f64,
    /// Thickness of the window.
    #[schemars(range(min = 0.0, max = 0.1))]
    thickness_m: f64,
    /// Refractive index of the window.
    #[serde(default = "acrylic")]
    #[schemars(range(min = 1.0, max = 3.0))]
    glass_index: f64,
    /// Refractive index of the water.
    #[serde(default = "water")]
    #[schemars(range(min = 1.0, max = 2.0))]
    water_index: f64,
}

fn acrylic() -> f64 {
    1.49
}

fn water() -> f64 {
    1.333
}

impl PortFile {
    fn check(self, table: CameraTable<'_>) -> Result<FlatPort, FileIssue> {
        let check = |key: &str, value, range| table.check(&format!("port.{key}"), value, range);
        Ok(FlatPort {
            distance_m: check("distance_m", self.distance_m, 0.0..=0.5)?,
            thickness_m: check("thickness_m", self.thickness_m, 0.0..=0.1)?,
            glass_index: check("glass_index", self.glass_index, 1.0..=3.0)?,
            water_index: check("water_index", self.water_index, 1.0..=2.0)?,
        })
    }
}

/// The lens of a camera, without the window.
fn lens(table: CameraTable<'_>, raw: &LensFile<'_>) -> Result<CameraModel, FileIssue> {
    let issue = |key: &str, problem: String| table.issue(key, problem);
    let (focal, center, resolution) = (raw.focal_px, raw.center_px, raw.resolution_px);
    match (raw.model, raw.distortion) {
        ("equidistant", &[k1, k2, k3, k4]) => {
            let angle = raw.max_view_angle_rad.ok_or_else(|| issue("max_view_angle_rad", "is missing".to_owned()))?;
            let lens = Fisheye {
                focal_px: focal,
                center_px: center,
                distortion: [k1, k2, k3, k4],
                resolution_px: resolution,
                max_view_angle_rad: table.check("max_view_angle_rad", angle, 0.1..=3.0)?,
            };
            let problem =
                "the projected radius does not grow up to max_view_angle_rad; lower the angle or correct distortion";
            let is_monotonic = lens.is_monotonic();
            is_monotonic.then_some(lens.into()).ok_or_else(|| issue("distortion", problem.to_owned()))
        }
        ("pinhole", k) if matches!(k.len(), 0 | 4 | 5) => {
            if raw.max_view_angle_rad.is_some() {
                let problem = "a pinhole's follows from its image: leave it out".to_owned();
                return Err(issue("max_view_angle_rad", problem));
            }
            let k = std::array::from_fn(|at| k.get(at).copied().unwrap_or(0.0));
            Ok(Radtan::new(focal, center, k, resolution).into())
        }
        ("equidistant", k) => Err(issue("distortion", format!("has {} numbers, needs 4: k1 to k4", k.len()))),
        ("pinhole", k) => {
            Err(issue("distortion", format!("has {} numbers, needs none, 4 or 5: k1, k2, p1, p2, k3", k.len())))
        }
        (other, _) => {
            let problem = format!("`{other}` is not supported; use \"equidistant\" (Kannala-Brandt) or \"pinhole\"");
            Err(issue("model", problem))
        }
    }
}

pub(super) fn check_camera(
    table: CameraTable<'_>,
    raw: &CameraFile,
    link: Attachment,
) -> Result<CameraSpec, FileIssue> {
    let check = |key: &str, value: f64, range| table.check(key, value, range);
    let port = raw.port.map(|port| port.check(table)).transpose()?;
    let lens = match raw.lens(table)? {
        None => CameraModel::unknown(),
        Some(given) => {
            check_image_size(given.resolution_px)
                .map_err(|problem| table.issue("resolution_px", format!("is {problem}")))?;
            for k in 0..2 {
                check("focal_px", given.focal_px[k], 1.0..=1e6)?;
                check("center_px", given.center_px[k], -1e6..=1e6)?;
            }
            for value in given.distortion {
                check("distortion", *value, -10.0..=10.0)?;
            }
            CameraModel { port, ..lens(table, &given)? }
        }
    };
    let usual = LensPriors::default();
    let lens_priors = LensPriors {
        focal_std: check("focal_std", raw.focal_std.unwrap_or(usual.focal_std), 0.0..=0.1)?,
        center_std_px: check("center_std_px", raw.center_std_px.unwrap_or(usual.center_std_px), 0.0..=100.0)?,
        distortion_std: check("distortion_std", raw.distortion_std.unwrap_or(usual.distortion_std), 0.0..=1.0)?,
    };
    Ok(CameraSpec {
        name: raw.name.clone(),
        mount: raw.mount(table, link)?,
        lens,
        lens_priors,
        corner_std_px: check("corner_std_px", raw.corner_std_px.unwrap_or(CORNER_STD_PX), 1e-3..=100.0)?,
        mount_std_m: check("mount_std_m", raw.mount_std_m, 0.0..=1.0)?,
        mount_std_rad: check("mount_std_rad", raw.mount_std_rad, 0.0..=1.0)?,
    })
}
