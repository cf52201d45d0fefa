//! Rows as Markdown and as CSV.

use std::fmt::Write as _;

use crate::study::experiments::Experiment;
use crate::study::scene::{Guess, PoseSampling, Readings};
use crate::study::trials::PaperRow;

fn mm(metres: f64) -> String {
    let mm = 1e3 * metres;
    match mm {
        _ if mm.is_nan() => "-".to_owned(),
        _ if mm < 1e-4 => format!("{mm:.0e}"),
        _ if mm < 0.1 => format!("{mm:.4}"),
        _ if mm < 10.0 => format!("{mm:.2}"),
        _ => format!("{mm:.1}"),
    }
}

fn data(row: &PaperRow) -> String {
    let s = &row.setting;
    let mut text = format!("{} x {}, {} mm", s.poses, s.tags, 1e3 * s.noise_m);
    if (s.gain_error, s.offset_error_rad) != (0.05, 5.0_f64.to_radians()) {
        let _ = write!(text, ", {:.1} %, {:.1} deg", 100.0 * s.gain_error, s.offset_error_rad.to_degrees());
    }
    if s.readings == Readings::WholeCounts {
        text.push_str(", whole counts");
    }
    if s.sight == PoseSampling::InImage {
        text.push_str(", in the image");
    }
    if s.guess == Guess::Truth {
        text.push_str(", from the truth");
    }
    text
}

/// Tables in Markdown, one per experiment; tool errors in mm.
#[must_use]
pub fn paper_markdown(experiments: &[Experiment], rows: &[PaperRow]) -> String {
    let mut out = String::from(
        "Tool error in mm: of each draw the root mean square over 100 random poses; over the draws its root mean \
         square, median and 95th percentile. Bound: Cramer-Rao, map known, all gains and offsets unknown. Over LS: \
         root mean square over that \
         of least squares on the same draws. Cost: medians of the method's own equation. Data: poses x landmarks, \
         noise per axis.\n",
    );
    for experiment in experiments {
        let _ = writeln!(out, "\n## {}\n", experiment.title);
        out.push_str(
            "| data | method | rms | median | 95 % | bound | over LS | before | cost at first | cost at end | \
             evaluations | converged | paper |\n\
             |---|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n",
        );
        for row in rows.iter().filter(|row| row.experiment == experiment.name) {
            let _ = writeln!(
                out,
                "| {} | {} | {} | {} | {} | {} | {} | {} | {:.3e} | {:.3e} | {:.0} | {} of {} | {} |",
                data(row),
                row.contender,
                mm(row.tool_rms_m),
                mm(row.tool_median_m),
                mm(row.tool_p95_m),
                row.bound_rms_m.map_or_else(String::new, mm),
                row.over_least_squares
                    .filter(|_| row.setting.noise_m > 0.0)
                    .map_or_else(String::new, |r| format!("{r:.3}")),
                mm(row.before_rms_m),
                row.cost_initial_median,
                row.cost_final_median,
                row.evaluations_median,
                row.converged,
                row.draws,
                row.paper,
            );
        }
    }
    out
}

/// Rows as CSV in SI units, one line per row.
#[must_use]
pub fn paper_csv(rows: &[PaperRow]) -> String {
    let mut out = String::from(
        "experiment,method,poses,landmarks,noise_m,gain_error,offset_error_rad,whole_counts,in_image,from_the_truth,\
         draws,tool_rms_m,tool_median_m,tool_p95_m,bound_rms_m,over_least_squares,before_rms_m,cost_initial_median,\
         cost_final_median,evaluations_median,\
         converged,paper\n",
    );
    let optional = |value: Option<f64>| value.map_or_else(String::new, |value| format!("{value:.6e}"));
    for row in rows {
        let s = &row.setting;
        let _ = writeln!(
            out,
            "{},\"{}\",{},{},{},{},{:.6},{},{},{},{},{:.6e},{:.6e},{:.6e},{},{},{:.6e},{:.6e},{:.6e},{},{},{}",
            row.experiment,
            row.contender,
            s.poses,
            s.tags,
            s.noise_m,
            s.gain_error,
            s.offset_error_rad,
            s.readings == Readings::WholeCounts,
            s.sight == PoseSampling::InImage,
            s.guess == Guess::Truth,
            row.draws,
            row.tool_rms_m,
            row.tool_median_m,
            row.tool_p95_m,
            optional(row.bound_rms_m),
            optional(row.over_least_squares),
            row.before_rms_m,
            row.cost_initial_median,
            row.cost_final_median,
            row.evaluations_median,
            row.converged,
            row.paper,
        );
    }
    out
}
