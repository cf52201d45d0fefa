//! What happened, by the evidence of the views: a view that the belief does not explain starts a race of explanations,
//! each a belief of its own, until one of them leads, or two to five more views were seen.

use crate::calib::online::filter::{Filter, ViewUpdate, WalkScore};
use crate::calib::online::hypothesis::Fault;
use crate::calib::online::view_stream::is_moving;
use crate::calib::parameters::WornSpot;
use crate::calib::views::view::View;
use armcal_core::joints::{JointAngles, MAX_JOINTS};
use armcal_core::robot::Robot;

/// A view is suspicious beyond this quantile of the normal by its cost (one in ten thousand).
const SUSPICIOUS_Z: f64 = 3.719;
/// The same of a step of one joint's sensor: looked at more often, for it is one direction among many.
const SUSPICIOUS_STEP_Z: f64 = 3.3;
/// What a view costs an explanation under which none of its observations belongs, per observation; that of a rejected
/// one.
pub(crate) const NOTHING_FITS_NATS: f64 = 30.0;
/// What leads by this is taken for true, in nats.
const LEAD_NATS: f64 = 5.0;
/// The same over another explanation by the same sensor: which one it is matters more than how it failed.
const LEAD_OF_SENSOR_NATS: f64 = 1.5;
/// What one view at rest tells by this is taken for a worn spot, in nats.
const LONE_LEAD_NATS: f64 = 10.0;
/// A scale this close to the datasheet's is the drift of a sensor, not another sensor.
const LEAST_SCALE: f64 = 0.2;
/// A lower bump is the nonlinearity of a sound sensor, rad: 0.15 deg.
const LEAST_BUMP_RAD: f64 = 2.6e-3;
/// Explanations followed at most.
const MAX_BRANCHES: usize = 8;
/// What is less probable than the best one by this is not followed any more, in nats.
const HOPELESS_NATS: f64 = 25.0;
/// Views this close to each other are looked at together, s, and how many of them.
const RECENT_S: f64 = 60.0;
const MAX_RECENT: usize = 6;
/// Views after which the best explanation is taken where it is clear that something happened, where it may have been
/// drift, and in any case; and those that one needs.
const MAX_VIEWS_TO_NAME: usize = 2;
const MAX_VIEWS_OF_DRIFT: usize = 3;
const MAX_VIEWS: usize = 5;
const CONFIRMED_BY: usize = 2;
/// The same for another scale: its two numbers explain any two views.
const SCALE_CONFIRMED_BY: usize = 3;

/// One explanation, and the belief under it.
#[derive(Clone)]
pub(crate) struct Branch {
    pub fault: Option<Fault>,
    pub filter: Filter,
    /// `ln` of its odds.
    nats: f64,
}

impl Branch {
    /// Whether it explains by another scale or a bump that is none.
    fn is_void(&self, before: &Filter) -> bool {
        let Some(fault) = self.fault else { return false };
        let size = fault.size(before, &self.filter);
        match fault {
            Fault::Scale(_) => size.is_none_or(|gain| (gain - 1.0).abs() < LEAST_SCALE),
            Fault::Worn(..) => size.is_none_or(|height_rad| height_rad.abs() < LEAST_BUMP_RAD),
            _ => false,
        }
    }

    /// Whether it tells of something.
    fn tells(&self) -> bool {
        !matches!(self.fault, None | Some(Fault::Drift))
    }
}

/// Explanations of what the last views show.
#[derive(Clone)]
pub(crate) struct Race {
    /// The best one first.
    branches: Vec<Branch>,
    /// The belief before the first suspicious view.
    before: Filter,
    n_views: usize,
    /// Of these, after it began.
    n_later: usize,
    /// Views of each tag of the robot.
    n_views_of: Vec<usize>,
    /// Where the joints stood in each view.
    seen: Vec<SeenAt>,
}

/// Where the joints stood in a view.
#[derive(Clone)]
struct SeenAt {
    travel_rad: JointAngles,
    is_resting: bool,
}

/// What a race ended with.
pub(crate) struct Verdict {
    pub fault: Fault,
    pub size: Option<f64>,
    /// How far it leads the next explanation.
    pub lead_nats: f64,
    pub next: Option<Fault>,
}

/// The last few views close to each other in time: what one of them is too weak to show, they may show together.
#[derive(Clone)]
pub(crate) struct RecentViews {
    /// The belief before them, widened until the first.
    pub before: Filter,
    /// Their evidence, as they were taken in.
    pub nats: f64,
    pub views: Vec<View>,
    sums: [WalkScore; MAX_JOINTS],
}

