//! Worn spots and moved tags found by views that lie minutes apart. Each such view adds only a few nats, and a race
//! about one is over before the next comes. So each view's scores of each joint's offset and each tag's position are
//! kept. Innovations have no memory, so the scores of one place of a track, and of one tag, add up. If the sum is too
//! many sigmas, the views since then are taken in once more, with a fault before the first of them.

use crate::follow::constants::hindsight::{
    A_LITTLE_ASIDE_M, COMPARED_CHI2, COMPARED_Z, FARTHER_BY, GROWN_BY, LEAST_VIEWS, MIDDLES, SUSPICIOUS_CHI2,
    SUSPICIOUS_Z, VIEWS_OF_SPAN, WORTH_COMPARING_NATS,
};
use nalgebra::{Matrix3, Vector3};

use crate::follow::branch::{Branch, Step, speaks};
use crate::follow::filter::{Filter, Scores};
use crate::follow::hypothesis::Fault;
use crate::model::constants::parameters::SPOT_WIDTH_RAD;
use crate::model::parameters::WornSpot;
use crate::views::view::View;
use armcal_core::joints::MAX_JOINTS;
use armcal_core::robot::Robot;

/// The last views, and the belief before them.
#[derive(Clone, Default)]
pub(crate) struct Hindsight {
    /// Spans, the older one first.
    spans: Vec<Span>,
    /// Square of the last tested score of each joint.
    looked_into: [f64; MAX_JOINTS],
    /// Index and square of the last tested score of each tag that was tested.
    looked_into_tags: Vec<(usize, f64)>,
}

#[derive(Clone)]
struct Span {
    before: Filter,
    steps: Vec<PastStep>,
}

#[derive(Clone)]
struct PastStep {
    step: Step,
    scores: Scores,
    /// True if all sensors had drifted more than expected.
    has_drifted: bool,
}

/// A tag that all views together show displaced.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TagSuspicion {
    pub tag: usize,
    /// Number of views since the first that shows the displacement.
    n_since: usize,
    /// Chi-square of three degrees of freedom.
    chi2: f64,
}

/// A place of a track that the scores of several views concern.
#[derive(Clone, Copy, Debug)]
struct Suspicion {
    joint: usize,
    spot: WornSpot,
    /// Number of views since the first that belongs to it.
    n_since: usize,
    /// Square of the score in sigmas.
    chi2: f64,
}

impl Hindsight {
    /// Prepares for a view before it changes `filter`: begins a span with it if the last one is full.
    pub(crate) fn begin(&mut self, filter: &Filter) {
        if self.spans.last().is_some_and(|span| span.steps.len() < VIEWS_OF_SPAN) {
            return;
        }
        if self.spans.len() == 2 {
            self.spans.remove(0);
            // The tests concerned views that are gone.
            self.looked_into = [0.0; MAX_JOINTS];
            self.looked_into_tags.clear();
        }
        self.spans.push(Span { before: filter.clone(), steps: Vec::with_capacity(VIEWS_OF_SPAN) });
    }

    /// Adds a view that was taken in, and its scores of offsets and tags without a fault.
    pub(crate) fn add(&mut self, step: Step, scores: Scores) {
        if let Some(span) = self.spans.last_mut() {
            span.steps.push(PastStep { step, scores, has_drifted: false });
        }
    }

    /// Marks that the last `n` views were explained by drift before the first of them.
    pub(crate) fn has_drifted(&mut self, n: usize) {
        if let Some(past) = self.spans.iter_mut().rev().flat_map(|span| span.steps.iter_mut().rev()).nth(n - 1) {
            past.has_drifted = true;
        }
    }

    fn latest_first(&self) -> impl Iterator<Item = &PastStep> {
        self.spans.iter().rev().flat_map(|span| span.steps.iter().rev())
    }

    /// Returns the hypotheses that the last views suggest together with those before them, by [`Self::branches`].
    pub(crate) fn found(&mut self, robot: &Robot, filter: &Filter, n_of_race: usize) -> Vec<Branch> {
        let suspicions = self.suspicions(filter);
        let mut found = self.branches(robot, filter, &suspicions, n_of_race);
        let tags = self.suspicious_tags();
        found.extend(self.branches_of_tags(robot, filter, &tags, n_of_race));
        found
    }

    /// Returns the tags of the last view that all views together show displaced. The one with the largest score among
    /// those whose score has grown since its test comes first. Empty if there is none.
    pub(crate) fn suspicious_tags(&mut self) -> Vec<TagSuspicion> {
        let Some(last) = self.latest_first().next() else { return Vec::new() };
        let tags: Vec<usize> = last.scores.tags.iter().map(|score| score.tag).collect();
        let mut all: Vec<TagSuspicion> = tags.into_iter().filter_map(|tag| self.of_tag(tag)).collect();
        all.retain(|it| it.chi2 > COMPARED_CHI2);
        all.sort_by(|one, other| other.chi2.total_cmp(&one.chi2));
        let is_new = |it: &TagSuspicion| {
            let looked_into = self.looked_into_tags.iter().find(|(tag, _)| *tag == it.tag);
            it.chi2 > SUSPICIOUS_CHI2.max(looked_into.map_or(0.0, |(_, chi2)| *chi2) + GROWN_BY)
        };
        let Some(first) = all.iter().position(is_new) else { return Vec::new() };
        all[..=first].rotate_right(1);
        let TagSuspicion { tag, chi2, .. } = all[0];
        self.looked_into_tags.retain(|(known, _)| *known != tag);
        self.looked_into_tags.push((tag, chi2));
        all
    }

