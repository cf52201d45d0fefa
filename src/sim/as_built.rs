//! The arm, camera mount and tags as they were built: drawn once per seed, seen by nobody but the score.

use nalgebra::{Vector3, Vector6};
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use super::spec::WorldSpec;
use crate::kinematics::Attachment;
use crate::robot::Robot;
use crate::spatial::{Base, Camera, Frame, Link, Pose, Tag};
use crate::stats::stream_rng;

/// Everything that was drawn for one seed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AsBuilt {
    pub joints: Vec<JointAsBuilt>,
    /// `link_from_camera` on the link that carries the camera.
    pub camera_mount: PlainPose,
    pub tags: Vec<TagAsBuilt>,
}

/// A joint sensor as built; `sensors::pot` has the equation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointAsBuilt {
    pub name: String,
    pub center_rad: f64,
    pub range_rad: f64,
    pub gain_error: f64,
    pub offset_error_rad: f64,
    pub temperature_offset_rad_per_k: f64,
    pub temperature_gain_per_k: f64,
    /// Counts per radian over the datasheet's.
    #[serde(default = "one_to_one")]
    pub gear_ratio: f64,
    pub harmonics: Vec<Harmonic>,
}

/// Truths recorded before there were gears.
fn one_to_one() -> f64 {
    1.0
}

/// One term of the nonlinearity: `amplitude * sin(2 pi order (theta - center) / range + phase)`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Harmonic {
    pub order: f64,
    pub amplitude_rad: f64,
    pub phase_rad: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TagAsBuilt {
    pub id: u32,
    pub size_m: f64,
    /// `base_from_tag`.
    pub pose: PlainPose,
}

/// A pose as files write it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlainPose {
    pub position_m: [f64; 3],
    pub quaternion_wxyz: [f64; 4],
}

impl AsBuilt {
    /// Draws every value from a stream of its own, so that one more effect does not move the others.
    pub(super) fn draw(robot: &Robot, spec: &WorldSpec, seed: u64) -> Self {
        let joints = (0..robot.n_joints()).map(|joint| draw_joint(robot, joint, spec, seed)).collect();
        let mount_error =
            normal_twist(seed, "as_built/camera_mount", spec.camera.mount_std_m, spec.camera.mount_std_rad);
        let link_from_camera: Pose<Link, Camera> =
            Pose::from_isometry(robot.camera.mount.link_from_frame).perturbed(&mount_error);
        let tags = robot.tags.iter().map(|tag| {
            let stream = format!("as_built/tag/{}", tag.id);
            let error = normal_twist(seed, &stream, spec.tags.survey_std_m, spec.tags.survey_std_rad);
            TagAsBuilt { id: tag.id, size_m: tag.size_m, pose: PlainPose::of(&tag.base_from_tag.perturbed(&error)) }
        });
        Self { joints, camera_mount: PlainPose::of(&link_from_camera), tags: tags.collect() }
    }

    /// Where the camera truly hangs.
    pub(super) fn camera_attachment(&self, robot: &Robot) -> Attachment {
        let link_from_camera: Pose<Link, Camera> = self.camera_mount.to_pose();
        Attachment { n_joints: robot.camera.mount.n_joints, link_from_frame: *link_from_camera.isometry() }
    }
}

impl TagAsBuilt {
    #[must_use]
    pub fn base_from_tag(&self) -> Pose<Base, Tag> {
        self.pose.to_pose()
    }
}

impl PlainPose {
    fn of<A: Frame, B: Frame>(pose: &Pose<A, B>) -> Self {
        Self { position_m: pose.origin().to_array(), quaternion_wxyz: pose.quaternion_wxyz() }
    }

    /// The caller names the frames, as the file's key does. A quaternion without direction means no rotation.
    #[must_use]
    pub fn to_pose<A: Frame, B: Frame>(&self) -> Pose<A, B> {
        Pose::from_position_quaternion_wxyz(self.position_m, self.quaternion_wxyz)
            .unwrap_or_else(|| Pose::from_position_rpy(self.position_m, [0.0; 3]))
    }
}

