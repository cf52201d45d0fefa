//! The study's tables.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use nalgebra::Vector2;

use crate::noise_fit::FittedNoise;
use crate::scenes::water_name;
use crate::trials::{DetectionStudy, Outcome, TagTrial};
use armcal_core::stats::quantile;

/// Error of each corner, px, with its squared size in units of the detector's own covariance.
fn errors(trial: &TagTrial) -> Vec<(Vector2<f64>, f64, f64)> {
    let Outcome::Found { corners_px, covariances_px2 } = &trial.outcome else { return Vec::new() };
    (0..4)
        .filter_map(|k| {
            let error = Vector2::from(corners_px[k]) - Vector2::from(trial.truth_px[k]);
            let inverse = covariances_px2[k].try_inverse()?;
            Some((error, (error.transpose() * inverse * error).x, (0.5 * covariances_px2[k].trace()).sqrt()))
        })
        .collect()
}

fn outcome_name(outcome: &Outcome) -> &'static str {
    match outcome {
        Outcome::Missed => "missed",
        Outcome::Rejected(reason) => reason.name(),
        Outcome::Found { .. } => "found",
    }
}

fn deg(rad: f64) -> f64 {
    rad.to_degrees()
}

/// CSV with one line per tag: condition, outcome, error of each corner, and the detector's standard deviation.
#[must_use]
pub fn trials_csv(study: &DetectionStudy) -> String {
    let mut out = String::from("image,water,blur_px,range_m,incidence_deg,view_angle_deg,id,shortest_side_px,outcome");
    for k in 0..4 {
        let _ = write!(out, ",dx{k}_px,dy{k}_px,std{k}_px,chi_square{k}");
    }
    out.push('\n');
    for trial in &study.trials {
        let condition = &trial.condition;
        let _ = write!(
            out,
            "{},{},{},{},{:.1},{:.2},{},{:.2},{}",
            trial.image,
            water_name(condition.water),
            condition.blur_px,
            condition.range_m,
            deg(trial.incidence_rad),
            deg(trial.view_angle_rad),
            trial.id,
            trial.shortest_side_px,
            outcome_name(&trial.outcome),
        );
        let errors = errors(trial);
        for (error, chi_square, std) in &errors {
            let _ = write!(out, ",{:.4},{:.4},{std:.4},{chi_square:.2}", error.x, error.y);
        }
        if errors.is_empty() {
            out.push_str(&",".repeat(16));
        }
        out.push('\n');
    }
    out
}

/// CSV for other detectors to compare with: image, condition, id, corners.
#[must_use]
pub fn truth_csv(study: &DetectionStudy) -> String {
    let mut out = String::from(
        "image,water,blur_px,range_m,incidence_deg,id,shortest_side_px,x0,y0,x1,y1,x2,y2,x3,y3,found,fx0,fy0,fx1,fy1,\
         fx2,fy2,fx3,fy3\n",
    );
    for trial in &study.trials {
        let condition = &trial.condition;
        let _ = write!(
            out,
            "{},{},{},{},{:.1},{},{:.3}",
            trial.image,
            water_name(condition.water),
            condition.blur_px,
            condition.range_m,
            deg(trial.incidence_rad),
            trial.id,
            trial.shortest_side_px
        );
        let _ = trial.truth_px.iter().flatten().try_for_each(|x| write!(out, ",{x:.5}"));
        match &trial.outcome {
            Outcome::Found { corners_px, .. } => {
                out.push_str(",1");
                let _ = corners_px.iter().flatten().try_for_each(|x| write!(out, ",{x:.5}"));
            }
            _ => out.push_str(",0,,,,,,,,"),
        }
        out.push('\n');
    }
    out
}

/// Sums over some trials.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    n: usize,
    n_found: usize,
    squares: f64,
    variances: f64,
    chi_squares: f64,
}

impl Sums {
    fn add(&mut self, trial: &TagTrial) {
        self.n += 1;
        let errors = errors(trial);
        self.n_found += usize::from(!errors.is_empty());
        for (error, chi_square, std) in errors {
            self.squares += error.norm_squared();
            self.variances += std * std;
            self.chi_squares += chi_square;
        }
    }

    fn rate(&self) -> f64 {
        self.n_found as f64 / self.n.max(1) as f64
    }

