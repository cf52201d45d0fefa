//! Order of visits with little arm time.
//!
//! An open tour from the arm's configuration, by cheapest insertion. Then 2-opt and or-opt (moves of up to three poses)
//! run until neither helps (Croes 1958, Or 1976). Times of edges are those of rest-to-rest motion; paths around
//! obstacles take longer.

use crate::plan::constants::view_planning_visit_order::{LEAST_GAIN_S, MAX_SWEEPS};
use crate::plan::motion::timing::Timing;
use armcal_core::streams::JointAngles;

/// Poses to visit from a start.
pub(crate) struct Tour<'a> {
    pub timing: &'a Timing,
    pub start: JointAngles,
}

impl Tour<'_> {
    /// Returns the time on the paths, s.
    pub(crate) fn travel_time_s(&self, order: &[JointAngles]) -> f64 {
        let mut at = &self.start;
        let mut sum_s = 0.0;
        for next in order {
            sum_s += self.timing.least_duration_s(at, next);
            at = next;
        }
        sum_s
    }

    /// Returns the index in `order` at which a new pose costs least, and its cost, s.
    pub(crate) fn insertion(&self, order: &[JointAngles], new: &JointAngles) -> (usize, f64) {
        let mut before = self.timing.least_duration_s(&self.start, new);
        let mut best = (0, f64::INFINITY);
        for k in 0..=order.len() {
            let from = if k == 0 { &self.start } else { &order[k - 1] };
            let (cost_s, after) = match order.get(k) {
                None => (before, 0.0),
                Some(to) => {
                    let after = self.timing.least_duration_s(new, to);
                    (before + after - self.timing.least_duration_s(from, to), after)
                }
            };
            if cost_s < best.1 {
                best = (k, cost_s);
            }
            before = after;
        }
        (best.0, best.1.max(0.0))
    }

    /// Returns the indices of `poses` in a short order.
    pub(crate) fn order(&self, poses: &[JointAngles]) -> Vec<usize> {
        let mut order: Vec<usize> = Vec::with_capacity(poses.len());
        let mut placed: Vec<JointAngles> = Vec::with_capacity(poses.len());
        for (k, pose) in poses.iter().enumerate() {
            let (at, _) = self.insertion(&placed, pose);
            order.insert(at, k);
            placed.insert(at, *pose);
        }
        for _ in 0..MAX_SWEEPS {
            if !self.two_opt(&mut order, poses) && !self.or_opt(&mut order, poses) {
                break;
            }
        }
        order
    }

    fn pose<'b>(&'b self, order: &[usize], poses: &'b [JointAngles], k: usize) -> &'b JointAngles {
        if k == 0 { &self.start } else { &poses[order[k - 1]] }
    }

    /// Reverses stretches; places count from 1, 0 is the start.
    fn two_opt(&self, order: &mut [usize], poses: &[JointAngles]) -> bool {
        let n = order.len();
        let mut helped = false;
        for i in 1..=n {
            for k in i + 1..=n {
                let edge = |a: usize, b: usize, order: &[usize]| {
                    self.timing.least_duration_s(self.pose(order, poses, a), self.pose(order, poses, b))
                };
                let mut gain_s = edge(i - 1, i, order) - edge(i - 1, k, order);
                if k < n {
                    gain_s += edge(k, k + 1, order) - edge(i, k + 1, order);
                }
                if gain_s > LEAST_GAIN_S {
                    order[i - 1..k].reverse();
                    helped = true;
                }
            }
        }
        helped
    }

    /// Moves stretches of up to three poses elsewhere.
    fn or_opt(&self, order: &mut Vec<usize>, poses: &[JointAngles]) -> bool {
        let at = |order: &[usize]| order.iter().map(|&k| poses[k]).collect::<Vec<_>>();
        let mut best_s = self.travel_time_s(&at(order));
        let mut helped = false;
        for length in 1..=3.min(order.len()) {
            for from in 0..=order.len() - length {
                let stretch: Vec<usize> = order[from..from + length].to_vec();
                let mut rest = order.clone();
                rest.drain(from..from + length);
                let mut best: Option<Vec<usize>> = None;
                for to in 0..=rest.len() {
                    let mut trial = rest.clone();
                    trial.splice(to..to, stretch.iter().copied());
                    let trial_s = self.travel_time_s(&at(&trial));
                    if trial_s < best_s - LEAST_GAIN_S {
                        (best_s, best) = (trial_s, Some(trial));
                    }
                }
                if let Some(better) = best {
                    *order = better;
                    helped = true;
                }
            }
        }
        helped
    }
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::*;

    /// Compares tours with the best of all orders of six poses.
    #[test]
    fn tours_are_as_short_as_they_can_be() {
        let robot = crate::plan::view_planning::fixture::titan();
        let timing = Timing::new(&robot);
        let mut rng = armcal_core::stats::stream_rng(5, "tour");
        let mut ratios = Vec::new();
        for _ in 0..40 {
            let mut pose = || JointAngles::from_fn(robot.n_joints(), |_| rng.random_range(-1.0..1.0));
            let tour = Tour { timing: &timing, start: pose() };
            let poses: Vec<JointAngles> = (0..6).map(|_| pose()).collect();
            let order = tour.order(&poses);
            let mut seen = order.clone();
            seen.sort_unstable();
            assert_eq!(seen, (0..6).collect::<Vec<_>>());
            let of = |order: &[usize]| tour.travel_time_s(&order.iter().map(|&k| poses[k]).collect::<Vec<_>>());
            let mut best = f64::INFINITY;
            permute(&mut (0..6).collect::<Vec<_>>(), 0, &mut |order| best = best.min(of(order)));
            ratios.push(of(&order) / best);
        }
        ratios.sort_by(f64::total_cmp);
        assert!(ratios[0] > 1.0 - 1e-9 && ratios[20] < 1.0 + 1e-9 && ratios[39] < 1.1, "{ratios:?}");
    }

    fn permute(order: &mut Vec<usize>, from: usize, each: &mut impl FnMut(&[usize])) {
        if from == order.len() {
            each(order);
        }
        for k in from..order.len() {
            order.swap(from, k);
            permute(order, from + 1, each);
            order.swap(from, k);
        }
    }
}
