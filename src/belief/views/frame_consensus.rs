//! Selection of the frames of one view that agree about a tag.
//!
//! The arm stands still, so that a tag's corners change only by noise. A detector that misreads an id in one frame
//! assigns another tag's corners to this id. The mean of all frames would then be off by a share of the distance
//! between the two tags. A frame that repeats another's numbers is the same image delivered twice: it adds no
//! information.

use crate::views::constants::frame_consensus::{CLOSE_SIGMAS, ELSEWHERE_SIGMAS, USUAL_DISTANCES};
use crate::views::view::MeanCorners;

/// Corners of one tag in one frame, px.
type Corners = [[f64; 2]; 4];

/// Returns the mean over the frames that agree, and the number of the others; no mean if fewer than half agree.
///
/// Frames agree if they lie within a gate of one of them, in every coordinate; the largest such set counts. If all
/// frames lie within ten sigma (`corner_std_px`, per coordinate) of each other, none is rejected.
pub(crate) fn agreeing_mean(frames: &[Corners], corner_std_px: f64) -> (Option<MeanCorners>, usize) {
    if spread_px(frames) <= CLOSE_SIGMAS * corner_std_px {
        return (mean(frames.iter()), 0);
    }
    let gate_px = gate_px(frames, corner_std_px);
    let near = |center: Corners| frames.iter().filter(move |frame| distance_px(&center, frame) <= gate_px);
    // The tightest of equally large sets wins, regardless of their order.
    let rank = |center: Corners| {
        let sum_px: f64 = near(center).map(|frame| distance_px(&center, frame)).sum();
        (near(center).count(), -sum_px)
    };
    let best = frames.iter().copied().max_by(|&a, &b| {
        let ((n_a, tight_a), (n_b, tight_b)) = (rank(a), rank(b));
        n_a.cmp(&n_b).then(tight_a.total_cmp(&tight_b))
    });
    match best.filter(|&center| 2 * near(center).count() > frames.len()) {
        Some(center) => (mean(near(center)), frames.len() - near(center).count()),
        None => (None, frames.len()),
    }
}

/// Returns the largest distance between frames that show the same tag, px.
fn gate_px(frames: &[Corners], corner_std_px: f64) -> f64 {
    let mut to_next: Vec<f64> = (0..frames.len())
        .map(|k| {
            let others = frames.iter().enumerate().filter(|(other, _)| *other != k);
            others.map(|(_, other)| distance_px(&frames[k], other)).fold(f64::INFINITY, f64::min)
        })
        .collect();
    to_next.sort_unstable_by(f64::total_cmp);
    let usual_px = to_next.get(frames.len() / 2).copied().unwrap_or(0.0);
    (USUAL_DISTANCES * usual_px).clamp(CLOSE_SIGMAS * corner_std_px, ELSEWHERE_SIGMAS * corner_std_px)
}

fn distance_px(a: &Corners, b: &Corners) -> f64 {
    a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Returns the largest range of any coordinate, px.
fn spread_px(frames: &[Corners]) -> f64 {
    let range = |corner: usize, axis: usize| {
        let values = frames.iter().map(|frame| frame[corner][axis]);
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        high - low
    };
    (0..4).flat_map(|corner| [range(corner, 0), range(corner, 1)]).fold(0.0, f64::max)
}

fn mean<'a>(frames: impl Iterator<Item = &'a Corners>) -> Option<MeanCorners> {
    let frames = different(frames);
    let (mut sums, mut n_frames) = ([[0.0; 2]; 4], 0);
    for frame in &frames {
        for (sum, value) in sums.iter_mut().flatten().zip(frame.iter().flatten()) {
            *sum += value;
        }
        n_frames += 1;
    }
    let corners_px = sums.map(|corner| corner.map(|sum: f64| sum / n_frames as f64));
    let squares = frames.iter().map(|frame| {
        let pairs = frame.iter().flatten().zip(corners_px.iter().flatten());
        pairs.map(|(value, mean)| (value - mean).powi(2)).sum::<f64>()
    });
    let scatter_px2 = squares.sum();
    (n_frames > 0).then_some(MeanCorners { corners_px, n_frames, scatter_px2 })
}