    /// Error per coordinate, rms, px: measured, and by the detector's covariances.
    fn rms_px(&self) -> [f64; 2] {
        let corners = 4.0 * self.n_found.max(1) as f64;
        [(self.squares / corners / 2.0).sqrt(), (self.variances / corners).sqrt()]
    }

    fn mean_chi_square(&self) -> f64 {
        self.chi_squares / (4.0 * self.n_found.max(1) as f64)
    }
}

/// CSV with one line per condition: detection rate, rms error of a corner coordinate, its value by the detector's
/// covariances. The last figure is the mean squared normalised error of a corner (2 where the covariances are right).
#[must_use]
pub fn conditions_csv(study: &DetectionStudy) -> String {
    let mut by_condition = BTreeMap::<[i64; 4], (&TagTrial, Sums)>::new();
    for trial in &study.trials {
        let c = &trial.condition;
        let key =
            [c.water as i64, (c.blur_px * 1e3) as i64, (c.range_m * 1e3) as i64, (trial.incidence_rad * 1e6) as i64];
        by_condition.entry(key).or_insert_with(|| (trial, Sums::default())).1.add(trial);
    }
    let mut out =
        String::from("water,blur_px,range_m,incidence_deg,n,found,rate,rms_px,predicted_rms_px,mean_chi_square\n");
    for (trial, sums) in by_condition.values() {
        let c = &trial.condition;
        let _ = write!(out, "{},{},{},", water_name(c.water), c.blur_px, c.range_m);
        let _ = write!(out, "{:.0},{},{},{:.4}", deg(trial.incidence_rad), sums.n, sums.n_found, sums.rate());
        if sums.n_found > 0 {
            let [rms, predicted] = sums.rms_px();
            let _ = writeln!(out, ",{rms:.4},{predicted:.4},{:.3}", sums.mean_chi_square());
        } else {
            out.push_str(",,,\n");
        }
    }
    out
}

/// Report of rates and errors by water and range, the fitted models, and the time per image.
#[must_use]
pub fn report(study: &DetectionStudy, fitted: &[FittedNoise]) -> String {
    let mut by_range = BTreeMap::<(usize, i64), (&TagTrial, Sums)>::new();
    for trial in &study.trials {
        let key = (trial.condition.water as usize, (trial.condition.range_m * 1e3) as i64);
        by_range.entry(key).or_insert_with(|| (trial, Sums::default())).1.add(trial);
    }
    let mut out = String::from("water    range m  tags  found %  rms px  predicted px  mean chi-square (2)\n");
    for (trial, sums) in by_range.values() {
        let [rms, predicted] = sums.rms_px();
        let _ = writeln!(
            out,
            "{:8} {:7.2} {:5} {:8.1} {rms:7.3} {predicted:13.3} {:20.2}",
            water_name(trial.condition.water),
            trial.condition.range_m,
            sums.n,
            100.0 * sums.rate(),
            sums.mean_chi_square()
        );
    }
    let mut reasons = BTreeMap::<&str, usize>::new();
    for trial in &study.trials {
        *reasons.entry(outcome_name(&trial.outcome)).or_default() += 1;
    }
    let _ = writeln!(out, "outcomes {reasons:?}; detections of no tag: {}", study.n_false);
    for fit in fitted {
        let (noise, chance) = (&fit.noise, &fit.noise.chance);
        let _ = writeln!(
            out,
            "{:8} edge_std_px {:.4}, contrast_loss_per_m {:.3}, floor_std_px {:.4}; half_side_px {:.2}, side_width_px \
             {:.2}, half_range_m {:.2}, range_width_m {:.2}; {} corners, mean chi-square \
             {:.2}",
            water_name(fit.water),
            noise.edge_std_px,
            noise.contrast_loss_per_m,
            noise.floor_std_px,
            chance.half_side_px,
            chance.side_width_px,
            chance.half_range_m,
            chance.range_width_m,
            fit.n_corners,
            fit.mean_chi_square
        );
    }
    let ms = |times: &[f64], q: f64| 1e3 * quantile(times, q).unwrap_or(f64::NAN);
    let _ = writeln!(
        out,
        "{} images: render {:.0} ms, detect {:.0} ms (medians), detect 95 % {:.0} ms",
        study.n_images,
        ms(&study.render_s, 0.5),
        ms(&study.detect_s, 0.5),
        ms(&study.detect_s, 0.95)
    );
    out
}
