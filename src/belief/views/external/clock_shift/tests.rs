use super::*;
use crate::batch::tests::data::titan;
use armcal_core::input::{ExternalRecording, Reading};
use armcal_core::joints::JointCounts;
use armcal_core::robot::SurveyedTag;
use armcal_core::spatial::Pose;
use armcal_core::stats::stream_rng;
use nalgebra::{Isometry3, Point3, Vector3};
use rand::RngExt;

/// An arm that rests at random poses, with smooth motions between them.
struct Arm {
    robot: Robot,
    poses: Vec<JointAngles>,
}

#[derive(Clone, Copy, PartialEq)]
enum Images {
    AtRest,
    Always,
}

const PERIOD_S: f64 = 2.0;
const MOTION_S: f64 = 0.7;

impl Arm {
    fn new(seed: u64, n_poses: usize) -> Self {
        let robot = titan();
        let mut rng = stream_rng(seed, "poses");
        let near = |j: usize, k: f64| robot.sensors[j].center_rad + k;
        let poses = (0..n_poses)
            .map(|_| JointAngles::from_fn(robot.n_joints(), |j| near(j, rng.random_range(-0.5..0.5))))
            .collect();
        Self { robot, poses }
    }

    fn angles_at(&self, time_s: f64) -> JointAngles {
        let time_s = time_s.clamp(0.0, PERIOD_S * (self.poses.len() - 1) as f64 - 1e-9);
        let k = (time_s / PERIOD_S) as usize;
        let share = ((time_s - PERIOD_S * k as f64) / MOTION_S).min(1.0);
        let (from, to) = (&self.poses[k], &self.poses[k + 1]);
        JointAngles::from_fn(from.len(), |j| from[j] + share * (to[j] - from[j]))
    }

    fn duration_s(&self) -> f64 {
        PERIOD_S * (self.poses.len() - 1) as f64
    }

    /// Readings at 50 Hz; joint `dead` reads its centre.
    fn readings(&self, dead: Option<usize>) -> Vec<Reading> {
        let reading = |k: usize| {
            let angles = self.angles_at(0.02 * k as f64);
            let counts = JointCounts::from_fn(angles.len(), |j| {
                let spec = &self.robot.sensors[j];
                let angle_rad = if dead == Some(j) { spec.center_rad } else { angles[j] };
                (spec.offset_counts + spec.counts_per_rad * angle_rad).round().rem_euclid(spec.wrap_counts)
            });
            Reading { stamp: Stamp::default().plus_s(0.02 * k as f64), counts, digest: [0; 32] }
        };
        (0..(self.duration_s() / 0.02) as usize).map(reading).collect()
    }

    /// Images by a clock that is `late_s` behind; only those at rest, or all.
    fn frames(&self, late_s: f64, images: Images, seed: u64) -> Vec<TagFrame> {
        let mut rng = stream_rng(seed, "tags");
        let times_s = (1..(self.duration_s() / 0.15) as usize).map(|k| 0.15 * k as f64);
        let is_used = |time_s: &f64| images == Images::Always || time_s.rem_euclid(PERIOD_S) > MOTION_S + 0.1;
        let mut frame = |time_s: f64| {
            let camera_from_tags = self.robot.tags_from_camera(&self.angles_at(time_s)).inverse();
            let mut tag = |id: u32, at_m: [f64; 3]| {
                let noise_m = Vector3::from_fn(|_, _| rng.random_range(-2e-3..2e-3));
                let seen = RawMeasurement::Position((camera_from_tags * Point3::from(at_m)).coords + noise_m);
                ExternalDetection { id: Some(id), seen }
            };
            let tags = vec![tag(1, [1.5, 0.4, 0.2]), tag(2, [1.2, -0.6, -0.3])];
            TagFrame { stamp: Stamp::default().plus_s(time_s - late_s), tags, digests: vec![[0; 32]] }
        };
        times_s.filter(is_used).map(&mut frame).collect()
    }
}

