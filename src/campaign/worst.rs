//! The runs to examine first.

use std::cmp::Ordering;

use crate::campaign::{Metric, Row, RunStatus, Table};

/// The `n` worst rows, the worst first. The order is contacts, then failures, refusals and missed limits, then the
/// largest tool error at any target; among equals the first setting and seed.
#[must_use]
pub fn worst_rows(table: &Table, n: usize) -> Vec<&Row> {
    let mut rows: Vec<&Row> = table.rows.iter().collect();
    rows.sort_by(|a, b| order(table, a, b));
    rows.truncate(n);
    rows
}

fn order(table: &Table, a: &Row, b: &Row) -> Ordering {
    let figure = |row: &Row, metric| table.place(metric).and_then(|place| row.figures[place]).unwrap_or(0.0);
    let touched = |row| figure(row, Metric::Contacts) > 0.0;
    let rank = |row: &Row| match row.status {
        RunStatus::Failed => 3,
        RunStatus::Refused => 2,
        RunStatus::Missed => 1,
        RunStatus::Accepted => 0,
    };
    let error_m = |row| figure(row, Metric::ToolErrorAfterMax);
    let worse = touched(b).cmp(&touched(a)).then(rank(b).cmp(&rank(a)));
    worse.then(error_m(b).total_cmp(&error_m(a))).then(a.key().cmp(&b.key()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::table_file::tests::row;

    #[test]
    fn contacts_come_first_then_failures_then_errors() {
        let names = [Metric::Contacts, Metric::ToolErrorAfterMax].map(|metric| metric.name().to_owned()).to_vec();
        let one = |seed, status, contacts, error_m| Row {
            status,
            figures: vec![Some(contacts), Some(error_m)],
            ..row(0, seed)
        };
        use RunStatus::{Accepted, Failed, Missed, Refused};
        let rows = vec![
            one(1, Accepted, 0.0, 0.002),
            one(2, Accepted, 0.0, 0.003),
            one(3, Accepted, 1.0, 0.001),
            one(4, Refused, 0.0, 0.0),
            Row { figures: vec![None, None], ..one(5, Failed, 0.0, 0.0) },
            one(6, Missed, 0.0, 0.0),
            one(7, Accepted, 0.0, 0.003),
        ];
        let table = Table { names, rows };
        let seeds = |n| worst_rows(&table, n).iter().map(|row| row.seed).collect::<Vec<u64>>();
        assert_eq!(seeds(9), [3, 5, 4, 6, 2, 7, 1]);
        assert_eq!(seeds(2), [3, 5]);
        assert!(seeds(0).is_empty());
    }
}
