//! Tag corners against the truth.

use std::collections::BTreeMap;

use armcal::robot::{Hull, Part, PlacedShape, Shape};
use armcal::sim::WorldSpec;
use armcal::streams::{Arm, Message};
use nalgebra::Isometry3;

use super::{Site, Tape, Witness};

/// Corners agree with the true camera and the true tags, within the noise; stamps have the clock's delay.
#[test]
fn corners_fall_where_the_truth_puts_them() {
    let site = Site::titan();
    let mut world = site.world(WorldSpec::default(), 2);
    let witness = Witness::default();
    world.set_truth_sink(Box::new(witness.clone())).expect("accepted");
    let mut tape = Tape::default();
    tape.run(&mut world, 40.0);
    let header = witness.header.borrow().clone().expect("a header");
    let states = witness.states.borrow();
    let (mut squares, mut n, mut late) = (0.0, 0.0, Vec::new());
    let mut image = 0;
    for (_, message) in &tape.messages {
        let Message::Detections(detections) = message else { continue };
        image += 1;
        // Images at 5 Hz coincide with every tenth state of 50 Hz.
        let state = &states[image * 10 - 1];
        late.push(detections.stamp.since_s(state.stamp));
        for tag in &detections.tags {
            let built = header.as_built.tags.iter().find(|t| t.id == tag.id).expect("a known tag");
            let camera_from_tag = state.base_from_camera.inverse() * built.base_from_tag();
            for (corner, pixel) in armcal::optics::square_corners(built.size_m).iter().zip(&tag.corners_px) {
                let predicted =
                    site.robot.camera.lens.project(&(camera_from_tag.isometry() * corner).coords).expect("in view");
                squares += (predicted - nalgebra::Vector2::from(*pixel)).norm_squared();
                n += 2.0;
            }
        }
    }
    let rms = (squares / n).sqrt();
    let mean_late = late.iter().sum::<f64>() / late.len() as f64;
    eprintln!("corner rms {rms:.3} px over {n} coordinates, stamps {:.1} ms late", mean_late * 1e3);
    assert!(n > 5000.0, "tags are in view when stowed");
    assert!((0.25..0.5).contains(&rms), "0.3 px, somewhat more for far and oblique tags: {rms}");
    // The mean of 5 ms jitter over 200 images has a standard deviation of 0.35 ms.
    assert!((mean_late - 0.020).abs() < 0.0015, "{mean_late}");
}

#[test]
fn about_two_percent_of_the_tags_are_missed() {
    let site = Site::titan();
    let mut world = site.world(WorldSpec::default(), 3);
    let mut tape = Tape::default();
    tape.run(&mut world, 60.0);
    let mut seen: BTreeMap<u32, usize> = BTreeMap::new();
    let mut images = 0;
    for (_, message) in &tape.messages {
        if let Message::Detections(detections) = message {
            images += 1;
            assert!(detections.tags.windows(2).all(|pair| pair[0].id < pair[1].id), "by id");
            for tag in &detections.tags {
                *seen.entry(tag.id).or_default() += 1;
            }
        }
    }
    // Tags that are visible throughout.
    let steady: Vec<usize> = seen.values().copied().filter(|n| *n > images * 9 / 10).collect();
    assert!(steady.len() >= 3, "{seen:?}");
    let missed = 1.0 - steady.iter().sum::<usize>() as f64 / (steady.len() * images) as f64;
    eprintln!("{:.2} % missed of {steady:?}", missed * 100.0);
    // A rate of 2 % over about 1500 views has a standard deviation of 0.4 %.
    assert!((missed - 0.02).abs() < 0.013, "{missed}");
}

fn last_tags(tape: &Tape) -> Vec<u32> {
    let last = tape.messages.iter().rev().find_map(|(_, m)| match m {
        Message::Detections(detections) => Some(detections.tags.iter().map(|tag| tag.id).collect()),
        _ => None,
    });
    last.expect("an image")
}

/// With the camera driven aside, the arm, the image's edge or their own back hide tags.
#[test]
fn tags_behind_the_camera_are_not_seen() {
    let site = Site::titan();
    let mut world = site.world(WorldSpec::default(), 3);
    let mut target = site.robot.stowed;
    target[0] = 0.3;
    world.command(&site.nominal_counts(&target)).expect("accepted");
    let mut tape = Tape::default();
    tape.run(&mut world, 12.0);
    assert!(last_tags(&tape).len() < 4, "{:?}", last_tags(&tape));
}

/// A plate before the lens hides every tag, although each would be in view.
#[test]
fn nothing_is_seen_through_an_obstacle() {
    let mut site = Site::titan();
    // With exact joint sensors the camera is at its nominal pose, close behind the plate.
    let mut spec = WorldSpec::default();
    spec.camera.miss_probability = 0.0;
    spec.joint_sensors.gain_error_max = 0.0;
    spec.joint_sensors.offset_error_max_rad = 0.0;
    let mut free = Tape::default();
    free.run(&mut site.world(spec.clone(), 3), 0.5);
    assert!(last_tags(&free).len() >= 5, "{:?}", last_tags(&free));

    let base_from_camera = site.robot.chain.link_poses(&site.robot.stowed).frame(&site.robot.camera.mount);
    let world_from_camera = site.vehicle.vehicle_from_base.isometry() * base_from_camera;
    // The plate fits between lens and gripper, as a box and as a mesh.
    let corners = [-0.065, 0.065].map(|x| [-0.065, 0.065].map(|y| [-0.001, 0.001].map(|z| [x, y, z])));
    let hull = Hull::new(corners.as_flattened().as_flattened()).expect("a plate");
    for shape in [Shape::Box { size_m: [0.13, 0.13, 0.002] }, Shape::Hull(hull)] {
        let plate = PlacedShape {
            owner_from_shape: world_from_camera * Isometry3::translation(0.0, 0.0, 0.02),
            shape,
            color_rgb: [0; 3],
        };
        site.scene.obstacles = vec![Part { name: "plate".into(), placed: plate }];
        let mut hidden = Tape::default();
        hidden.run(&mut site.world(spec.clone(), 3), 0.5);
        assert!(last_tags(&hidden).is_empty(), "{:?}", last_tags(&hidden));
    }
}
