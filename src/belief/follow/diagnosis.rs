//! Fault diagnosis by the evidence of the views. A view that the belief does not explain starts a race of hypotheses,
//! each with its own belief. The race ends when one of them leads, or after two to five more views. It takes up to
//! twenty if either of two joints may have the worn sensor.

use crate::follow::branch::{Branch, Step};
use crate::follow::constants::diagnosis::{
    CONFIRMED_BY, HOPELESS_NATS, JOINS_NATS, LEAD_NATS, LEAD_OF_SENSOR_NATS, LONE_LEAD_IN_MOTION_NATS, LONE_LEAD_NATS,
    LONE_TAG_LEAD_NATS, LONE_TAG_M, MAX_BRANCHES, MAX_RECENT, MAX_VIEWS, MAX_VIEWS_OF_DRIFT, MAX_VIEWS_OF_SLIP,
    MAX_VIEWS_OF_TIE, MAX_VIEWS_TO_NAME, NEARER_NATS, OPEN_SENSOR_CONFIRMED_BY, OPEN_VIEWS, RECENT_S,
    SUSPICIOUS_STEP_Z, SUSPICIOUS_Z,
};
use crate::follow::filter::{Filter, Scores, ViewUpdate, WalkScore};
use crate::follow::hypothesis::{Fault, TagSet};
use crate::follow::view_stream::is_moving;
use crate::model::constants::parameters::SPOT_WIDTH_RAD;
use crate::model::parameters::WornSpot;
use crate::views::view::View;
use armcal_core::joints::MAX_JOINTS;
use armcal_core::robot::Robot;
use armcal_core::time::Stamp;

/// Hypotheses about the last views.
#[derive(Clone)]
pub(crate) struct Race {
    /// Branches, the best one first.
    branches: Vec<Branch>,
    /// The belief before the first suspicious view.
    before: Filter,
    /// Number of earlier views, and branch without a fault until then, before each view for which hypotheses are
    /// opened. These are the view that began the race (the last of the recent ones) and the first ones after it.
    nothing_until: Vec<(usize, Branch)>,
    steps: Vec<Step>,
    /// Number of views after the race began.
    n_later: usize,
}

/// Result of a race.
pub(crate) struct Verdict {
    pub fault: Fault,
    pub size: Option<f64>,
    /// Stamp of the first view that shows the fault, if that was before the race.
    pub since: Option<Stamp>,
    /// Lead over the next hypothesis, nats.
    pub lead_nats: f64,
    pub next: Option<Fault>,
}

/// The last few views close to each other in time: together they may show a fault that each is too weak to show.
#[derive(Clone)]
pub(crate) struct RecentViews {
    /// Belief before these views, widened until the first.
    pub before: Filter,
    /// Evidence of these views when they were taken in, nats.
    pub nats: f64,
    pub views: Vec<View>,
    sums: [WalkScore; MAX_JOINTS],
}

impl RecentViews {
    pub(crate) fn new(before: Filter) -> Self {
        Self { before, nats: 0.0, views: Vec::new(), sums: [WalkScore::default(); MAX_JOINTS] }
    }

    /// True if `view` belongs to another group.
    pub(crate) fn is_past(&self, view: &View) -> bool {
        let last = self.views.last().map_or(view.end, |last| last.end);
        self.views.len() >= MAX_RECENT || view.end.since_s(last) > RECENT_S
    }

    pub(crate) fn add(&mut self, view: &View, update: Option<&ViewUpdate>) {
        self.views.push(view.clone());
        self.nats += update.map_or(0.0, |update| update.log_evidence);
        for (sum, score) in self.sums.iter_mut().zip(update.iter().flat_map(|update| &update.scores.walk)) {
            sum.a += score.a;
            sum.b += score.b;
        }
    }

    /// True if all views pull one joint's offset the same way. Innovations have no memory, so their scores add up like
    /// independent numbers.
    pub(crate) fn show_a_step(&self) -> bool {
        self.views.len() > 1 && has_step(&self.sums)
    }
}

