//! True distances of the links from their estimated positions, against the predicted quantiles.

use std::collections::BTreeMap;

use crate::score::MarginSummary;
use armcal_belief::plan::link_ends;
use armcal_belief::session::Visit;
use armcal_core::robot::Robot;
use armcal_sim::truth::Truth;

/// Summary over all captured views and links; `None` without any.
pub(super) fn margins(visits: &[Visit], robot: &Robot, truth: &Truth) -> Option<MarginSummary> {
    let mut summary =
        MarginSummary { links: 0, exceeded_q99: 0, largest_m: 0.0, first_largest_m: None, by_views: Vec::new() };
    let mut by_views: BTreeMap<usize, [usize; 2]> = BTreeMap::new();
    let arm = truth.header.as_built.arm(robot);
    for visit in visits {
        let Some(state) = truth.state_at(visit.at) else { continue };
        let believed = link_ends(robot, &robot.chain.link_poses(&visit.believed));
        let there = link_ends(&arm, &arm.chain.link_poses(&state.angles));
        let mut largest_m = 0.0_f64;
        for ((believed, there), q99_m) in believed.iter().zip(&there).zip(&visit.link_q99_m) {
            let displacement_m = (believed - there).norm();
            // The first joint does not move its own link's end where that lies on its axis.
            if *q99_m <= 1e-9 {
                continue;
            }
            summary.links += 1;
            let is_beyond = usize::from(displacement_m > *q99_m);
            summary.exceeded_q99 += is_beyond;
            let of_belief = by_views.entry(visit.belief_views).or_default();
            *of_belief = [of_belief[0] + 1, of_belief[1] + is_beyond];
            largest_m = largest_m.max(displacement_m);
        }
        summary.first_largest_m.get_or_insert(largest_m);
        summary.largest_m = summary.largest_m.max(largest_m);
    }
    summary.by_views = by_views.into_iter().map(|(views, [links, beyond])| [views, links, beyond]).collect();
    (summary.links > 0).then_some(summary)
}
