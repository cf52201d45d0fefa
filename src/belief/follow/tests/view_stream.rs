//! Conversion of messages to views.

use crate::batch::tests::data::titan;
use crate::follow::tests::drifting::Dive;
use crate::follow::view_stream::ViewStream;
use crate::views::view::{TagMeasurement, View};
use armcal_core::joints::JointAngles;
use armcal_core::sensor::ArmSensors;
use armcal_core::streams::{JointSensorSample, Message, TagDetection, TagDetections};
use armcal_core::time::SIMULATION_EPOCH;

/// Returns views of sensors that read the same for three seconds, while the camera's images shift by `px_an_image`
/// pixels each.
fn views_at_rest(px_an_image: f64) -> Vec<View> {
    let robot = titan();
    let mut dive = Dive::new(&robot, 1);
    let seen = std::iter::repeat_with(|| dive.view()).find(|view| view.tags.len() > 2).expect("it ends");
    let sensors = ArmSensors::nominal(&robot);
    let center = |j: usize| robot.sensors[j].center_rad;
    let counts = sensors.counts(&JointAngles::from_fn(robot.n_joints(), |j| seen.travel_rad[j] + center(j)));
    let mut stream = ViewStream::new(robot.clone());
    let mut views = Vec::new();
    for k in 0..60 {
        let stamp = SIMULATION_EPOCH.plus_s(0.05 * f64::from(k));
        if k % 4 == 0 {
            let tags = seen.tags.iter().filter_map(|tag| match &tag.measured {
                TagMeasurement::Corners(mean) => {
                    let corners_px = mean.corners_px.map(|[x, y]| [x + px_an_image * f64::from(k / 4), y]);
                    Some(TagDetection { id: tag.id, corners_px, decision_margin: 60.0 })
                }
                _ => None,
            });
            let image = TagDetections { stamp, tags: tags.collect() };
            views.extend(stream.push(stamp, &Message::Detections(image)));
        }
        views.extend(stream.push(stamp, &Message::JointSensors(JointSensorSample { stamp, counts })));
    }
    views.extend(stream.finish());
    views
}

/// A joint with a failed sensor may move while all sensors read the same.
#[test]
fn an_arm_whose_images_move_does_not_rest() {
    assert_eq!(views_at_rest(0.0).len(), 1);
    assert_eq!(views_at_rest(0.2).len(), 1, "noise and settling");
    assert_eq!(views_at_rest(2.0).len(), 0);
}
