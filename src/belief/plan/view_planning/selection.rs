//! Selection among the candidates: greedily by information per arm time, then by exchange.
//!
//! A pick's score is its gain (the fall of the criterion's logarithm) over a power of the time that it adds to the
//! tour: cost-benefit greedy (Leskovec et al. 2007) with the exponent [`TIME_POWER`]. Gains fall as views are added, so
//! an earlier gain is an upper bound. Most candidates then need no second evaluation (lazy greedy, Minoux 1978).
//! Exchange then replaces one pick by one candidate as long as `ln criterion + TIME_POWER ln time` falls.

use crate::plan::constants::view_planning_selection::{LEAST_GAIN, MAX_ROUNDS, ROUNDING, SHORTLIST, TIME_POWER};
use crate::plan::view_planning::candidates::Candidate;
use crate::plan::view_planning::criterion::{DesignState, Scratch};
use crate::plan::view_planning::view_information::WhitenedView;
use crate::plan::view_planning::visit_order::Tour;
use armcal_core::streams::JointAngles;

/// Candidates and criteria of the selection.
pub(crate) struct ViewSelector<'a> {
    pub candidates: &'a [Candidate],
    /// Whitened Jacobians of each candidate.
    pub whitened_views: Vec<WhitenedView>,
    pub tour: Tour<'a>,
    /// Time of a view at rest, s.
    pub view_s: f64,
    /// Length of a group of views whose first view shows a known tag, as long as there are such candidates.
    pub anchored_every: usize,
    /// State before the picks; it includes the captured views.
    pub design: DesignState,
}

/// Score of a candidate by its index and gain.
type Score<'a> = dyn Fn(usize, f64) -> f64 + 'a;
/// True if the candidate of this index may be picked.
type May<'a> = dyn Fn(usize) -> bool + 'a;

/// Upper bounds of the candidates' gains.
struct LazyGains {
    /// Upper bound of each gain; negative for picked candidates.
    bounds: Vec<f64>,
    /// True if the bound is the gain itself.
    is_fresh: Vec<bool>,
}

/// Picks in the order of their tour.
#[derive(Clone, Debug, Default)]
pub(crate) struct Picks {
    pub order: Vec<usize>,
    placed: Vec<JointAngles>,
}

impl Picks {
    fn insert(&mut self, at: usize, k: usize, angles: JointAngles) {
        self.order.insert(at, k);
        self.placed.insert(at, angles);
    }

    fn without(&self, place: usize) -> Self {
        let mut rest = self.clone();
        rest.order.remove(place);
        rest.placed.remove(place);
        rest
    }
}

