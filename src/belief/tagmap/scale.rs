//! Wrong tag sizes, from tags with a known distance.
//!
//! A square solved with a size that is too large by a factor lies farther away by the same factor. It stays on the same
//! line of sight. Two tags of known distance D are at p_a and p_b (camera frame). The equation `|s_a p_a - s_b p_b| =
//! D` holds for the factors s of their true sizes over the stated ones: 1 for a correct size.

use crate::tagmap::constants::scale::{
    EXPLAINS, FARTHEST, LEAST_FACTOR, MAX_ROOTS, MAX_SAMPLES, ONE_PLACE_M, SURE_SHARE,
};
use nalgebra::Vector3;

use crate::tagmap::screen::Screened;
use crate::tagmap::tag_pairs::is_rigid;
use crate::tagmap::types::MapInput;

/// A size that cannot be right.
#[derive(Clone, Debug, PartialEq)]
pub struct ScaleWarning {
    /// Tags whose sizes have the same wrong factor: all tags with a known place, or one.
    pub tags: Vec<u32>,
    /// Factor by which their sizes would agree with the known distances.
    pub factor: f64,
}

impl std::fmt::Display for ScaleWarning {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let ids: Vec<String> = self.tags.iter().map(u32::to_string).collect();
        let tags = if ids.len() == 1 { "tag" } else { "tags" };
        let (ids, factor) = (ids.join(", "), self.factor);
        write!(
            f,
            "size_m of {tags} {ids} disagrees with the known distances between tags; {factor:.3} times it would agree"
        )
    }
}

/// Two tags of known distance in one image.
struct Sample {
    a: u32,
    b: u32,
    at_a: Vector3<f64>,
    at_b: Vector3<f64>,
    distance_m: f64,
}

impl Sample {
    /// Error of the distance with the sizes multiplied, natural logarithm of its ratio to the known one.
    fn disagreement(&self, factor_of: &impl Fn(u32) -> f64) -> f64 {
        let measured = (self.at_a * factor_of(self.a) - self.at_b * factor_of(self.b)).norm();
        (measured / self.distance_m).ln().abs().min(FARTHEST)
    }

    /// Factors of tag `of`, with the other held, that give the known distance.
    fn roots(&self, of: u32) -> Vec<f64> {
        let (free, held) = if of == self.a { (&self.at_a, &self.at_b) } else { (&self.at_b, &self.at_a) };
        let (a, b) = (free.norm_squared(), free.dot(held));
        let c = held.norm_squared() - self.distance_m * self.distance_m;
        let under = b * b - a * c;
        if under < 0.0 {
            // No factor reaches the distance; the nearest approach is the best one.
            return vec![b / a];
        }
        vec![(b - under.sqrt()) / a, (b + under.sqrt()) / a]
    }
}

pub(super) fn check(input: &MapInput<'_>, screened: &Screened) -> Vec<ScaleWarning> {
    let samples = samples(input, screened);
    let mut ids: Vec<u32> = samples.iter().flat_map(|sample| [sample.a, sample.b]).collect();
    ids.sort_unstable();
    ids.dedup();
    let mean = |factor_of: &dyn Fn(u32) -> f64| {
        samples.iter().map(|s| s.disagreement(&|id| factor_of(id))).sum::<f64>() / samples.len().max(1) as f64
    };
    let mut warnings: Vec<ScaleWarning> = Vec::new();
    let mut now = mean(&|_| 1.0);
    while now > LEAST_FACTOR.ln() * 0.5 && warnings.len() < ids.len() {
        let before = |id: u32| warnings.iter().filter(|w| w.tags.contains(&id)).map(|w| w.factor).product::<f64>();
        let mut best: Option<(f64, ScaleWarning)> = None;
        let mut consider = |tags: &[u32], factor: f64| {
            if !(factor.is_finite() && factor > 0.0) {
                return;
            }
            let left = mean(&|id| before(id) * if tags.contains(&id) { factor } else { 1.0 });
            if best.as_ref().is_none_or(|(least, _)| left < *least) {
                best = Some((left, ScaleWarning { tags: tags.to_vec(), factor }));
            }
        };
        // All tags together come first: of equally good explanations this is the more probable one.
        if warnings.is_empty() {
            let ratio = |s: &Sample| s.distance_m / (s.at_a - s.at_b).norm();
            thinned(samples.iter().map(ratio).collect(), MAX_ROOTS)
                .into_iter()
                .for_each(|factor| consider(&ids, factor));
        }
        for id in ids.iter().filter(|id| before(**id) == 1.0) {
            let of_tag = samples.iter().filter(|sample| sample.a == *id || sample.b == *id);
            let roots = of_tag.flat_map(|sample| sample.roots(*id)).collect();
            thinned(roots, MAX_ROOTS).into_iter().for_each(|factor| consider(&[*id], factor));
        }
        let Some((left, warning)) = best else { break };
        let is_small = (1.0 / LEAST_FACTOR..=LEAST_FACTOR).contains(&warning.factor);
        // With several wrong sizes, one explanation removes only its share.
        let share = 1.0 - (1.0 - EXPLAINS) / ids.len().max(1) as f64;
        if is_small || left > share * now {
            break;
        }
        now = left;
        warnings.push(warning);
    }
    warnings
}

/// Selects at most `most` values, evenly over the sorted ones.
fn thinned(mut values: Vec<f64>, most: usize) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    if n <= most { values } else { (0..most).map(|k| values[k * n / most]).collect() }
}

fn samples(input: &MapInput<'_>, screened: &Screened) -> Vec<Sample> {
    let place = |id: u32| {
        let tag = input.tags.iter().find(|tag| tag.id == id)?;
        // A place with a large sigma determines no distance.
        let is_sure = tag.std.is_none_or(|std| std[..3].iter().all(|std| *std < SURE_SHARE * tag.size_m));
        let pose = tag.pose.filter(|_| is_sure)?;
        let body = &input.bodies[tag.body];
        Some((tag.body, body.pose.map(|body| body * pose), pose))
    };
    let places: Vec<_> = screened.tags.iter().map(|tag| place(tag.id)).collect();
    let mut samples = Vec::new();
    for of_view in screened.observations.chunk_by(|a, b| a.view == b.view) {
        for (i, a) in of_view.iter().enumerate() {
            for b in &of_view[i + 1..] {
                let (Some(of_a), Some(of_b)) = (&places[a.tag], &places[b.tag]) else { continue };
                let between = match (of_a, of_b) {
                    (a, b) if a.0 == b.0 => a.2.translation.vector - b.2.translation.vector,
                    ((body_a, Some(a), _), (body_b, Some(b), _)) if is_rigid(input.bodies, *body_a, *body_b) => {
                        a.translation.vector - b.translation.vector
                    }
                    _ => continue,
                };
                let center = |seen: &crate::tagmap::problem::Observation| {
                    seen.best.camera_from_tag.isometry().translation.vector
                };
                let (a, b, at_a, at_b) = (screened.tags[a.tag].id, screened.tags[b.tag].id, center(a), center(b));
                let distance_m = between.norm();
                if distance_m > ONE_PLACE_M {
                    samples.push(Sample { a, b, at_a, at_b, distance_m });
                }
            }
        }
    }
    let n = samples.len();
    if n > MAX_SAMPLES {
        let mut at = 0;
        samples.retain(|_| {
            at += 1;
            (at * MAX_SAMPLES) / n != ((at - 1) * MAX_SAMPLES) / n
        });
    }
    samples
}
