//! Recordings of a real arm's recorder: raw words that wrap, tags as transforms of the camera's frame, and no marks.

use std::path::Path;

use armcal::log::{RecordingHeader, RecordingWriter, RosMessage, ros};
use armcal::robot::Robot;
use armcal::stats::stream_rng;
use armcal::time::{SIMULATION_EPOCH, Stamp};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::synthetic::{TrueArm, normal};

/// One pose with the contents of its two messages. Times in s after the start.
#[derive(Clone, Debug)]
pub struct Pose {
    pub joints_at_s: f64,
    pub tags_at_s: f64,
    /// Joint words as in /joint_states, in any order.
    pub joints: Vec<(String, f64)>,
    /// Tags as (frame, camera_from_tag).
    pub tags: Vec<(String, Isometry3<f64>)>,
}

/// Noise of a synthetic Titan 4's recording.
#[derive(Clone, Copy, Debug)]
pub struct Noise {
    /// Sensors' largest gain error and offset, times the datasheet's bounds (5 %, 5 deg).
    pub sensors: f64,
    /// Rotation noise of a view's camera pose, shared by all its tags, one sigma per axis, rad; as in the paper's own
    /// data.
    pub camera_rad: f64,
    pub camera_m: f64,
    /// Noise of each tag's position by itself, one sigma, m.
    pub tag_m: f64,
}

pub const AS_IN_2018: Noise = Noise { sensors: 1.0, camera_rad: 0.017_453, camera_m: 0.008, tag_m: 0.001 };

/// A Titan 4 before nine landmarks.
pub struct RealTitan {
    pub poses: Vec<Pose>,
    pub landmarks_m: Vec<Vector3<f64>>,
    pub gain: Vec<f64>,
    pub offset_rad: Vec<f64>,
}

fn turned(std_m: f64, std_rad: f64, rng: &mut ChaCha8Rng) -> Isometry3<f64> {
    let mut three = || Vector3::from_fn(|_, _| normal(rng));
    let place = Translation3::from(std_m * three());
    Isometry3::from_parts(place, UnitQuaternion::from_scaled_axis(std_rad * three()))
}

impl RealTitan {
    /// Makes `n` poses; the readings are whole 16-bit words, including the wrist's rotation.
    pub fn new(robot: &Robot, n: usize, noise: Noise, seed: u64) -> Self {
        let mut rng = stream_rng(seed, "real titan");
        let mut arm = TrueArm::with_sensor_errors(robot, &mut rng);
        for (gain, offset_rad) in arm.gain.iter_mut().zip(&mut arm.offset_rad) {
            (*gain, *offset_rad) = (1.0 + noise.sensors * (*gain - 1.0), noise.sensors * *offset_rad);
        }
        let mut place = |low: f64, high: f64| rng.random_range(low..high);
        let landmarks_m: Vec<Vector3<f64>> =
            (0..9).map(|_| Vector3::new(place(0.4, 1.8), place(-0.8, 1.4), place(-1.0, 0.2))).collect();
        let mut poses = Vec::new();
        for k in 0..n {
            let angles = arm.random_angles(&mut rng);
            let counts = arm.counts(&angles);
            let base_from_camera = robot.chain.link_poses(&angles).frame(&robot.camera.mount);
            let seen_from = base_from_camera * turned(noise.camera_m, noise.camera_rad, &mut rng);
            let tags = landmarks_m.iter().enumerate().map(|(id, at)| {
                let in_camera = seen_from.inverse() * Point3::from(*at);
                let off = Vector3::from_fn(|_, _| noise.tag_m * normal(&mut rng));
                let place = Translation3::from(in_camera.coords + off);
                (format!("tag36h11:{id}"), Isometry3::from_parts(place, UnitQuaternion::identity()))
            });
            poses.push(Pose {
                joints_at_s: k as f64,
                tags_at_s: k as f64 + 0.01,
                joints: robot.joint_names().into_iter().zip(counts.iter().map(|c| c.round() % 65536.0)).collect(),
                tags: tags.collect(),
            });
        }
        Self { poses, landmarks_m, gain: arm.gain.clone(), offset_rad: arm.offset_rad.clone() }
    }

    /// The landmarks as a tag map.
    pub fn tag_map(&self) -> String {
        let mut text = "version = 1\nkind = \"tag_map\"\nframe = \"base_link\"\n".to_owned();
        for (id, at) in self.landmarks_m.iter().enumerate() {
            let place: [f64; 3] = (*at).into();
            text += &format!("[[tag]]\nid = {id}\nposition_m = {place:?}\nposition_std_m = [0.001, 0.001, 0.001]\n");
        }
        text
    }
}

