//! Recordings of an arm with known errors, made without the estimator's code: readings by the datasheet's formula,
//! pixels by a separate projection. Only the forward kinematics is the library's; Pinocchio verifies it (`oracle`).

use armcal::calib::Calibration;
use armcal::kinematics::Attachment;
use armcal::log::Recording;
use armcal::optics::CameraModel;
use armcal::robot::Robot;
use armcal::stats::{quantile, stream_rng};
use armcal::streams::{
    CaptureSet, JointAngles, JointCounts, JointSensorSample, Mark, MarkKind, Message, ReachTask, TagDetection,
    TagDetections,
};
use armcal::time::{SIMULATION_EPOCH, Stamp};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Number of the first joints, which move the wrist camera.
pub const N_SEEN: usize = 5;

/// The true arm: `theta = center + gain travel + offset + curve(travel)`, travel by the datasheet.
#[derive(Clone, Debug)]
pub struct TrueArm<'a> {
    pub robot: &'a Robot,
    pub gain: Vec<f64>,
    pub offset_rad: Vec<f64>,
    /// Nonlinearity beyond gain and offset; zero for straight sensors.
    pub curve: Vec<Curve>,
    pub camera: Attachment,
    pub base_from_tag: Vec<Isometry3<f64>>,
    /// Pose of the tag on the gripper, on the last link.
    pub link_from_gripper_tag: Option<Isometry3<f64>>,
}

/// One standing arm and the tags that its camera saw, as (id, corners).
#[derive(Clone, Debug)]
pub struct Shot {
    pub set: CaptureSet,
    pub angles: JointAngles,
    pub tags: Vec<(u32, [[f64; 2]; 4])>,
}

pub fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

fn normal3(rng: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| normal(rng))
}

/// A smooth curve over a joint's range, rad: waves whose sum is a Gaussian process with a squared exponential
/// covariance of length 0.16 half ranges (Solin and Sarkka 2020, eqs. 6 and 8), as docs/theory/bundle.md has it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Curve([f64; 12]);

impl Curve {
    const DOMAIN: f64 = 1.25;
    const LENGTH: f64 = 0.16;

    fn draw(std_rad: f64, rng: &mut ChaCha8Rng) -> Self {
        let turn = std::f64::consts::PI / (2.0 * Self::DOMAIN);
        Self(std::array::from_fn(|k| {
            let w = turn * (k + 1) as f64;
            let spectral = std::f64::consts::TAU.sqrt() * Self::LENGTH * (-0.5 * (Self::LENGTH * w).powi(2)).exp();
            std_rad * spectral.sqrt() * normal(rng)
        }))
    }

    /// Value at `x` half ranges from the middle; constant beyond the range.
    fn at(&self, x: f64) -> f64 {
        let turn = std::f64::consts::PI * (x.clamp(-1.0, 1.0) + Self::DOMAIN) / (2.0 * Self::DOMAIN);
        let wave = |(k, by): (usize, &f64)| by * (turn * (k + 1) as f64).sin() / Self::DOMAIN.sqrt();
        self.0.iter().enumerate().map(wave).sum()
    }
}

impl<'a> TrueArm<'a> {
    /// An arm with gains, offsets and curves drawn from robot.toml's sensors.
    pub fn as_its_datasheet(robot: &'a Robot, rng: &mut ChaCha8Rng) -> Self {
        let mut arm = Self::with_sensor_errors(robot, rng);
        for (j, spec) in robot.sensors.iter().enumerate() {
            arm.gain[j] = 1.0 + spec.gain_std * normal(rng);
            arm.offset_rad[j] = spec.offset_std_rad * normal(rng);
            arm.curve[j] = Curve::draw(spec.linearity_std_rad, rng);
        }
        arm
    }

    /// An arm with gains within 5 %, offsets within 5 deg, and all else nominal.
    pub fn with_sensor_errors(robot: &'a Robot, rng: &mut ChaCha8Rng) -> Self {
        Self {
            robot,
            gain: (0..robot.n_joints()).map(|_| 1.0 + rng.random_range(-0.05..0.05)).collect(),
            offset_rad: (0..robot.n_joints()).map(|_| rng.random_range(-0.0873..0.0873)).collect(),
            curve: vec![Curve::default(); robot.n_joints()],
            camera: robot.camera.mount,
            base_from_tag: robot.tags.iter().map(|tag| *tag.base_from_tag.isometry()).collect(),
            link_from_gripper_tag: robot.gripper_tag.map(|tag| tag.mount.link_from_frame),
        }
    }