    /// Returns the suspicion since the view with the largest displacement; `None` if too few views saw the tag.
    fn of_tag(&self, tag: usize) -> Option<TagSuspicion> {
        let (mut a, mut n_views) = (Vector3::zeros(), 0);
        let mut b = Matrix3::from_diagonal_element(A_LITTLE_ASIDE_M.powi(-2));
        let mut best: Option<TagSuspicion> = None;
        for (place, past) in self.latest_first().enumerate() {
            let Some(score) = past.scores.tags.iter().find(|score| score.tag == tag) else { continue };
            a += score.a;
            b += score.b;
            n_views += 1;
            let chi2 = b.cholesky().map_or(0.0, |factor| a.dot(&factor.solve(&a)));
            if n_views >= LEAST_VIEWS && chi2 > best.map_or(0.0, |best| best.chi2) {
                best = Some(TagSuspicion { tag, n_since: place + 1, chi2 });
            }
        }
        best
    }

    /// Returns the branches of tags, as [`Self::branches`] does: each of `suspicions`, and faults that may look like a
    /// moved tag.
    fn branches_of_tags(
        &self,
        robot: &Robot,
        filter: &Filter,
        suspicions: &[TagSuspicion],
        n_of_race: usize,
    ) -> Vec<Branch> {
        let Some(first) = suspicions.first() else { return Vec::new() };
        let Some(look_back) = self.look_back(robot, filter, first.n_since.max(n_of_race), n_of_race) else {
            return Vec::new();
        };
        let mut branches = vec![look_back.branch(robot, Fault::Tag(first.tag))];
        if branches[0].nats < look_back.nats_of_race() + WORTH_COMPARING_NATS {
            return Vec::new();
        }
        let tags = suspicions[1..].iter().map(|it| Fault::Tag(it.tag));
        let slips = filter.offsets().map(|(joint, _)| Fault::Slip(joint));
        let others = tags.chain(slips).chain([Fault::Mount, Fault::Base]);
        branches.extend(others.map(|fault| look_back.branch(robot, fault)));
        branches
    }

    /// Returns the places around the last view whose scores add up over several views. The one with the largest score
    /// among those grown since their test comes first. Empty if there is none.
    fn suspicions(&mut self, filter: &Filter) -> Vec<Suspicion> {
        let Some(last) = self.latest_first().next().map(|past| &past.step.view) else { return Vec::new() };
        let joints = filter.offsets().map(|(joint, _)| joint);
        let open = joints.filter(|joint| !last.is_free[*joint] && !filter.has_bump(*joint));
        let of_joint = |joint: usize| {
            let middles = MIDDLES.map(|by| last.travel_rad[joint] + by * SPOT_WIDTH_RAD);
            let all = middles.into_iter().filter_map(|at_rad| self.of_place(joint, WornSpot::about(at_rad)));
            all.reduce(|near, far| if far.chi2 > near.chi2 + FARTHER_BY { far } else { near })
        };
        let mut all: Vec<Suspicion> = open.filter_map(of_joint).filter(|it| it.chi2 > COMPARED_Z.powi(2)).collect();
        all.sort_by(|one, other| other.chi2.total_cmp(&one.chi2));
        let is_new = |it: &Suspicion| it.chi2 > SUSPICIOUS_Z.powi(2).max(self.looked_into[it.joint] + GROWN_BY);
        let Some(first) = all.iter().position(is_new) else { return Vec::new() };
        all[..=first].rotate_right(1);
        all.iter().for_each(|it| self.looked_into[it.joint] = it.chi2);
        all
    }

    /// Returns the suspicion since the view with the most sigmas; `None` if too few views are of that place.
    fn of_place(&self, joint: usize, spot: WornSpot) -> Option<Suspicion> {
        let (mut a, mut b, mut n_views) = (0.0, 0.0, 0);
        let mut best: Option<Suspicion> = None;
        for (place, past) in self.latest_first().enumerate() {
            let travel_rad = past.step.view.travel_rad[joint];
            if spot.is_far_from(travel_rad) {
                continue;
            }
            let share = spot.bump(0.0).share(travel_rad);
            a += share * past.scores.walk[joint].a;
            b += share * share * past.scores.walk[joint].b;
            n_views += usize::from(spot.is_seen_from(travel_rad));
            let chi2 = a * a / b;
            if n_views >= LEAST_VIEWS && chi2 > best.map_or(0.0, |best| best.chi2) {
                best = Some(Suspicion { joint, spot, n_since: place + 1, chi2 });
            }
        }
        best
    }