impl RecentViews {
    pub(crate) fn new(before: Filter) -> Self {
        Self { before, nats: 0.0, views: Vec::new(), sums: [WalkScore::default(); MAX_JOINTS] }
    }

    /// Whether `view` belongs to another group.
    pub(crate) fn is_past(&self, view: &View) -> bool {
        let last = self.views.last().map_or(view.end, |last| last.end);
        self.views.len() >= MAX_RECENT || view.end.since_s(last) > RECENT_S
    }

    pub(crate) fn add(&mut self, view: &View, update: Option<&ViewUpdate>) {
        self.views.push(view.clone());
        self.nats += update.map_or(0.0, |update| update.log_evidence);
        for (sum, score) in self.sums.iter_mut().zip(update.iter().flat_map(|update| &update.walk)) {
            sum.a += score.a;
            sum.b += score.b;
        }
    }

    /// Whether one joint's offset is pulled the same way by all of them: innovations have no memory, so that their
    /// scores add up like independent numbers.
    pub(crate) fn show_a_step(&self) -> bool {
        self.views.len() > 1 && has_step(&self.sums)
    }
}

fn has_step(scores: &[WalkScore; MAX_JOINTS]) -> bool {
    scores.iter().any(|score| score.a * score.a > SUSPICIOUS_STEP_Z.powi(2) * score.b)
}

/// Whether a view is beyond what its noise explains: by its cost, by an observation that does not belong, or by one
/// joint's offset alone (the score test of a step there).
pub(crate) fn is_suspicious(update: &ViewUpdate) -> bool {
    let n = update.n_coordinates.max(1) as f64;
    // Wilson and Hilferty 1931.
    let by = 2.0 / (9.0 * n);
    let is_costly = update.cost > n * (1.0 - by + SUSPICIOUS_Z * by.sqrt()).powi(3);
    is_costly || has_step(&update.walk) || !update.rejected.is_empty()
}

impl Race {
    /// Of all that could explain the views, which the belief before them does not.
    pub(crate) fn start(robot: &Robot, RecentViews { before, views, .. }: &RecentViews) -> Self {
        let mut tags: Vec<usize> = views.iter().flat_map(|view| &view.tags).map(|tag| tag.tag_idx).collect();
        tags.sort_unstable();
        tags.dedup();
        let faults = views.last().map(|last| Fault::all(before, &tags, last)).unwrap_or_default();
        let faults = faults.into_iter().map(Some);
        let branch = |fault: Option<Fault>| {
            let mut filter = before.clone();
            if let Some(fault) = fault {
                fault.open(&mut filter, robot);
            }
            let nats = fault.map_or(0.0, Fault::ln_prior);
            Branch { fault, filter, nats }
        };
        let branches = std::iter::once(None).chain(faults).map(branch).collect();
        let n_views_of = vec![0; robot.tags.len()];
        let mut race = Self { branches, before: before.clone(), n_views: 0, n_later: 0, n_views_of, seen: Vec::new() };
        views.iter().for_each(|view| race.add(robot, view));
        race.n_later = 0;
        race.branches = keep_best(race.branches);
        race
    }

    /// Every explanation takes the view in.
    pub(crate) fn add(&mut self, robot: &Robot, view: &View) {
        self.n_views += 1;
        self.n_later += 1;
        self.seen.push(SeenAt { travel_rad: view.travel_rad, is_resting: !is_moving(view) });
        view.tags.iter().for_each(|tag| self.n_views_of[tag.tag_idx] += 1);
        for branch in &mut self.branches {
            branch.nats += match branch.filter.update(robot, &seen_by(branch.fault, view)) {
                Some(update) => update.log_evidence,
                None => -NOTHING_FITS_NATS * view.tags.len() as f64,
            };
        }
        let is_void = |branch: &Branch| branch.is_void(&self.before);
        self.branches.sort_by(|a, b| is_void(a).cmp(&is_void(b)).then(b.nats.total_cmp(&a.nats)));
        let best = self.nats();
        self.branches.retain(|branch| branch.fault.is_none() || best - branch.nats < HOPELESS_NATS);
    }

    /// Widens every explanation.
    pub(crate) fn widen(&mut self, by: impl Fn(&Filter) -> Vec<(usize, f64)>) {
        for branch in &mut self.branches {
            let columns = by(&branch.filter);
            branch.filter.widen(&columns);
        }
    }

    /// The best explanation so far.
    pub(crate) fn best(&self) -> Option<&Branch> {
        self.branches.first()
    }