fn has_step(scores: &[WalkScore; MAX_JOINTS]) -> bool {
    scores.iter().any(|score| score.a * score.a > SUSPICIOUS_STEP_Z.powi(2) * score.b)
}

/// True if noise does not explain a view: by its cost, a rejected observation, or one joint's offset alone (the score
/// test of a step there).
pub(crate) fn is_suspicious(update: &ViewUpdate) -> bool {
    let n = update.n_coordinates.max(1) as f64;
    // Wilson and Hilferty 1931.
    let by = 2.0 / (9.0 * n);
    let is_costly = update.cost > n * (1.0 - by + SUSPICIOUS_Z * by.sqrt()).powi(3);
    is_costly || has_step(&update.scores.walk) || !update.rejected.is_empty()
}

impl Race {
    /// Starts a race of all hypotheses about views that the belief before them does not explain.
    pub(crate) fn start(robot: &Robot, RecentViews { before, views, .. }: &RecentViews) -> Self {
        let steps: Vec<Step> = views.iter().map(|view| Step { drift: None, view: view.clone() }).collect();
        let n_until = steps.len().saturating_sub(1);
        let mut nothing_until = Branch::nothing(before.clone());
        steps[..n_until].iter().for_each(|step| _ = step.take_in(robot, &mut nothing_until));
        let branches = Vec::new();
        let nothing_until = if n_until > 0 { vec![(n_until, nothing_until)] } else { Vec::new() };
        let mut race = Self { branches, before: before.clone(), nothing_until, steps, n_later: 0 };
        race.open(robot);
        race
    }

    /// Takes the view into every hypothesis, after the sensor changes that may precede it. Returns the scores of
    /// offsets and tags without a fault. No hypothesis is dropped at the first views, which open more: the next view
    /// may decide what a view of one tag cannot.
    pub(crate) fn add(&mut self, robot: &Robot, step: Step) -> Scores {
        self.n_later += 1;
        let nothing = self.of(None).cloned();
        let is_told = self.best().is_some_and(Branch::tells);
        let mut scores = Scores::default();
        for branch in &mut self.branches {
            let update = step.take_in(robot, branch);
            if branch.fault.is_some() {
                continue;
            }
            // A fault that happens before any is found starts a new race.
            let is_new = self.n_later > OPEN_VIEWS && !is_told && update.as_ref().is_none_or(is_suspicious);
            if is_new && self.steps.len() < MAX_VIEWS_OF_TIE {
                self.n_later = 0;
            }
            scores = update.map(|update| update.scores).unwrap_or_default();
        }
        if self.n_later <= OPEN_VIEWS {
            self.nothing_until.extend(nothing.map(|nothing| (self.steps.len(), nothing)));
        }
        self.steps.push(step);
        if self.n_later <= OPEN_VIEWS {
            self.open(robot);
        } else {
            self.sort();
        }
        if self.n_later >= OPEN_VIEWS {
            self.drop_hopeless();
        }
        scores
    }

    /// Adds hypotheses found in hindsight, each replacing a less probable one.
    pub(crate) fn take_up(&mut self, branches: Vec<Branch>) {
        for new in branches {
            let same = self.branches.iter_mut().find(|branch| branch.fault == new.fault);
            match same {
                Some(same) if same.nats < new.nats => *same = new,
                Some(_) => {}
                None => self.branches.push(new),
            }
        }
        self.sort();
    }

    /// Returns the number of its views.
    pub(crate) fn n_views(&self) -> usize {
        self.steps.len()
    }

    /// Opens all hypotheses about the views so far that are not followed yet.
    fn open(&mut self, robot: &Robot) {
        let views: Vec<&View> = self.steps.iter().map(|step| &step.view).collect();
        let all = std::iter::once(None).chain(Fault::all(&self.before, &views).into_iter().map(Some));
        for fault in all {
            match self.branches.iter().position(|branch| branch.fault == fault) {
                None => self.branches.push(self.branch(robot, fault)),
                Some(at) => {
                    let latest =
                        self.nothing_until.last().filter(|(n, _)| fault.is_some() && n + 1 == self.steps.len());
                    let later = latest.map(|latest| self.since(robot, fault, latest));
                    if let Some(later) = later.filter(|later| later.nats > self.branches[at].nats) {
                        self.branches[at] = later;
                    }
                }
            }
        }
        if let Some(nearer) = self.nearer_spot(robot) {
            self.branches.push(nearer);
        }
        if let Some(together) = self.moved_together(robot) {
            self.branches.retain(|branch| !matches!(branch.fault, Some(Fault::Tags(_))));
            self.branches.push(together);
        }
        self.sort();
    }

