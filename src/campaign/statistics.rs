//! Summary of rows: per setting, how runs ended, and the spread of each figure over the seeds.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::campaign::{Metric, MixedRate, Origin, Row, RunStatus, Share, Table, UntilResult, Weights, Worsening};
use armcal_core::stats::{RateSequence, median_interval, quantile};

/// The summary next to a campaign's table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CampaignSummary {
    pub version: u32,
    pub routine: String,
    pub fingerprint: String,
    /// Origin of the rows, for later comparisons.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub origin: Option<Origin>,
    /// Share of the campaign that the rows are; `None` for the whole campaign.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub share: Option<Share>,
    /// Answers to the limits of `--until`; empty without.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub until: Vec<UntilResult>,
    /// Rates over all settings by their weights; empty where settings have none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub weighted: Vec<WeightedRate>,
    pub settings: Vec<SettingStatistics>,
}

/// Rate of an event over all settings, each by its weight.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WeightedRate {
    /// Name of the event: contacts, missed, refused or failed.
    pub event: String,
    /// Estimated rate; absent while a setting has no run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate: Option<f64>,
    /// Lower end of the 95 % interval, which is valid however often it is evaluated.
    pub low: f64,
    pub high: f64,
}

/// Statistics of all runs of one point of the matrix.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SettingStatistics {
    pub setting: u32,
    pub settings: String,
    /// Weight of the setting, where the routine gives one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weight: Option<f64>,
    pub runs: usize,
    pub accepted: usize,
    /// Runs whose calibration is accepted while an `assert` of the routine does not hold.
    pub missed: usize,
    pub refused: usize,
    pub failed: usize,
    /// Runs in which the arm touched anything.
    pub with_contacts: usize,
    pub figures: Vec<FigureStatistics>,
    /// The first runs without a result, by seed.
    pub failures: Vec<FailureLine>,
}

/// Distribution of one figure over the seeds, from all runs that have it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FigureStatistics {
    pub name: String,
    pub n: usize,
    pub median: f64,
    /// Lower end of the median's 95 % interval, by the percentile bootstrap over the seeds.
    pub median_low: f64,
    pub median_high: f64,
    pub p95: f64,
    pub worst: f64,
    pub worst_seed: u64,
}

/// A run that was refused or failed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FailureLine {
    pub seed: u64,
    pub status: String,
    pub failure: String,
    pub command: String,
}

/// Number of failures that a summary names; the table has them all.
const MAX_FAILURES: usize = 10;
const COVERAGE: f64 = 0.95;

/// Summarises a table.
#[must_use]
pub fn statistics(table: &Table, routine: &str, fingerprint: &str) -> CampaignSummary {
    let mut by_setting: BTreeMap<u32, Vec<&Row>> = BTreeMap::new();
    for row in &table.rows {
        by_setting.entry(row.setting).or_default().push(row);
    }
    let settings = by_setting.into_values().map(|rows| of_setting(table, &rows)).collect();
    let (routine, fingerprint) = (routine.to_owned(), fingerprint.to_owned());
    CampaignSummary {
        version: 1,
        routine,
        fingerprint,
        origin: None,
        share: None,
        until: Vec::new(),
        weighted: Vec::new(),
        settings,
    }
}

