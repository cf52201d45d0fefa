//! The study's table and CSV.

use std::fmt::Write as _;

use crate::falsified::cases::{CaseKind, kind_name};
use crate::falsified::run::{FalsifiedRow, FalsifiedStudy, RunStatus};
use armcal_core::stats::{Summary, quantile};

fn status_name(status: RunStatus) -> &'static str {
    match status {
        RunStatus::Accepted => "accepted",
        RunStatus::Refused => "refused",
        RunStatus::Failed => "failed",
    }
}

/// CSV with one line per calibration; lengths in mm.
#[must_use]
pub fn falsified_csv(rows: &[FalsifiedRow]) -> String {
    let mut out = String::from(
        "seed,kind,element,size,unit,status,named_first,named_rightly,findings,repaired,predicted_median_mm,\
         predicted_p95_mm,with_priors_median_mm,with_priors_p95_mm,true_median_mm,true_p95_mm,wrongly_accepted,\
         non_centrality,oracle_tool_mm,seen,reserved_mm_per_unit,oracle_mm_per_unit,reason\n",
    );
    for row in rows {
        let (factor, unit) = row.case.kind.unit();
        let mm = |summary: Option<Summary>| {
            summary.map_or(",".to_owned(), |s| format!("{:.3},{:.3}", 1e3 * s.median, 1e3 * s.p95))
        };
        let number = |value: Option<f64>| value.map_or(String::new(), |value| format!("{value:.4}"));
        let per_unit = |value: f64| 1e3 * value / factor;
        let oracle = row.oracle;
        let true_per_unit = oracle.filter(|_| row.case.size != 0.0).map(|o| per_unit(o.tool_m / row.case.size.abs()));
        let columns = [
            row.seed.to_string(),
            row.case.kind_name().replace(", ", " with "),
            row.element.clone(),
            format!("{:.3}", row.case.size * factor),
            unit.to_owned(),
            status_name(row.status).to_owned(),
            row.named_first.join("+"),
            row.is_named.map_or(String::new(), |is_named| is_named.to_string()),
            row.findings.join(" "),
            row.repaired.to_string(),
            mm(row.predicted_m),
            mm(row.predicted_with_priors_m),
            mm(row.true_m),
            row.is_wrongly_accepted().to_string(),
            number(oracle.map(|o| o.non_centrality)),
            number(oracle.map(|o| 1e3 * o.tool_m)),
            oracle.map_or(String::new(), |o| o.is_seen().to_string()),
            number(row.reserved_per_unit.map(per_unit)),
            number(true_per_unit),
            format!("\"{}\"", row.reason.replace('"', "'")),
        ];
        let _ = writeln!(out, "{}", columns.join(","));
    }
    out
}

/// Share of the counted rows for which `holds` is true, as `3/4`; empty where no row counts.
fn share<'a>(rows: impl Iterator<Item = &'a FalsifiedRow>, holds: impl Fn(&FalsifiedRow) -> bool) -> String {
    let (mut n, mut n_held) = (0, 0);
    for row in rows {
        n += 1;
        n_held += usize::from(holds(row));
    }
    if n == 0 { String::new() } else { format!("{n_held}/{n}") }
}

/// Rows of each kind, without touches and with them, then all.
fn by_kind(rows: &[FalsifiedRow]) -> Vec<(String, Vec<&FalsifiedRow>)> {
    let mut n_touches: Vec<usize> = rows.iter().map(|row| row.case.n_touches).collect();
    n_touches.sort_unstable();
    n_touches.dedup();
    let each = n_touches.iter().flat_map(|n| CaseKind::ALL.map(|kind| (kind, *n)));
    let of = |(kind, n)| rows.iter().filter(|row| (row.case.kind, row.case.n_touches) == (kind, n)).collect();
    let mut kinds: Vec<_> = each.map(|(kind, n)| (kind_name(kind, n), of((kind, n)))).collect();
    kinds.push(("all".to_owned(), rows.iter().collect()));
    kinds.retain(|(_, of): &(String, Vec<&FalsifiedRow>)| !of.is_empty());
    kinds
}

/// Markdown table with a line for each kind of falsification.
#[must_use]
pub fn falsified_markdown(study: &FalsifiedStudy) -> String {
    let rows = &study.rows;
    let good: Vec<f64> = rows
        .iter()
        .filter(|row| row.case.kind == CaseKind::GoodArm)
        .filter_map(|row| row.predicted_m.map(|predicted| predicted.p95))
        .collect();
    let good_p95_m = quantile(&good, 0.5).unwrap_or(f64::NAN);
    let mut out = format!(
        "predicted of a good arm by the data alone: {:.2} mm (95 % of the targets)\n\n\
         | falsified | n | accepted | refused | repaired | wrongly accepted | seen | seen, > 3 x predicted: refused or \
         repaired | let through with > 3 x | seen: named first | unseen, > predicted: reserved within 10 % |\n\
         |---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n",
        1e3 * good_p95_m
    );
    for (name, of) in by_kind(rows) {
        let count = |holds: &dyn Fn(&FalsifiedRow) -> bool| of.iter().filter(|row| holds(row)).count();
        let each = || of.iter().copied();
        let seen = || each().filter(|row| row.is_seen());
        let is_unseen = |row: &&FalsifiedRow| row.oracle.is_some() && !row.is_seen() && row.case.n_touches == 0;
        let unseen = each().filter(is_unseen).filter(|row| row.matters(1.0, good_p95_m));
        let _ = writeln!(
            out,
            "| {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} |",
            name,
            of.len(),
            count(&|row| row.status == RunStatus::Accepted),
            count(&|row| row.status != RunStatus::Accepted),
            count(&|row| row.repaired > 0),
            count(&FalsifiedRow::is_wrongly_accepted),
            seen().count(),
            share(seen().filter(|row| row.matters(3.0, good_p95_m)), FalsifiedRow::is_refused_or_repaired),
            seen().filter(|row| row.is_let_through(3.0 * good_p95_m)).count(),
            share(each().filter(|row| row.is_to_be_named()), |row| row.is_named == Some(true)),
            share(unseen, FalsifiedRow::is_reserved_rightly),
        );
    }
    let _ = write!(out, "\n{}", study.classes.markdown());
    out
}