fn shift(readings: &[Reading], frames: &[TagFrame], robot: &Robot) -> Option<ClockShift> {
    let recording = ExternalRecording { readings: readings.to_vec(), ..ExternalRecording::default() };
    clock_shift(&TravelSeries::new(&recording, robot, 0.5), frames, robot)
}

#[test]
fn clocks_that_differ_are_found_by_the_motions() {
    let (seed, arm) = (1, Arm::new(1, 40));
    let readings = arm.readings(None);
    for late_s in [3.2, -0.7, 17.0] {
        let found = shift(&readings, &arm.frames(late_s, Images::AtRest, seed), &arm.robot).expect("a shift");
        assert!((found.offset_s - late_s).abs() < 0.2, "{} of {late_s}", found.offset_s);
    }
}

/// Each pose sees a tag of its own: the map decides among the poses.
#[test]
fn tags_that_no_two_poses_share_show_the_offset_by_the_map() {
    for (seed, late_s) in [(5, 3.2), (6, -4.7)] {
        let mut arm = Arm::new(seed, 40);
        let mut rng = stream_rng(seed, "places");
        let mut tag = |k: usize| {
            let place = Vector3::new(1.3, 0.0, 0.0) + Vector3::from_fn(|_, _| rng.random_range(-0.6..0.6));
            let base_from_tag = Pose::from_isometry(Isometry3::translation(place.x, place.y, place.z));
            SurveyedTag { id: k as u32, base_from_tag, ..arm.robot.tags[0].clone() }
        };
        arm.robot.tags = (0..40).map(&mut tag).collect();
        let frames = arm.frames(0.0, Images::AtRest, seed).into_iter().map(|frame| {
            let time_s = frame.stamp.since_s(Stamp::default());
            let tag = &arm.robot.tags[(time_s / PERIOD_S) as usize];
            let camera_from_tags = arm.robot.tags_from_camera(&arm.angles_at(time_s)).inverse();
            let seen = RawMeasurement::Position((camera_from_tags * tag.base_from_tag.isometry()).translation.vector);
            let tags = vec![ExternalDetection { id: Some(tag.id), seen }];
            TagFrame { stamp: frame.stamp.plus_s(-late_s), tags, ..frame }
        });
        let found = shift(&arm.readings(None), &frames.collect::<Vec<_>>(), &arm.robot).expect("a shift");
        assert!((found.offset_s - late_s).abs() < 0.2, "{} of {late_s}", found.offset_s);
    }
}

#[test]
fn the_words_name_the_side_and_the_key() {
    let shift = |offset_s: f64| ClockShift { offset_s, correlation: 0.97, as_stamped: 0.05, n_pairs: 39 }.to_string();
    insta::assert_snapshot!("clock_shift", [3.2, -0.7].map(shift).join("\n"));
}

#[test]
fn clocks_that_agree_and_motions_that_have_nothing_in_common_show_no_offset() {
    for seed in 1..=6 {
        let (arm, other) = (Arm::new(seed, 30), Arm::new(seed + 100, 30));
        for images in [Images::AtRest, Images::Always] {
            for late_s in [0.0, 0.1, -0.15] {
                assert_eq!(shift(&arm.readings(None), &arm.frames(late_s, images, seed), &arm.robot), None);
            }
            let frames = arm.frames(0.0, images, seed);
            assert_eq!(shift(&arm.readings(Some(1)), &frames, &arm.robot), None);
            // The sizes of the motions differ, and so do their times.
            let mut unrelated = other.readings(None);
            let mut rng = stream_rng(seed, "times");
            let mut stamp = Stamp::default();
            for reading in unrelated.chunks_mut(50) {
                let slow: f64 = rng.random_range(0.5..2.0);
                for one in reading {
                    (one.stamp, stamp) = (stamp, stamp.plus_s(0.02 * slow));
                }
            }
            assert_eq!(shift(&unrelated, &frames, &arm.robot), None);
        }
    }
}
