//! Wrong detections are named and counted, and change nothing.

use armcal::calib::{ObservationRejection, associate, calibrate};
use armcal::log::Recording;
use armcal::robot::Robot;
use armcal::routine::Method;
use armcal::stats::stream_rng;
use armcal::streams::{
    CaptureSet, DetectionReject, DetectionRejects, Message, RejectReason, TagDetection, TagDetections,
};

use crate::support::synthetic::{Shot, TrueArm, add_noise};
use crate::support::titan;

/// Views of five frames each, every frame with noise of its own.
fn recording(arm: &TrueArm, shots: &[Shot]) -> Recording {
    let mut recording = arm.recording(shots);
    let mut more = Vec::new();
    let mut rng = stream_rng(1, "frames");
    for (log_time, message) in &recording.messages {
        let Message::Detections(seen) = message else { continue };
        for frame in 1..5 {
            let stamp = seen.stamp.plus_s(0.05 * f64::from(frame));
            let tags: Vec<(u32, [[f64; 2]; 4])> = seen.tags.iter().map(|tag| (tag.id, tag.corners_px)).collect();
            let mut shot = [Shot { set: CaptureSet::Fit, angles: arm.robot.stowed, tags }];
            add_noise(&mut shot, 0.3, &mut rng);
            let [shot] = shot;
            let tags = shot.tags.into_iter();
            let tags = tags.map(|(id, corners_px)| TagDetection { id, corners_px, decision_margin: 60.0 }).collect();
            more.push((*log_time, Message::Detections(TagDetections { stamp, tags })));
        }
    }
    recording.messages.extend(more);
    recording
}

fn site(robot: &Robot) -> (TrueArm<'_>, Vec<Shot>) {
    let mut rng = stream_rng(3, "detections");
    let arm = TrueArm::with_sensor_errors(robot, &mut rng);
    let mut shots = arm.shots(CaptureSet::Fit, 20, &mut rng);
    shots.extend(arm.shots(CaptureSet::HeldOut, 4, &mut rng));
    (arm, shots)
}

/// One frame of every view has two ids exchanged; the result is that without this frame.
#[test]
fn a_misread_id_in_one_frame_of_a_view_changes_nothing() {
    let robot = titan();
    let (arm, shots) = site(&robot);
    let clean = recording(&arm, &shots);
    let (mut misread, mut without) = (clean.clone(), clean.clone());
    let mut n_misread = 0;
    // The first frames of all views come first.
    for (with, without) in misread.messages.iter_mut().zip(&mut without.messages) {
        let (Message::Detections(with), Message::Detections(without)) = (&mut with.1, &mut without.1) else { continue };
        if n_misread < shots.len() {
            let (a, b) = (with.tags[0].id, with.tags[1].id);
            (with.tags[0].id, with.tags[1].id) = (b, a);
            without.tags.drain(..2);
            n_misread += 1;
        }
    }
    let solve = |recording: &Recording| calibrate(recording, &robot, Method::MinimumDistance).expect("calibrated");
    let (with, without) = (solve(&misread), solve(&without));
    assert_eq!(with.joint, without.joint);
    assert_eq!(with.fit.rejected_by_reason["inconsistent_frame"], 48);
    assert_eq!(without.fit.rejected, 0);
    let mut reversed = misread.clone();
    reversed.messages.reverse();
    assert_eq!(solve(&reversed).joint, with.joint, "in any order");
}

#[test]
fn what_the_detector_rejected_in_captured_views_is_counted_by_reason() {
    let robot = titan();
    let (arm, shots) = site(&robot);
    let mut recording = recording(&arm, &shots);
    let frames = recording.messages.iter().filter_map(|(t, m)| match m {
        Message::Detections(seen) => Some((*t, seen.stamp)),
        _ => None,
    });
    let reject = |reason| DetectionReject { id: 9, corners_px: [[5.0; 2]; 4], reason };
    for (k, (log_time, stamp)) in frames.collect::<Vec<_>>().into_iter().enumerate() {
        let mut rejects = vec![reject(RejectReason::WrongBits)];
        rejects.extend((k % 2 == 0).then(|| reject(RejectReason::TooSmall)));
        recording.messages.push((log_time, Message::Rejects(DetectionRejects { stamp, rejects })));
        // A detection between the views belongs to no view.
        let stamp = stamp.plus_s(1.0);
        let rejects = vec![reject(RejectReason::PoorEdges)];
        recording.messages.push((log_time, Message::Rejects(DetectionRejects { stamp, rejects })));
    }
    let rejected = associate(&recording, &robot).rejected;
    assert_eq!(rejected.get(&ObservationRejection::Detector(RejectReason::WrongBits)), Some(&120));
    assert_eq!(rejected.get(&ObservationRejection::Detector(RejectReason::TooSmall)), Some(&60));
    assert_eq!(rejected.len(), 2, "{rejected:?}");
}