    /// Moves camera and tags off their nominal poses by robot.toml's standard deviations.
    pub fn misplace(&mut self, rng: &mut ChaCha8Rng) {
        let camera = &self.robot.camera;
        self.camera.link_from_frame *= small_motion(camera.mount_std_m, camera.mount_std_rad, rng);
        for (tag, surveyed) in self.base_from_tag.iter_mut().zip(&self.robot.tags) {
            *tag *= small_motion(surveyed.position_std_m, surveyed.rotation_std_rad, rng);
        }
        if let (Some(tag), Some(drawn)) = (&mut self.link_from_gripper_tag, &self.robot.gripper_tag) {
            *tag *= small_motion(drawn.position_std_m, drawn.rotation_std_rad, rng);
        }
    }

    /// Turns the last joint of every shot at random within `range_rad` of zero, and adds the tag on the gripper.
    pub fn see_gripper_tag(&self, shots: &mut [Shot], range_rad: f64, rng: &mut ChaCha8Rng) {
        let (tag, built) = self.robot.gripper_tag.zip(self.link_from_gripper_tag).expect("a tag on the gripper");
        let h = 0.5 * tag.size_m;
        for shot in shots {
            let last = self.robot.n_joints() - 1;
            shot.angles[last] = rng.random_range(-range_rad..range_rad);
            let poses = self.robot.chain.link_poses(&shot.angles);
            let camera_from_tag = poses.frame(&self.camera).inverse() * poses.link(last + 1) * built;
            let corners = [[-h, -h], [h, -h], [h, h], [-h, h]];
            let seen =
                corners.map(|[x, y]| pixel(&self.robot.camera.lens, &(camera_from_tag * Point3::new(x, y, 0.0))));
            if let [Some(a), Some(b), Some(c), Some(d)] = seen {
                shot.tags.push((tag.id, [a, b, c, d]));
            }
        }
    }

    /// The raw words at true `angles`: `raw = offset_counts + scale * angle`, not rounded.
    pub fn counts(&self, angles: &JointAngles) -> JointCounts {
        JointCounts::from_fn(angles.len(), |j| {
            let spec = &self.robot.sensors[j];
            let straight_rad = angles[j] - spec.center_rad - self.offset_rad[j];
            let mut travel_rad = straight_rad / self.gain[j];
            // The curve's slope is a hundredth of the line's: each round gains two digits.
            for _ in 0..if self.curve[j].0 == [0.0; 12] { 0 } else { 10 } {
                travel_rad = (straight_rad - self.curve[j].at(travel_rad / spec.half_range_rad)) / self.gain[j];
            }
            (spec.offset_counts + spec.counts_per_rad * (spec.center_rad + travel_rad)).rem_euclid(spec.wrap_counts)
        })
    }

    /// Corners of a tag as the camera at true `angles` sees them; `None` if it does not see all.
    pub fn corners(&self, angles: &JointAngles, tag_idx: usize) -> Option<[[f64; 2]; 4]> {
        let camera_from_base = self.robot.chain.link_poses(angles).frame(&self.camera).inverse();
        let camera_from_tag = camera_from_base * self.base_from_tag[tag_idx];
        let center = camera_from_tag.translation.vector;
        let facing = -(camera_from_tag.rotation * Vector3::z()).dot(&center) / center.norm();
        if !(0.25..2.0).contains(&center.norm()) || facing < 0.45 {
            return None;
        }
        let h = 0.5 * self.robot.tags[tag_idx].size_m;
        let mut corners = [[0.0; 2]; 4];
        for (corner, [x, y]) in corners.iter_mut().zip([[-h, -h], [h, -h], [h, h], [-h, h]]) {
            *corner = pixel(&self.robot.camera.lens, &(camera_from_tag * Point3::new(x, y, 0.0)))?;
        }
        Some(corners)
    }

    /// `n` random poses that see three tags or more.
    pub fn shots(&self, set: CaptureSet, n: usize, rng: &mut ChaCha8Rng) -> Vec<Shot> {
        let mut shots = Vec::new();
        while shots.len() < n {
            let angles = self.random_angles(rng);
            let tags: Vec<_> = (0..self.robot.tags.len())
                .filter_map(|idx| Some((self.robot.tags[idx].id, self.corners(&angles, idx)?)))
                .collect();
            if tags.len() >= 3 {
                shots.push(Shot { set, angles, tags });
            }
        }
        shots
    }

    /// Random angles, uniform within the limits; the last joint moves neither camera nor tool point and stays.
    pub fn random_angles(&self, rng: &mut ChaCha8Rng) -> JointAngles {
        JointAngles::from_fn(self.robot.n_joints(), |j| {
            self.robot.chain.joints()[j].limits.map_or(0.0, |l| rng.random_range(l.lower_rad..l.upper_rad))
        })
    }