impl JointAsBuilt {
    /// The smooth deviation of the sensor at `angle_rad`, rad.
    #[must_use]
    pub fn nonlinearity_rad(&self, angle_rad: f64) -> f64 {
        let turn = std::f64::consts::TAU * (angle_rad - self.center_rad) / self.range_rad;
        self.harmonics.iter().map(|h| h.amplitude_rad * (h.order * turn + h.phase_rad).sin()).sum()
    }
}

fn draw_joint(robot: &Robot, joint: usize, spec: &WorldSpec, seed: u64) -> JointAsBuilt {
    let limits = robot.chain.joints()[joint].limits;
    let name = &robot.sensors[joint].joint;
    let sensors = &spec.joint_sensors;
    let rng = |effect: &str| stream_rng(seed, &format!("as_built/{effect}/{name}"));
    let mut gain = rng("gain");
    let mut offset = rng("offset");
    let normal = |effect: &str, std: f64| -> f64 {
        let value: f64 = StandardNormal.sample(&mut rng(effect));
        std * value
    };
    let mut built = JointAsBuilt {
        name: name.clone(),
        center_rad: robot.sensors[joint].center_rad,
        // A joint without stops is measured over one turn.
        range_rad: limits.map_or(std::f64::consts::TAU, |l| l.upper_rad - l.lower_rad),
        gain_error: sensors.gain_error_max * gain.random_range(-1.0..=1.0),
        offset_error_rad: sensors.offset_error_max_rad * offset.random_range(-1.0..=1.0),
        temperature_offset_rad_per_k: normal("temperature_offset", sensors.temperature_offset_std_rad_per_k),
        temperature_gain_per_k: normal("temperature_gain", sensors.temperature_gain_std_per_k),
        gear_ratio: spec.gear_ratio.get(name).copied().unwrap_or(1.0),
        harmonics: Vec::new(),
    };
    built.harmonics = draw_harmonics(&built, sensors.nonlinearity_peak, &mut rng("nonlinearity"));
    built
}

/// Two to four harmonics over the range, scaled so that the largest deviation within it is `peak` of the range.
fn draw_harmonics(joint: &JointAsBuilt, peak: f64, rng: &mut impl rand::Rng) -> Vec<Harmonic> {
    const SAMPLES: u32 = 2000;
    let n = rng.random_range(2..=4_u32);
    let raw = (1..=n)
        .map(|order| Harmonic {
            order: f64::from(order),
            amplitude_rad: rng.random_range(0.2..=1.0),
            phase_rad: rng.random_range(0.0..std::f64::consts::TAU),
        })
        .collect();
    let mut unscaled = JointAsBuilt { harmonics: raw, ..joint.clone() };
    let largest = (0..=SAMPLES)
        .map(|i| joint.center_rad + joint.range_rad * (f64::from(i) / f64::from(SAMPLES) - 0.5))
        .map(|angle| unscaled.nonlinearity_rad(angle).abs())
        .fold(f64::MIN_POSITIVE, f64::max);
    for harmonic in &mut unscaled.harmonics {
        harmonic.amplitude_rad *= peak * joint.range_rad / largest;
    }
    unscaled.harmonics
}

/// A small random motion (translation m, rotation rad), independent per axis.
fn normal_twist(seed: u64, stream: &str, std_m: f64, std_rad: f64) -> Vector6<f64> {
    let mut rng = stream_rng(seed, stream);
    let mut draw = |std: f64| Vector3::from_fn(|_, _| std * Distribution::<f64>::sample(&StandardNormal, &mut rng));
    let (translation, rotation) = (draw(std_m), draw(std_rad));
    Vector6::new(translation.x, translation.y, translation.z, rotation.x, rotation.y, rotation.z)
}
