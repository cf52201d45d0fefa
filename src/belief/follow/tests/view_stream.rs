//! From messages to views.

use crate::batch::tests::data::titan;
use crate::follow::tests::drifting::Dive;
use crate::follow::view_stream::{ViewStream, is_moving};
use crate::views::view::{TagMeasurement, View};
use armcal_core::joints::JointAngles;
use armcal_core::robot::Robot;
use armcal_core::sensor::ArmSensors;
use armcal_core::streams::{JointSensorSample, Message, TagDetection, TagDetections};
use armcal_core::time::SIMULATION_EPOCH;

/// An image every 0.2 s of what was seen at the first rest, moved on by so many pixels an image.
struct Stream {
    robot: Robot,
    seen: View,
    stream: ViewStream,
    n_samples: i32,
    views: Vec<View>,
}

impl Stream {
    fn new() -> Self {
        let robot = titan();
        let mut dive = Dive::new(&robot, 1);
        let seen = std::iter::repeat_with(|| dive.view()).find(|view| view.tags.len() > 2).expect("it ends");
        Self { seen, stream: ViewStream::new(robot.clone()), n_samples: 0, views: Vec::new(), robot }
    }

    /// For `seconds`, with the first joint moving at `rate_rad_s`.
    fn push(&mut self, seconds: f64, rate_rad_s: f64, px_an_image: f64) {
        let sensors = ArmSensors::nominal(&self.robot);
        for _ in 0..(20.0 * seconds).round() as usize {
            let k = self.n_samples;
            let stamp = SIMULATION_EPOCH.plus_s(0.05 * f64::from(k));
            self.seen.travel_rad[0] += 0.05 * rate_rad_s;
            if k % 4 == 0 {
                let tags = self.seen.tags.iter().filter_map(|tag| match &tag.measured {
                    TagMeasurement::Corners(mean) => {
                        let corners_px = mean.corners_px.map(|[x, y]| [x + px_an_image * f64::from(k / 4), y]);
                        Some(TagDetection { id: tag.id, corners_px, decision_margin: 60.0 })
                    }
                    _ => None,
                });
                let image = TagDetections { stamp, tags: tags.collect() };
                self.views.extend(self.stream.push(stamp, &Message::Detections(image)));
            }
            let angle = |j: usize| self.seen.travel_rad[j] + self.robot.sensors[j].center_rad;
            let counts = sensors.counts(&JointAngles::from_fn(self.robot.n_joints(), angle));
            let sample = JointSensorSample { stamp, counts };
            self.views.extend(self.stream.push(stamp, &Message::JointSensors(sample)));
            self.n_samples += 1;
        }
    }

    fn finish(mut self) -> Vec<View> {
        self.views.extend(self.stream.finish());
        self.views
    }
}

fn views_at_rest(px_an_image: f64) -> Vec<View> {
    let mut stream = Stream::new();
    stream.push(3.0, 0.0, px_an_image);
    stream.finish()
}

/// Nobody marks them, and tags are in sight all the time.
#[test]
fn each_short_rest_between_motions_is_a_view_and_views_come_in_the_order_of_time() {
    let mut stream = Stream::new();
    for rate_rad_s in [0.25, -0.25, 0.25] {
        stream.push(3.0, 0.0, 0.0);
        stream.push(2.0, rate_rad_s, 0.0);
    }
    let views = stream.finish();
    let (moving, resting): (Vec<&View>, Vec<&View>) = views.iter().partition(|view| is_moving(view));
    assert_eq!(resting.len(), 3, "{:?}", resting.iter().map(|view| view.end).collect::<Vec<_>>());
    assert!(moving.len() >= 4, "{}", moving.len());
    assert!(views.is_sorted_by_key(|view| view.end));
    assert!(resting.iter().all(|view| view.n_readings > 40));
}

/// A joint whose sensor has failed may move on while all sensors read the same.
#[test]
fn an_arm_whose_images_move_does_not_rest() {
    assert_eq!(views_at_rest(0.0).len(), 1);
    assert_eq!(views_at_rest(0.2).len(), 1, "noise and settling");
    assert_eq!(views_at_rest(2.0).len(), 0);
}
