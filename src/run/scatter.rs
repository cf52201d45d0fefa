//! Scatter of a tag's corners from image to image while the arm stands: the camera's noise, measured without truth.

use std::collections::BTreeMap;

use armcal_core::log::Recording;
use armcal_core::streams::{MarkKind, Message};
use armcal_core::time::Stamp;

/// Sums over the images of one tag in one span.
#[derive(Clone, Copy, Default)]
struct Moments {
    n: u32,
    mean: [f64; 8],
    squares: [f64; 8],
}

impl Moments {
    /// Adds an image by Welford's update, which avoids small differences of large sums.
    fn add(&mut self, corners_px: &[[f64; 2]; 4]) {
        self.n += 1;
        for (k, value) in corners_px.as_flattened().iter().enumerate() {
            let from_mean = value - self.mean[k];
            self.mean[k] += from_mean / f64::from(self.n);
            self.squares[k] += from_mean * (value - self.mean[k]);
        }
    }
}

/// Standard deviation of a corner's coordinate about its mean over a capture, over all tags and captures, px; `None`
/// where no tag was seen twice in a capture.
#[must_use]
pub fn corner_scatter_px(recording: &Recording) -> Option<f64> {
    let mut spans: Vec<(Stamp, Stamp)> = Vec::new();
    for (_, message) in &recording.messages {
        if let Message::Mark(mark) = message
            && matches!(mark.kind, MarkKind::Capture { .. })
        {
            spans.push((mark.start, mark.end));
        }
    }
    spans.sort_unstable();
    let mut seen: BTreeMap<(usize, u32), Moments> = BTreeMap::new();
    for (_, message) in &recording.messages {
        let Message::Detections(image) = message else { continue };
        let span = spans.partition_point(|(start, _)| *start <= image.stamp);
        if span == 0 || image.stamp > spans[span - 1].1 {
            continue;
        }
        for tag in &image.tags {
            seen.entry((span, tag.id)).or_default().add(&tag.corners_px);
        }
    }
    let squares: f64 = seen.values().flat_map(|m| m.squares).sum();
    let freedom: u32 = seen.values().map(|m| 8 * (m.n - 1)).sum();
    (freedom > 0).then(|| (squares / f64::from(freedom)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_core::streams::{CaptureSet, Mark, TagDetection, TagDetections};

    fn at(seconds: i64) -> Stamp {
        Stamp { nanos: seconds * 1_000_000_000 }
    }

    fn image(seconds: i64, shift_px: f64) -> (Stamp, Message) {
        let corners_px =
            [[100.0, 100.0], [110.0, 100.0], [110.0, 90.0], [100.0, 90.0]].map(|c| c.map(|v| v + shift_px));
        let tags = vec![TagDetection { id: 3, corners_px, decision_margin: 50.0 }];
        (at(seconds), Message::Detections(TagDetections { stamp: at(seconds), tags }))
    }

    fn recording(messages: Vec<(Stamp, Message)>) -> Recording {
        Recording { path: "r.mcap".into(), messages, joint_names: Vec::new(), ..Default::default() }
    }

    #[test]
    fn scatter_is_that_within_a_capture_alone() {
        let mark = |start, end, pose_idx| {
            let kind = MarkKind::Capture { set: CaptureSet::Fit, pose_idx };
            (at(end), Message::Mark(Mark { start: at(start), end: at(end), kind }))
        };
        // Two captures far apart in the image, each +-1 px about its mean; the distance between them does not count.
        let messages = vec![
            image(11, -1.0),
            image(12, 1.0),
            image(15, 77.0),
            image(21, 49.0),
            image(22, 51.0),
            mark(10, 13, 0),
            mark(20, 23, 1),
        ];
        let scatter = corner_scatter_px(&recording(messages)).expect("seen twice");
        assert!((scatter - 2.0_f64.sqrt()).abs() < 1e-12, "{scatter}");
        assert_eq!(corner_scatter_px(&recording(vec![image(11, 0.0), mark(10, 13, 0)])), None);
        assert_eq!(corner_scatter_px(&recording(Vec::new())), None);
    }
}