    /// The messages of `shots`: readings, one image and a mark each, after the task.
    pub fn messages(&self, shots: &[Shot]) -> Vec<(Stamp, Message)> {
        let task = ReachTask {
            stamp: SIMULATION_EPOCH,
            targets_m: vec![[0.500, 1.620, 0.323], [1.242, -0.887, 0.457], [0.595, -0.966, -0.015]],
            tolerance_m: 0.05,
            poses: Vec::new(),
        };
        let mut messages = vec![(SIMULATION_EPOCH, Message::Task(task))];
        for (k, shot) in shots.iter().enumerate() {
            let start = SIMULATION_EPOCH.plus_s(2.0 * (k + 1) as f64);
            let (stamp, end) = (start.plus_s(0.2), start.plus_s(0.5));
            let counts = self.counts(&shot.angles);
            messages.push((stamp, Message::JointSensors(JointSensorSample { stamp, counts })));
            let tags = shot.tags.iter().map(|&(id, corners_px)| TagDetection { id, corners_px, decision_margin: 60.0 });
            messages.push((stamp, Message::Detections(TagDetections { stamp, tags: tags.collect() })));
            let kind = MarkKind::Capture { set: shot.set, pose_idx: k as u32 };
            messages.push((end, Message::Mark(Mark { start, end, kind })));
        }
        messages
    }

    pub fn recording(&self, shots: &[Shot]) -> Recording {
        Recording {
            path: "synthetic.mcap".into(),
            messages: self.messages(shots),
            joint_names: self.robot.joint_names(),
            ..Default::default()
        }
    }
}

/// Distances of the estimated tool from the true one, over poses in the whole range.
#[derive(Clone, Copy, Debug)]
pub struct ToolFigures {
    /// Median distance, m.
    pub error_m: f64,
    pub predicted_m: f64,
    /// Mean of the squared error over its covariance; 3 if the covariance is right.
    pub nees: f64,
}

impl TrueArm<'_> {
    pub fn tool_figures(&self, calibration: &Calibration) -> ToolFigures {
        let tool =
            |angles: &JointAngles| self.robot.chain.link_poses(angles).frame(&self.robot.tool.mount).translation.vector;
        let sensors = calibration.sensors(self.robot).expect("made for this robot");
        let covariance = calibration.parameter_covariance(self.robot);
        let mut rng = stream_rng(0, "test angles");
        let poses: Vec<JointAngles> = (0..40).map(|_| self.random_angles(&mut rng)).collect();
        let (mut errors_m, mut predicted_m, mut nees) = (Vec::new(), Vec::new(), 0.0);
        for angles in &poses {
            let believed = sensors.angles(&self.counts(angles));
            let error = tool(&believed) - tool(angles);
            let predicted = covariance.tool_position_m2(self.robot, &sensors, &believed);
            nees += error.dot(&(predicted.try_inverse().expect("a covariance") * error)) / poses.len() as f64;
            errors_m.push(error.norm());
            predicted_m.push(predicted.trace().sqrt());
        }
        let [error_m, predicted_m] = [errors_m, predicted_m].map(|values| quantile(&values, 0.5).expect("poses"));
        ToolFigures { error_m, predicted_m, nees }
    }
}

/// Adds pixel noise to every corner coordinate.
pub fn add_noise(shots: &mut [Shot], std_px: f64, rng: &mut ChaCha8Rng) {
    for value in shots.iter_mut().flat_map(|s| &mut s.tags).flat_map(|(_, corners)| corners.as_flattened_mut()) {
        *value += std_px * normal(rng);
    }
}

pub fn small_motion(std_m: f64, std_rad: f64, rng: &mut ChaCha8Rng) -> Isometry3<f64> {
    let translation = Translation3::from(std_m * normal3(rng));
    Isometry3::from_parts(translation, UnitQuaternion::from_scaled_axis(std_rad * normal3(rng)))
}

/// Pixel by Kannala-Brandt in polar form; `None` beyond 1.25 rad of the axis and within 10 px of the border.
pub fn pixel(lens: &CameraModel, p: &Point3<f64>) -> Option<[f64; 2]> {
    let theta = p.x.hypot(p.y).atan2(p.z);
    let [.., k1, k2, k3, k4] = lens.intrinsics();
    let radius = theta + k1 * theta.powi(3) + k2 * theta.powi(5) + k3 * theta.powi(7) + k4 * theta.powi(9);
    let azimuth = p.y.atan2(p.x);
    let u = lens.center_px()[0] + lens.focal_px()[0] * radius * azimuth.cos();
    let v = lens.center_px()[1] + lens.focal_px()[1] * radius * azimuth.sin();
    let [width, height] = lens.resolution_px().map(f64::from);
    (theta < 1.25 && (10.0..width - 10.0).contains(&u) && (10.0..height - 10.0).contains(&v)).then_some([u, v])
}