/// The lines of [`INPUT_MAP`] that state the noise of [`AS_IN_2018`].
pub const TAG_NOISE: &str = "position_std_m = 0.009\nrotation_std_rad = 0.018\n";
pub const INPUT_MAP: &str = "version = 1\nkind = \"input\"\n\
    [joint_sensors]\ntopic = \"/joint_states\"\n[tags]\ntopic = \"/tf\"\n\
    camera_frame = \"fisheye\"\nchild_frame = \"tag36h11:{id}\"\nuse = \"position\"\n\
    position_std_m = 0.009\nrotation_std_rad = 0.018\n";

pub fn at(seconds: f64) -> Stamp {
    SIMULATION_EPOCH.plus_s(seconds)
}

pub fn header(stamp: Stamp, frame: &str) -> ros::Header {
    let time = ros::Time { sec: (stamp.nanos / 1_000_000_000) as i32, nanosec: (stamp.nanos % 1_000_000_000) as u32 };
    ros::Header { stamp: time, frame_id: frame.into() }
}

pub fn transform(stamp: Stamp, parent: &str, child: &str, pose: &Isometry3<f64>) -> ros::TransformStamped {
    let [x, y, z]: [f64; 3] = pose.translation.vector.into();
    let q = pose.rotation;
    let translation = ros::Vector3 { x, y, z };
    let rotation = ros::Quaternion::from_wxyz([q.w, q.i, q.j, q.k]);
    let transform = ros::Transform { translation, rotation };
    ros::TransformStamped { header: header(stamp, parent), child_frame_id: child.into(), transform }
}

pub fn joint_state(stamp: Stamp, joints: &[(String, f64)]) -> ros::JointState {
    let (name, position) = joints.iter().cloned().unzip();
    ros::JointState { header: header(stamp, ""), name, position, ..Default::default() }
}

/// Writes one message of each topic per pose, in the given order; log times are the stamps.
pub fn write_poses(path: &Path, poses: &[Pose]) {
    let mut writer = RecordingWriter::create(path, RecordingHeader::new(Vec::new())).expect("a file");
    for pose in poses {
        let (now, later) = (at(pose.joints_at_s), at(pose.tags_at_s));
        let joints = joint_state(now, &pose.joints);
        writer.write_ros("/joint_states", &ros::JointState::SCHEMA, now, &joints).expect("written");
        let transforms = pose.tags.iter().map(|(frame, tag)| transform(later, "fisheye", frame, tag)).collect();
        let message = ros::TfMessage { transforms };
        writer.write_ros("/tf", &ros::TfMessage::SCHEMA, later, &message).expect("written");
    }
    writer.finish().expect("finished");
}

/// Writes 50 readings and 10 images per second: one second at rest at each pose, one second on the way to the next.
pub fn write_stream(path: &Path, poses: &[Pose], seed: u64) {
    let mut rng = stream_rng(seed, "stream");
    let mut writer = RecordingWriter::create(path, RecordingHeader::new(Vec::new())).expect("a file");
    for tick in 0..(2 * poses.len() - 1) * 50 {
        let (k, on_the_way) = (tick / 100, ((tick % 100) as f64 - 50.0).max(0.0) / 50.0);
        let now = at(0.02 * tick as f64);
        let next = &poses[(k + 1).min(poses.len() - 1)];
        let joints: Vec<(String, f64)> = poses[k]
            .joints
            .iter()
            .zip(&next.joints)
            .map(|((name, from), (_, to))| {
                let word = from + on_the_way * way(*from, *to) + normal(&mut rng);
                (name.clone(), word.round().rem_euclid(65536.0))
            })
            .collect();
        writer.write_ros("/joint_states", &ros::JointState::SCHEMA, now, &joint_state(now, &joints)).expect("written");
        if tick % 5 == 0 {
            let seen = poses[k].tags.iter().map(|(frame, tag)| transform(now, "fisheye", frame, tag));
            let message = ros::TfMessage { transforms: seen.collect() };
            writer.write_ros("/tf", &ros::TfMessage::SCHEMA, now, &message).expect("written");
        }
    }
    writer.finish().expect("finished");
}

/// Shortest difference from one word to another.
pub fn way(from: f64, to: f64) -> f64 {
    (to - from + 32768.0).rem_euclid(65536.0) - 32768.0
}