    /// Keeps the best hypotheses, and that of no fault.
    fn drop_hopeless(&mut self) {
        let best = self.nats();
        let mut place = 0;
        self.branches.retain(|branch| {
            place += 1;
            branch.fault.is_none() || (place <= MAX_BRANCHES && best - branch.nats < HOPELESS_NATS)
        });
    }

    fn of(&self, fault: Option<Fault>) -> Option<&Branch> {
        self.branches.iter().find(|branch| branch.fault == fault)
    }

    /// Returns a branch that took in all views, with the most probable onset of the fault: before the first view,
    /// before the view that began the race, or before a later view that opened hypotheses.
    fn branch(&self, robot: &Robot, fault: Option<Fault>) -> Branch {
        let early = self.since(robot, fault, &(0, Branch::nothing(self.before.clone())));
        if fault.is_none() {
            return early;
        }
        let late = self.nothing_until.iter().map(|until| self.since(robot, fault, until));
        late.fold(early, |best, late| if late.nats > best.nats { late } else { best })
    }

    /// Returns the branch of a fault after `n` views without one.
    fn since(&self, robot: &Robot, fault: Option<Fault>, (n, nothing): &(usize, Branch)) -> Branch {
        let mut branch = fault.map_or_else(|| nothing.clone(), |fault| nothing.with(robot, fault));
        self.steps[*n..].iter().for_each(|step| _ = step.take_in(robot, &mut branch));
        branch
    }

    /// Returns the most probable worn spot, with its middle shifted by half a width if that explains more: a view may
    /// stand anywhere on the spot.
    fn nearer_spot(&self, robot: &Robot) -> Option<Branch> {
        let spots = self.branches.iter().filter_map(|branch| Some((branch, branch.worn_spot()?)));
        let (found, (joint, spot)) = spots.max_by(|(a, _), (b, _)| a.nats.total_cmp(&b.nats))?;
        let aside = [-0.5, 0.5].map(|by| WornSpot::about(spot.at_rad() + by * SPOT_WIDTH_RAD));
        let branches = aside.map(|spot| Some(Fault::Worn(joint, spot))).into_iter();
        let new = branches.filter(|fault| self.of(*fault).is_none()).map(|fault| self.branch(robot, fault));
        new.filter(|branch| branch.nats > found.nats + NEARER_NATS).max_by(|a, b| a.nats.total_cmp(&b.nats))
    }

    /// Starts from the most probable tag, or from the set found so far, and adds one tag after another that belongs to
    /// it. `None` if no other tag does.
    fn moved_together(&self, robot: &Robot) -> Option<Branch> {
        let best = |is_wanted: fn(Fault) -> bool| {
            let wanted = self.branches.iter().filter(|branch| branch.fault.is_some_and(is_wanted));
            wanted.max_by(|a, b| a.nats.total_cmp(&b.nats))
        };
        let alone = best(|fault| matches!(fault, Fault::Tag(_)))?;
        let found = best(|fault| matches!(fault, Fault::Tags(_))).filter(|found| found.nats > alone.nats);
        let mut set = match found.unwrap_or(alone).fault {
            Some(Fault::Tags(tags)) => tags,
            Some(Fault::Tag(tag)) if alone.nats > self.of(None)?.nats => TagSet::of(tag)?,
            _ => return None,
        };
        let mut tags: Vec<usize> = self.steps.iter().flat_map(|step| &step.view.tags).map(|tag| tag.tag_idx).collect();
        tags.sort_unstable();
        tags.dedup();
        let mut together: Option<Branch> = None;
        // If all tags moved together, the base moved.
        while set.iter().count() + 1 < tags.len() {
            let wider = tags.iter().filter_map(|tag| set.with(*tag));
            let branches = wider.map(|set| (set, self.branch(robot, Some(Fault::Tags(set)))));
            let Some((wider, best)) = branches.max_by(|(_, a), (_, b)| a.nats.total_cmp(&b.nats)) else { break };
            if best.nats < together.as_ref().or(found).unwrap_or(alone).nats + JOINS_NATS {
                break;
            }
            (set, together) = (wider, Some(best));
        }
        together
    }