impl ViewSelector<'_> {
    /// Returns the indices of `n` picks, or of all candidates.
    pub(crate) fn pick(&self, n: usize) -> Vec<usize> {
        let picks = self.exchanged(self.greedy(n));
        picks.order
    }

    pub(crate) fn greedy(&self, n: usize) -> Picks {
        let mut design = self.design.clone();
        let mut scratch = design.scratch();
        let mut picks = Picks::default();
        let n_candidates = self.candidates.len();
        let mut gains = LazyGains { bounds: vec![f64::INFINITY; n_candidates], is_fresh: vec![false; n_candidates] };
        let mut places = vec![(0, 0.0); n_candidates];
        let has_anchor = self.candidates.iter().any(|candidate| candidate.shows_known_tag);
        for turn in 0..n.min(n_candidates) {
            gains.is_fresh.fill(false);
            let must_anchor = self.anchored_every > 1 && turn.is_multiple_of(self.anchored_every) && has_anchor;
            let may = |k: usize| !must_anchor || self.candidates[k].shows_known_tag;
            for (k, place) in places.iter_mut().enumerate().filter(|(k, _)| gains.bounds[*k] >= 0.0 && may(*k)) {
                *place = self.tour.insertion(&picks.placed, &self.candidates[k].angles);
            }
            let score = |k: usize, gain: f64| gain / (self.view_s + places[k].1).powf(TIME_POWER);
            let Some(best) = self.best(&design, &mut scratch, &mut gains, (&score, &may)) else {
                // No candidate that may be picked is left.
                if must_anchor { continue } else { break }
            };
            let candidate = &self.candidates[best];
            design.take(&self.whitened_views[best], &mut scratch);
            picks.insert(places[best].0, best, candidate.angles);
            gains.bounds[best] = f64::NEG_INFINITY;
        }
        picks
    }

    /// Returns the candidate of the highest score; stale gains are recomputed from the highest bound on.
    fn best(
        &self,
        design: &DesignState,
        scratch: &mut Scratch,
        gains: &mut LazyGains,
        (score, may): (&Score<'_>, &May<'_>),
    ) -> Option<usize> {
        let mut order: Vec<(f64, usize)> = gains
            .bounds
            .iter()
            .enumerate()
            .filter(|(k, gain)| **gain >= 0.0 && may(*k))
            .map(|(k, gain)| (score(k, *gain), k))
            .collect();
        order.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut best: Option<(f64, usize)> = None;
        for (bound, k) in order {
            if best.is_some_and(|(most, _)| bound <= most * (1.0 + ROUNDING)) {
                break;
            }
            if !gains.is_fresh[k] {
                gains.bounds[k] = design.gain(&self.whitened_views[k], scratch);
                gains.is_fresh[k] = true;
            }
            let now = score(k, gains.bounds[k]);
            if best.is_none_or(|(most, _)| now > most) {
                best = Some((now, k));
            }
        }
        best.map(|(_, k)| k)
    }

    #[cfg(test)]
    pub(crate) fn ln_value(&self, order: &[usize]) -> f64 {
        self.after(order).ln_value
    }

    fn after(&self, order: &[usize]) -> DesignState {
        let mut design = self.design.clone();
        self.add_all(&mut design, order);
        design.renew();
        design
    }

    fn add_all(&self, design: &mut DesignState, order: &[usize]) {
        let mut scratch = design.scratch();
        order.iter().for_each(|&k| design.add(&self.whitened_views[k], &mut scratch));
    }

    fn time_s(&self, picks: &Picks) -> f64 {
        self.tour.travel_time_s(&picks.placed) + picks.order.len() as f64 * self.view_s
    }

    pub(crate) fn exchanged(&self, mut picks: Picks) -> Picks {
        // Place of the last exchange in the round before, and its shortlist: after this place no candidate of that list
        // helped.
        let mut looked_at: Option<(usize, Vec<usize>)> = None;
        for _ in 0..MAX_ROUNDS {
            let shortlist = self.shortlist(&picks);
            let is_new = |k: &usize| looked_at.as_ref().is_none_or(|(_, before)| !before.contains(k));
            let news: Vec<usize> = shortlist.iter().copied().filter(is_new).collect();
            let mut helped_at = None;
            // State after the picks before this place.
            let mut before = self.design.clone();
            for place in 0..picks.order.len() {
                let is_as_before = helped_at.is_none() && looked_at.as_ref().is_some_and(|(last, _)| place > *last);
                let list = if is_as_before { &news } else { &shortlist };
                if let Some(better) = self.exchange(&picks, place, &before, list) {
                    if better.order[..place] != picks.order[..place] {
                        before = self.design.clone();
                        self.add_all(&mut before, &better.order[..place]);
                    }
                    picks = better;
                    helped_at = Some(place);
                }
                self.add_all(&mut before, &picks.order[place..=place]);
            }
            let Some(last) = helped_at else { break };
            looked_at = Some((last, shortlist));
        }
        picks
    }

    /// Exchanges picks without skipping candidates that were already tested.
    #[cfg(test)]
    pub(crate) fn exchanged_plainly(&self, mut picks: Picks) -> Picks {
        for _ in 0..MAX_ROUNDS {
            let shortlist = self.shortlist(&picks);
            let mut helped = false;
            for place in 0..picks.order.len() {
                let before = self.after(&picks.order[..place]);
                if let Some(better) = self.exchange(&picks, place, &before, &shortlist) {
                    (picks, helped) = (better, true);
                }
            }
            if !helped {
                break;
            }
        }
        picks
    }

    fn shortlist(&self, picks: &Picks) -> Vec<usize> {
        let design = self.after(&picks.order);
        let mut scratch = design.scratch();
        let left = (0..self.candidates.len()).filter(|k| !picks.order.contains(k));
        let mut gains: Vec<(f64, usize)> =
            left.map(|k| (design.gain(&self.whitened_views[k], &mut scratch), k)).collect();
        gains.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        gains.into_iter().take(SHORTLIST).map(|(_, k)| k).collect()
    }

    /// Returns the picks with the one at `place` replaced by another, if that is better. `before` is the state after
    /// the picks before that.
    fn exchange(&self, picks: &Picks, place: usize, before: &DesignState, shortlist: &[usize]) -> Option<Picks> {
        let out = picks.order[place];
        let rest = picks.without(place);
        let mut design = before.clone();
        self.add_all(&mut design, &rest.order[place..]);
        design.renew();
        let mut scratch = design.scratch();
        let way_s = self.time_s(&rest) + self.view_s;
        let mut worth = |k: usize| {
            let (at, cost_s) = self.tour.insertion(&rest.placed, &self.candidates[k].angles);
            let gain = design.gain(&self.whitened_views[k], &mut scratch);
            (gain - TIME_POWER * (way_s + cost_s).max(1e-9).ln(), at)
        };
        let (now, _) = worth(out);
        let may = |k: usize| {
            !picks.order.contains(&k)
                && (self.anchored_every <= 1
                    || self.candidates[k].shows_known_tag
                    || !self.candidates[out].shows_known_tag)
        };
        let mut best: Option<(f64, usize, usize)> = None;
        for &k in shortlist.iter().filter(|&&k| may(k)) {
            let (value, at) = worth(k);
            if value > now + LEAST_GAIN && best.is_none_or(|(most, ..)| value > most) {
                best = Some((value, k, at));
            }
        }
        let (_, k, at) = best?;
        let mut better = rest;
        better.insert(at, k, self.candidates[k].angles);
        Some(better)
    }

    /// Does the same as [`Self::greedy`], with every gain recomputed in every turn.
    #[cfg(test)]
    pub(crate) fn eager(&self, n: usize) -> Vec<usize> {
        let mut design = self.design.clone();
        let mut scratch = design.scratch();
        let mut picks = Picks::default();
        for _ in 0..n {
            let worth = |k: usize, scratch: &mut Scratch| {
                let (at, cost_s) = self.tour.insertion(&picks.placed, &self.candidates[k].angles);
                let gain = design.gain(&self.whitened_views[k], scratch);
                (gain / (self.view_s + cost_s).powf(TIME_POWER), at)
            };
            let left = (0..self.candidates.len()).filter(|k| !picks.order.contains(k));
            let all: Vec<(f64, usize, usize)> = left
                .map(|k| {
                    let (value, at) = worth(k, &mut scratch);
                    (value, k, at)
                })
                .collect();
            let Some(&(_, k, at)) = all.iter().max_by(|a, b| a.0.total_cmp(&b.0)) else { break };
            design.take(&self.whitened_views[k], &mut scratch);
            picks.insert(at, k, self.candidates[k].angles);
        }
        picks.order
    }

    /// Objective `ln criterion + TIME_POWER ln time` that an exchange lowers.
    #[cfg(test)]
    pub(crate) fn objective(&self, picks: &Picks) -> f64 {
        self.ln_value(&picks.order) + TIME_POWER * self.time_s(picks).max(1e-9).ln()
    }

    /// Returns the first `n` of `chosen` to visit: each time that of the highest gain per time from the arm's position.
    pub(crate) fn most_informative_first(&self, chosen: &[usize], n: usize) -> Vec<usize> {
        let mut design = self.design.clone();
        let mut scratch = design.scratch();
        let (mut first, mut at): (Vec<usize>, JointAngles) = (Vec::new(), self.tour.start);
        for _ in 0..n.min(chosen.len()) {
            let worth = |k: usize, scratch: &mut Scratch| {
                let way_s = self.tour.timing.least_duration_s(&at, &self.candidates[k].angles);
                design.gain(&self.whitened_views[k], scratch) / (self.view_s + way_s)
            };
            let mut best: Option<(f64, usize)> = None;
            for &k in chosen.iter().filter(|k| !first.contains(*k)) {
                let value = worth(k, &mut scratch);
                if best.is_none_or(|(most, _)| value > most) {
                    best = Some((value, k));
                }
            }
            let Some((_, k)) = best else { break };
            design.take(&self.whitened_views[k], &mut scratch);
            at = self.candidates[k].angles;
            first.push(k);
        }
        first
    }
}