    /// The belief to go on with: the best explanation's, that nothing happened where it is not confirmed.
    pub(crate) fn belief(&self) -> Option<&Filter> {
        let nothing = || self.branches.iter().find(|branch| branch.fault.is_none());
        let best = self.best().filter(|best| self.is_confirmed(best.fault)).or_else(nothing).or(self.best());
        best.map(|branch| &branch.filter)
    }

    /// `ln` of the odds of the best explanation so far.
    pub(crate) fn nats(&self) -> f64 {
        self.branches.first().map_or(0.0, |branch| branch.nats)
    }

    /// Whether it is decided: one view alone names nothing.
    pub(crate) fn is_over(&self) -> bool {
        let Some(best) = self.best().filter(|best| self.is_confirmed(best.fault)) else {
            return self.n_later >= MAX_VIEWS;
        };
        let may_name = |other: &Branch| match other.fault {
            None => false,
            Some(Fault::Drift) => best.tells() && self.n_later >= MAX_VIEWS_OF_DRIFT,
            Some(_) => best.tells() && self.n_later >= MAX_VIEWS_TO_NAME,
        };
        let is_behind = |other: &Branch| {
            let is_of_sensor = best.fault.zip(other.fault).is_some_and(|(one, other)| one.is_of_same_sensor(other));
            let lead = if is_of_sensor { LEAD_OF_SENSOR_NATS } else { LEAD_NATS };
            best.nats - other.nats > lead || may_name(other)
        };
        self.n_later >= MAX_VIEWS || self.others().all(is_behind)
    }

    /// Whether enough views could have spoken against it. A detection of another tag happens once; a tag that was moved
    /// is there again.
    fn is_confirmed(&self, fault: Option<Fault>) -> bool {
        match fault {
            None => true,
            // What drifted shows in all views; a weak one must not settle it.
            Some(Fault::Drift) => self.n_later >= MAX_VIEWS,
            Some(Fault::Tag(tag)) => self.n_views_of[tag] >= CONFIRMED_BY,
            Some(Fault::Worn(joint, spot)) => self.is_spot_confirmed(joint, spot),
            Some(Fault::Scale(_)) => self.n_views >= SCALE_CONFIRMED_BY,
            Some(_) => self.n_views >= CONFIRMED_BY,
        }
    }

    /// Views of the spot alone do not tell it from a slip; one view of it alone may be a mistake, unless the arm was at
    /// rest and it is clear.
    fn is_spot_confirmed(&self, joint: usize, spot: WornSpot) -> bool {
        let later = &self.seen[self.seen.len() - self.n_later..];
        if !later.iter().any(|seen| spot.is_far_from(seen.travel_rad[joint])) {
            return false;
        }
        let about = || self.seen.iter().filter(|seen| spot.is_about(seen.travel_rad[joint]));
        let nats = |fault| self.branches.iter().find(|branch| branch.fault == fault).map_or(f64::MIN, |b| b.nats);
        let lead_nats = nats(Some(Fault::Worn(joint, spot))) - nats(None);
        about().count() >= CONFIRMED_BY || (lead_nats > LONE_LEAD_NATS && about().any(|seen| seen.is_resting))
    }

    fn lead_nats(&self) -> f64 {
        match (self.best(), self.others().next()) {
            (Some(first), Some(second)) => first.nats - second.nats,
            _ => f64::INFINITY,
        }
    }

    /// All explanations but the best, those aside that are none.
    fn others(&self) -> impl Iterator<Item = &Branch> {
        self.branches.iter().skip(1).filter(|branch| !branch.is_void(&self.before))
    }

    /// What it ended with; `None` where nothing happened.
    pub(crate) fn verdict(&self) -> Option<Verdict> {
        let best = self.branches.first()?;
        let fault = best.fault.filter(|fault| *fault != Fault::Drift && self.is_confirmed(best.fault))?;
        let size = fault.size(&self.before, &best.filter);
        Some(Verdict {
            fault,
            size,
            lead_nats: self.lead_nats(),
            next: self.others().next().and_then(|branch| branch.fault),
        })
    }
}

/// The best ones, and that nothing happened.
fn keep_best(branches: Vec<Branch>) -> Vec<Branch> {
    let all = branches.into_iter().enumerate();
    let kept = all.filter(|(place, branch)| *place < MAX_BRANCHES || branch.fault.is_none());
    kept.map(|(_, branch)| branch).collect()
}

/// A view under a fault: a failed sensor's reading is not looked at.
pub(crate) fn seen_by(fault: Option<Fault>, view: &View) -> View {
    let mut view = view.clone();
    if let Some(Fault::Failed(joint)) = fault {
        view.is_free[joint] = true;
    }
    view
}