    /// Sorts the hypotheses, the best one first and void ones last.
    fn sort(&mut self) {
        let before = &self.before;
        self.branches.sort_by(|a, b| a.is_void(before).cmp(&b.is_void(before)).then(b.nats.total_cmp(&a.nats)));
    }

    /// Returns the best hypothesis so far.
    pub(crate) fn best(&self) -> Option<&Branch> {
        self.branches.first()
    }

    /// Returns the belief to continue with: that of the best hypothesis, or that of no fault if the best one is not
    /// confirmed.
    pub(crate) fn belief(&self) -> Option<&Filter> {
        let best = self.best().filter(|best| self.is_confirmed(best.fault)).or_else(|| self.of(None)).or(self.best());
        best.map(|branch| &branch.filter)
    }

    /// Returns `ln` of the odds of the best hypothesis so far.
    pub(crate) fn nats(&self) -> f64 {
        self.branches.first().map_or(0.0, |branch| branch.nats)
    }

    /// True if the race is decided; a single view identifies no fault.
    pub(crate) fn is_over(&self) -> bool {
        let Some(best) = self.best().filter(|best| self.is_confirmed(best.fault)) else {
            return self.n_later >= MAX_VIEWS;
        };
        let may_name = |other: &Branch| match other.fault {
            None => false,
            Some(Fault::Drift) => best.tells() && self.n_later >= MAX_VIEWS_OF_DRIFT,
            Some(Fault::Worn(..)) if matches!(best.fault, Some(Fault::Slip(_))) => self.n_later >= MAX_VIEWS_OF_SLIP,
            Some(_) => best.tells() && self.n_later >= MAX_VIEWS_TO_NAME,
        };
        let is_behind = |other: &Branch| {
            let is_of_sensor = best.fault.zip(other.fault).is_some_and(|(one, other)| one.is_of_same_sensor(other));
            // If all views are at the spot, a slip leads only by its higher prior.
            let may_be_worn = matches!(best.fault, Some(Fault::Slip(_))) && other.worn_spot().is_some();
            let lead = if is_of_sensor && !may_be_worn { LEAD_OF_SENSOR_NATS } else { LEAD_NATS };
            best.nats - other.nats > lead || may_name(other)
        };
        let is_tied = |other: &Branch| other.worn_spot().is_some() && best.nats - other.nats < LEAD_OF_SENSOR_NATS;
        if best.worn_spot().is_some() && self.others().any(is_tied) {
            return self.n_later >= MAX_VIEWS_OF_TIE;
        }
        self.n_later >= MAX_VIEWS || self.others().all(is_behind)
    }

    /// True if enough views could have contradicted the fault. A misread tag occurs once; a moved tag appears there
    /// again.
    fn is_confirmed(&self, fault: Option<Fault>) -> bool {
        match fault {
            None => true,
            // Drift shows in all views, so a weak view must not decide it.
            Some(Fault::Drift) => self.n_later >= MAX_VIEWS,
            Some(Fault::Tag(tag)) => self.n_views_of(tag, fault) >= CONFIRMED_BY || self.is_lone_tag_confirmed(tag),
            Some(Fault::Tags(tags)) => tags.iter().map(|tag| self.n_views_of(tag, fault)).sum::<usize>() > CONFIRMED_BY,
            Some(Fault::Worn(joint, spot)) => self.is_spot_confirmed(joint, spot),
            Some(Fault::Failed(_)) => {
                self.n_views_since(fault) >= OPEN_SENSOR_CONFIRMED_BY && self.is_failure_clear(fault)
            }
            Some(Fault::Scale(_)) => self.n_views_since(fault) >= OPEN_SENSOR_CONFIRMED_BY,
            Some(_) => self.n_views_since(fault) >= CONFIRMED_BY,
        }
    }