    /// Returns beliefs with a fault before the first view of the first of `suspicions`, and all views since taken in.
    /// They are the worn spots and faults that may look like one; none if the first is not worth a test. Their evidence
    /// is relative to no fault, except for the last `n_of_race` views, where it is absolute. `filter` has the present
    /// noise.
    fn branches(&self, robot: &Robot, filter: &Filter, suspicions: &[Suspicion], n_of_race: usize) -> Vec<Branch> {
        let Some(first) = suspicions.first() else { return Vec::new() };
        let Some(look_back) = self.look_back(robot, filter, first.n_since.max(n_of_race), n_of_race) else {
            return Vec::new();
        };
        let mut branches = vec![look_back.worn(robot, first)];
        if branches[0].nats < look_back.nats_of_race() + WORTH_COMPARING_NATS {
            return Vec::new();
        }
        branches.extend(suspicions[1..].iter().map(|it| look_back.worn(robot, it)));
        let is_of_spot = |view: &&View| first.spot.is_seen_from(view.travel_rad[first.joint]);
        let views: Vec<&View> = look_back.steps.iter().map(|past| &past.step.view).filter(is_of_spot).collect();
        let others = Fault::all(&look_back.before.filter, &views).into_iter().filter(|fault| match fault {
            Fault::Slip(of) => suspicions.iter().any(|it| it.joint == *of),
            Fault::Tag(_) | Fault::Mount => true,
            _ => false,
        });
        branches.extend(others.map(|fault| look_back.branch(robot, fault)));
        branches
    }

    /// Returns the last `n` views without a fault; `None` if fewer are known.
    fn look_back(&self, robot: &Robot, filter: &Filter, n: usize, n_of_race: usize) -> Option<LookBack<'_>> {
        let all: Vec<&PastStep> = self.spans.iter().flat_map(|span| &span.steps).collect();
        let n_before = all.len().checked_sub(n)?;
        let n_of_first = self.spans.first()?.steps.len();
        let (span, n_skipped) = match self.spans.get(1) {
            Some(second) if n_before >= n_of_first => (second, n_of_first),
            _ => (&self.spans[0], 0),
        };
        let mut before = span.before.clone();
        (before.scales, before.noise_in_motion) = (filter.scales.clone(), filter.noise_in_motion);
        let mut nothing = Branch::nothing(before);
        all[n_skipped..n_before].iter().for_each(|past| past.take_in(robot, &mut nothing));
        (nothing.nats, nothing.gains) = (0.0, Vec::new());
        let before = nothing.clone();
        let steps = all[n_before..].to_vec();
        steps.iter().for_each(|past| past.take_in(robot, &mut nothing));
        Some(LookBack { before, steps, of_nothing: nothing.gains, n_before_race: n - n_of_race })
    }
}

/// The last views, and the belief before them.
struct LookBack<'a> {
    /// Belief without a fault until then.
    before: Branch,
    steps: Vec<&'a PastStep>,
    /// Evidence of each view without a fault, nats.
    of_nothing: Vec<f64>,
    n_before_race: usize,
}

impl LookBack<'_> {
    fn nats_of_race(&self) -> f64 {
        self.of_nothing[self.n_before_race..].iter().sum()
    }

    /// Returns the belief with `fault` before the first of these views.
    fn branch(&self, robot: &Robot, fault: Fault) -> Branch {
        let mut branch = self.before.with(robot, fault);
        self.steps.iter().for_each(|past| past.take_in(robot, &mut branch));
        let before_race = branch.gains.drain(..self.n_before_race).zip(&self.of_nothing).zip(&self.steps);
        let of_before: f64 = self.of_nothing[..self.n_before_race].iter().sum();
        for ((own, nothing), past) in before_race {
            if counts(fault, past, [own, *nothing]) {
                branch.n_speak_before += 1;
                branch.since.get_or_insert(past.step.view.end);
            }
        }
        branch.nats -= of_before;
        branch
    }

    fn worn(&self, robot: &Robot, suspicion: &Suspicion) -> Branch {
        self.branch(robot, Fault::Worn(suspicion.joint, suspicion.spot))
    }
}

/// True if a view counts for a fault, given its evidence with the fault and without, nats.
fn counts(fault: Fault, past: &PastStep, [own, nothing]: [f64; 2]) -> bool {
    match fault {
        Fault::Tag(tag) => past.step.view.sees(tag),
        _ => speaks(own, nothing),
    }
}

impl PastStep {
    fn take_in(&self, robot: &Robot, branch: &mut Branch) {
        if self.has_drifted {
            Fault::Drift.open(&mut branch.filter, robot);
        }
        self.step.take_in(robot, branch);
    }
}
