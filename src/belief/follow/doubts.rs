//! Contradictions to the estimate as a whole: repeated images, a base that keeps moving, a changed lens.
//!
//! Each explanation of a view is one thing that moved or failed once. Clocks that jump, images that stand still and
//! another lens are none of these. They result in large or repeated moves, after which the covariance means nothing.

use crate::follow::constants::doubts::{
    BASE_MOVES, FROZEN_VIEWS, MAX_BASE_SHARE, MOVED_AGAIN, MOVED_RAD, RECENT_VIEWS, SAME_PX,
};
use crate::follow::event::OnlineEvent;
use crate::say::doubt::Doubt;
use crate::say::finding::{Finding, FindingKind};
use crate::views::conditions::apart_rad;
use crate::views::view::View;
use armcal_core::robot::Robot;

/// Images and events so far that may contradict the estimate.
#[derive(Clone, Default)]
pub(crate) struct Doubts {
    /// The first view with the latest image.
    image: Option<View>,
    /// Number of consecutive views that repeat this image.
    n_frozen: usize,
    /// Events of the last views, each with the number of views at that time.
    recent: Vec<(usize, Finding)>,
    lasting: Option<Doubt>,
}

impl Doubts {
    /// Returns true if `view` has the image of the view before it although a joint proximal to the camera has moved
    /// since.
    pub(crate) fn repeats_image(&mut self, view: &View, robot: &Robot) -> bool {
        let before = self.image.as_ref().filter(|before| shows_same(before, view));
        let Some(has_moved) = before.map(|before| has_moved(before, view, robot)) else {
            (self.image, self.n_frozen) = (Some(view.clone()), 0);
            return false;
        };
        self.n_frozen += usize::from(has_moved);
        has_moved
    }

    /// Adds the events of view number `n_views`; `reach_m` is the arm's reach.
    pub(crate) fn hear(&mut self, events: &[OnlineEvent], n_views: usize, reach_m: f64) {
        for event in events {
            self.recent.retain(|(at, _)| n_views.saturating_sub(*at) <= RECENT_VIEWS);
            self.recent.push((n_views, event.finding.clone()));
            self.lasting = self.lasting.or_else(|| self.of_base(reach_m)).or_else(|| self.of_lens());
        }
    }

    /// Returns the present doubt. Images may change again; all other doubts stay, because the estimate includes their
    /// events.
    pub(crate) fn now(&self) -> Option<Doubt> {
        let frozen = (self.n_frozen >= FROZEN_VIEWS).then_some(Doubt::FrozenImages { views: self.n_frozen });
        frozen.or(self.lasting)
    }

    fn of_base(&self, reach_m: f64) -> Option<Doubt> {
        let moves = self.recent.iter().filter(|(_, finding)| finding.kind == FindingKind::Base);
        let sizes_m: Vec<f64> = moves.filter_map(|(_, finding)| finding.size).collect();
        let most_m = sizes_m.iter().copied().fold(0.0, f64::max);
        let is_doubtful = sizes_m.len() >= BASE_MOVES || most_m > MAX_BASE_SHARE * reach_m;
        is_doubtful.then_some(Doubt::Base { times: sizes_m.len(), most_m })
    }

    /// A single tag may be loose. Several together, or the mount, do not move repeatedly.
    fn of_lens(&self) -> Option<Doubt> {
        let moved: Vec<&Finding> = self.recent.iter().map(|(_, finding)| finding).filter(|f| is_of_images(f)).collect();
        let is_again = |&k: &usize| {
            moved[k].kind != FindingKind::TagMoved && moved[..k].iter().any(|earlier| is_of_same(earlier, moved[k]))
        };
        let n_again = (0..moved.len()).filter(is_again).count();
        (n_again >= MOVED_AGAIN).then_some(Doubt::Lens { events: moved.len() })
    }
}

fn is_of_images(finding: &Finding) -> bool {
    matches!(finding.kind, FindingKind::CameraMount | FindingKind::TagMoved | FindingKind::TagsMoved)
}

/// Returns true if both findings name one of the tags, or the mount.
fn is_of_same(a: &Finding, b: &Finding) -> bool {
    names(a).any(|name| names(b).any(|other| other == name))
}

/// The tags that an event names, or the mount.
fn names(finding: &Finding) -> impl Iterator<Item = &str> {
    finding.name.split(", ").flat_map(|names| names.split(" and "))
}

/// Returns true if both views show the same tags at the same corners, to rounding.
fn shows_same(a: &View, b: &View) -> bool {
    let is_seen = !a.tags.is_empty() && a.tags.len() == b.tags.len() && a.camera == b.camera;
    is_seen
        && a.tags.iter().zip(&b.tags).all(|(a, b)| {
            let Some((of_a, of_b)) = a.corners().zip(b.corners()) else { return false };
            let mut both = of_a.corners_px.iter().flatten().zip(of_b.corners_px.iter().flatten());
            a.tag_idx == b.tag_idx && both.all(|(a, b)| (a - b).abs() < SAME_PX)
        })
}

/// Returns true if a joint proximal to the camera has another angle.
fn has_moved(before: &View, now: &View, robot: &Robot) -> bool {
    let mut sensors = robot.sensors.iter().enumerate().take(robot.n_seen_joints());
    sensors.any(|(joint, spec)| apart_rad(spec, now.travel_rad[joint], before.travel_rad[joint]).abs() > MOVED_RAD)
}