    /// Returns the number of views since the fault may have happened.
    fn n_views_since(&self, fault: Option<Fault>) -> usize {
        self.of(fault).map_or(0, Branch::n_views)
    }

    /// True if the failure is clear, because a single supporting view may have a torn reading.
    fn is_failure_clear(&self, fault: Option<Fault>) -> bool {
        let Some((failed, nothing)) = self.of(fault).zip(self.of(None)) else { return false };
        self.n_speak(fault) >= CONFIRMED_BY || failed.nats > nothing.nats + LONE_LEAD_IN_MOTION_NATS
    }

    /// Returns the number of views since then that support the fault.
    fn n_speak(&self, fault: Option<Fault>) -> usize {
        let both = self.of(fault).zip(self.of(None));
        both.map_or(0, |(branch, nothing)| branch.n_speak_before + branch.n_speak_for_it(nothing))
    }

    /// Returns the number of views since then that saw a tag.
    fn n_views_of(&self, tag: usize, fault: Option<Fault>) -> usize {
        let since = self.steps.iter().rev().take(self.n_views_since(fault));
        let before = self.of(fault).map_or(0, |branch| branch.n_speak_before);
        before + since.filter(|step| step.view.sees(tag)).count()
    }

    /// True if a single view suffices for a moved tag: a misread tag would be displaced by the distance between two
    /// tags.
    fn is_lone_tag_confirmed(&self, tag: usize) -> bool {
        let fault = Fault::Tag(tag);
        let (Some(moved), Some(nothing)) = (self.of(Some(fault)), self.of(None)) else { return false };
        let is_near = fault.size(&self.before, &moved.filter).is_some_and(|by_m| by_m < LONE_TAG_M);
        self.n_later >= MAX_VIEWS_TO_NAME && is_near && moved.nats - nothing.nats > LONE_TAG_LEAD_NATS
    }

    /// True if the spot is confirmed. A single supporting view may be a mistake, unless it is clear. Views of the spot
    /// alone do not distinguish it from a slip, which has the higher prior.
    fn is_spot_confirmed(&self, joint: usize, spot: WornSpot) -> bool {
        let worn = self.of(Some(Fault::Worn(joint, spot)));
        let Some((worn, nothing)) = worn.zip(self.of(None)).filter(|_| self.n_later > 0) else { return false };
        let is_moving = self.steps.iter().any(|step| is_moving(&step.view));
        let clear_nats = if is_moving { LONE_LEAD_IN_MOTION_NATS } else { LONE_LEAD_NATS };
        self.n_speak(worn.fault) >= CONFIRMED_BY && worn.nats > nothing.nats + LEAD_NATS
            || worn.nats > nothing.nats + clear_nats
    }

    fn lead_nats(&self) -> f64 {
        match (self.best(), self.others().next()) {
            (Some(first), Some(second)) => first.nats - second.nats,
            _ => f64::INFINITY,
        }
    }

    /// Returns all hypotheses but the best, without void ones and without the same worn spot with another middle.
    fn others(&self) -> impl Iterator<Item = &Branch> {
        let best = self.best().and_then(Branch::worn_spot);
        let is_same = move |branch: &Branch| {
            let both = best.zip(branch.worn_spot());
            both.is_some_and(|((joint, at), (other, near))| joint == other && !at.is_far_from(near.at_rad()))
        };
        self.branches.iter().skip(1).filter(move |branch| !is_same(branch) && !branch.is_void(&self.before))
    }

    /// Returns the result; `None` if there is no fault.
    pub(crate) fn verdict(&self) -> Option<Verdict> {
        let best = self.branches.first()?;
        let fault = best.fault.filter(|fault| *fault != Fault::Drift && self.is_confirmed(best.fault))?;
        let size = fault.size(&self.before, &best.filter);
        Some(Verdict {
            fault,
            size,
            since: best.since,
            lead_nats: self.lead_nats(),
            next: self.others().next().and_then(|branch| branch.fault),
        })
    }
}