/// Returns the frames without exact repetitions.
pub(crate) fn different<'a, Points: Copy + PartialEq + 'a>(frames: impl Iterator<Item = &'a Points>) -> Vec<Points> {
    frames.fold(Vec::new(), |mut different, frame| {
        if !different.contains(frame) {
            different.push(*frame);
        }
        different
    })
}

#[cfg(test)]
mod tests {
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use armcal_core::stats::stream_rng;

    const STD_PX: f64 = 0.3;

    fn frames(n: usize, at_px: f64, std_px: f64, seed: u64) -> Vec<Corners> {
        let mut rng = stream_rng(seed, "frames");
        let mut coordinate = |v: f64| v + std_px * Distribution::<f64>::sample(&StandardNormal, &mut rng);
        let corners = [[0.0, 0.0], [40.0, 0.0], [40.0, 40.0], [0.0, 40.0]];
        (0..n).map(|_| corners.map(|corner| corner.map(|v| coordinate(v + at_px)))).collect()
    }

    #[test]
    fn noise_alone_leaves_no_frame_out_up_to_five_times_what_is_known() {
        for seed in 0..400 {
            for (std_px, n) in [(STD_PX, 5), (STD_PX, 50), (5.0 * STD_PX, 5), (5.0 * STD_PX, 50)] {
                let all = frames(n, 300.0, std_px, seed);
                let (seen, n_apart) = agreeing_mean(&all, STD_PX);
                assert_eq!((seen.expect("a mean").n_frames, n_apart), (n, 0), "seed {seed}, {std_px} px");
            }
        }
    }

    #[test]
    fn a_misread_frame_moves_nothing_in_any_order() {
        for seed in 0..100 {
            let good = frames(5, 300.0, STD_PX, seed);
            let clean = agreeing_mean(&good, STD_PX).0.expect("a mean").corners_px;
            for away_px in [8.0, 60.0, 700.0] {
                for place in 0..=good.len() {
                    let mut all = good.clone();
                    all.insert(place, frames(1, 300.0 + away_px, STD_PX, seed + 1000)[0]);
                    let (seen, n_apart) = agreeing_mean(&all, STD_PX);
                    let seen = seen.expect("a mean");
                    assert_eq!(n_apart, 1, "seed {seed}: {away_px} px away at {place}");
                    assert!(distance_px(&seen.corners_px, &clean) < 1e-9);
                }
            }
        }
    }

    /// A camera that stands still delivers the same image again, without noise: it adds no information to the first
    /// frame.
    #[test]
    fn an_image_that_is_delivered_again_counts_once() {
        let once = frames(5, 300.0, STD_PX, 1);
        let again: Vec<Corners> = once.iter().flat_map(|frame| [*frame; 4]).collect();
        let [alone, repeated] = [&once, &again].map(|frames| agreeing_mean(frames, STD_PX).0.expect("a mean"));
        assert_eq!((repeated.n_frames, repeated.corners_px), (5, alone.corners_px));
        assert_eq!(repeated.scatter_px2, alone.scatter_px2);
        let frozen = agreeing_mean(&[once[0]; 40], STD_PX).0.expect("a mean");
        assert_eq!((frozen.n_frames, frozen.scatter_px2), (1, 0.0));
    }

    #[test]
    fn without_a_majority_no_frame_is_believed() {
        let mut split = frames(2, 300.0, STD_PX, 1);
        split.extend(frames(2, 400.0, STD_PX, 2));
        assert!(matches!(agreeing_mean(&split, STD_PX), (None, 4)));
        let two = [frames(1, 0.0, STD_PX, 3)[0], frames(1, 90.0, STD_PX, 4)[0]];
        assert!(matches!(agreeing_mean(&two, STD_PX), (None, 2)));
        assert!(agreeing_mean(&two[..1], STD_PX).0.is_some());
        assert!(matches!(agreeing_mean(&[], STD_PX), (None, 0)));
    }
}
