//! One detection per id: repeated detections of a tag are merged, an id at two positions is rejected.

use crate::decoder::Candidate;
use crate::detection::{DetectedTag, ImageDetections};
use crate::gates::are_nested;
use armcal_core::streams::{DetectionReject, RejectReason, TagDetection};

/// A tag, or the reason for its rejection with the corners before the fit.
pub(crate) type Refined = Result<DetectedTag, (RejectReason, [[f64; 2]; 4])>;

/// Returns true if a candidate is the same tag as id `id` at `corners_px`.
pub(crate) fn is_same_tag(candidate: &Candidate, id: u32, corners_px: &[[f64; 2]; 4]) -> bool {
    id == candidate.id && are_nested(corners_px, &candidate.corners_px)
}

/// Adds a candidate's result. An accepted tag replaces a rejected candidate; of two rejected candidates the first
/// stays.
pub(crate) fn add_or_replace(out: &mut ImageDetections, candidate: &Candidate, refined: Refined) {
    let previous_reject = out.rejects.iter().position(|r| is_same_tag(candidate, r.id, &r.corners_px));
    match (refined, previous_reject) {
        (Ok(tag), previous) => {
            previous.map(|k| out.rejects.remove(k));
            out.tags.push(tag);
        }
        (Err((reason, corners_px)), None) => {
            out.rejects.push(DetectionReject { id: candidate.id, corners_px, reason });
        }
        (Err(_), Some(_)) => {}
    }
}

/// Rejects every tag of an id that is at two positions. Of two detections of one tag, that of the larger margin stays.
pub(crate) fn reject_duplicate_ids(out: &mut ImageDetections) {
    let mut kept: Vec<DetectedTag> = Vec::with_capacity(out.tags.len());
    let mut duplicate_ids: Vec<u32> = Vec::new();
    for tag in out.tags.drain(..) {
        let corners_px = tag.detection.corners_px;
        let other = kept.iter_mut().find(|other| other.detection.id == tag.detection.id);
        match other {
            None => kept.push(tag),
            Some(other) if are_nested(&other.detection.corners_px, &corners_px) => {
                if tag.detection.decision_margin > other.detection.decision_margin {
                    *other = tag;
                }
            }
            Some(_) => {
                let id = tag.detection.id;
                duplicate_ids.push(id);
                out.rejects.push(DetectionReject { id, corners_px, reason: RejectReason::SeenTwice });
            }
        }
    }
    for tag in kept {
        let TagDetection { id, corners_px, .. } = tag.detection;
        if duplicate_ids.contains(&id) {
            out.rejects.push(DetectionReject { id, corners_px, reason: RejectReason::SeenTwice });
        } else {
            out.tags.push(tag);
        }
    }
    out.tags.sort_by_key(|tag| tag.detection.id);
    out.rejects.sort_by(|a, b| a.id.cmp(&b.id).then(a.corners_px[0][0].total_cmp(&b.corners_px[0][0])));
}