/// Name of an event, and the number of a setting's runs that have it.
type CountedEvent = (&'static str, fn(&SettingStatistics) -> usize);

impl CampaignSummary {
    /// Adds the rates over all settings, where these have weights.
    #[must_use]
    pub fn weighed(mut self, weights: Option<&Weights>) -> Self {
        let Some(weights) = weights else { return self };
        for setting in &mut self.settings {
            setting.weight = Some(weights.of(setting.setting));
        }
        let events: [CountedEvent; 4] = [
            ("contacts", |setting| setting.with_contacts),
            ("missed", |setting| setting.missed),
            ("refused", |setting| setting.refused),
            ("failed", |setting| setting.failed),
        ];
        let rate = |(event, of): CountedEvent| {
            let counted = |number| {
                let found = self.settings.iter().find(|setting| setting.setting == number);
                found.map_or_else(RateSequence::default, |found| {
                    RateSequence::of_counts(of(found) as u64, found.runs as u64)
                })
            };
            let MixedRate { rate, low, high } = weights.mixed(counted, COVERAGE);
            WeightedRate { event: event.to_owned(), rate, low, high }
        };
        self.weighted = events.map(rate).to_vec();
        self
    }

    /// Weights that [`Self::weighed`] received.
    #[must_use]
    pub fn weights(&self) -> Option<Weights> {
        let weight = |setting: &SettingStatistics| Some((setting.setting, setting.weight?));
        self.settings.iter().map(weight).collect::<Option<_>>().filter(|_| !self.weighted.is_empty()).map(Weights::new)
    }
}

/// Statistics of one setting; `rows` holds at least one row.
fn of_setting(table: &Table, rows: &[&Row]) -> SettingStatistics {
    let count = |status| rows.iter().filter(|row| row.status == status).count();
    let contacts = table.place(Metric::Contacts);
    let touched = |row: &&&Row| contacts.and_then(|k| row.figures[k]).is_some_and(|n| n > 0.0);
    let failures = rows.iter().filter(|row| row.status != RunStatus::Accepted).take(MAX_FAILURES);
    SettingStatistics {
        setting: rows[0].setting,
        settings: rows[0].settings.clone(),
        weight: None,
        runs: rows.len(),
        accepted: count(RunStatus::Accepted),
        missed: count(RunStatus::Missed),
        refused: count(RunStatus::Refused),
        failed: count(RunStatus::Failed),
        with_contacts: rows.iter().filter(touched).count(),
        figures: (0..table.names.len()).filter_map(|k| of_figure(&table.names[k], k, rows)).collect(),
        failures: failures
            .map(|row| FailureLine {
                seed: row.seed,
                status: row.status.name().to_owned(),
                failure: row.failure.clone(),
                command: row.command.clone(),
            })
            .collect(),
    }
}

fn of_figure(name: &str, place: usize, rows: &[&Row]) -> Option<FigureStatistics> {
    let value = |row: &&Row| row.figures[place].filter(|value| value.is_finite()).map(|value| (value, row.seed));
    let pairs: Vec<(f64, u64)> = rows.iter().filter_map(value).collect();
    let values: Vec<f64> = pairs.iter().map(|(value, _)| *value).collect();
    let sign = match Metric::of_name(name).map(Metric::worsening) {
        Some(Worsening::LessIsWorse) => -1.0,
        Some(Worsening::MoreIsWorse) | None => 1.0,
    };
    // Among equal values the first seed counts.
    let &(worst, worst_seed) = pairs.iter().min_by(|a, b| (sign * b.0).total_cmp(&(sign * a.0)).then(a.1.cmp(&b.1)))?;
    let interval = median_interval(&values, COVERAGE)?;
    Some(FigureStatistics {
        name: name.to_owned(),
        n: values.len(),
        median: quantile(&values, 0.5)?,
        median_low: interval.low,
        median_high: interval.high,
        p95: quantile(&values, if sign > 0.0 { 0.95 } else { 0.05 })?,
        worst,
        worst_seed,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::table_file::tests::{names, row};

    #[test]
    fn rows_are_counted_by_setting_and_the_worst_seed_is_named() {
        let failed =
            Row { status: RunStatus::Failed, failure: "why".to_owned(), figures: vec![None, None, None], ..row(0, 9) };
        let refused = Row { status: RunStatus::Refused, figures: vec![Some(9.0), Some(0.0), None], ..row(0, 4) };
        let table = Table { names: names(), rows: vec![row(0, 1), row(0, 2), refused, failed, row(1, 1)] };
        let summary = statistics(&table, "r", "f");
        assert_eq!(summary.settings.len(), 2);
        let first = &summary.settings[0];
        assert_eq!((first.runs, first.accepted, first.refused, first.failed, first.with_contacts), (4, 2, 1, 1, 2));
        assert_eq!(first.failures.iter().map(|f| f.seed).collect::<Vec<_>>(), [4, 9]);
        let time = &first.figures[0];
        assert_eq!(
            (time.name.as_str(), time.n, time.median, time.worst, time.worst_seed),
            ("simulated_s", 3, 0.5, 9.0, 4)
        );
        assert!(time.median_low <= time.median && time.median <= time.median_high);
    }

    #[test]
    fn of_clearance_the_least_is_the_worst() {
        let rows: Vec<Row> = (1..=5).map(|seed| Row { figures: vec![Some(seed as f64)], ..row(0, seed) }).collect();
        let table = Table { names: vec!["min_clearance_m".to_owned()], rows };
        let figure = &statistics(&table, "r", "f").settings[0].figures[0];
        assert_eq!((figure.worst, figure.worst_seed), (1.0, 1));
        assert!(figure.p95 < 2.0);
    }

    #[test]
    fn rates_over_settings_go_by_their_weights_and_come_back() {
        let refused = |seed| Row { status: RunStatus::Refused, ..row(1, seed) };
        let table = Table { names: names(), rows: vec![row(0, 1), row(0, 2), refused(1), row(1, 2)] };
        let weights = Weights::new([(0, 0.9), (1, 0.1)].into());
        let summary = statistics(&table, "r", "f").weighed(Some(&weights));
        let refused = summary.weighted.iter().find(|rate| rate.event == "refused").expect("refused");
        assert!((refused.rate.expect("runs") - 0.05).abs() < 1e-15);
        assert_eq!(summary.weights(), Some(weights));
        assert_eq!(statistics(&table, "r", "f").weighed(None).weights(), None);
    }
}
