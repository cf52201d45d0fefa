//! `--until`: a campaign that stops as soon as a rate is known to be below or above a limit.
//!
//! Rows count in the order of their seeds, so that the campaign ends at the same seed on any number of threads.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::campaign::{Row, RunStatus, Weights};
use armcal_core::stats::RateSequence;

/// Event that runs are counted for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RunEvent {
    /// The arm touched anything.
    Contacts,
    Missed,
    Refused,
    Failed,
    /// Missed, refused or failed.
    NotAccepted,
}

const EVENTS: [(&str, RunEvent); 5] = [
    ("contacts", RunEvent::Contacts),
    ("missed", RunEvent::Missed),
    ("refused", RunEvent::Refused),
    ("failed", RunEvent::Failed),
    ("not_accepted", RunEvent::NotAccepted),
];

impl RunEvent {
    /// True if the run has the event. `contacts` is the figure of that name, where the run has it.
    fn is_in(self, row: &Row, contacts: Option<f64>) -> bool {
        match self {
            Self::Contacts => contacts.is_some_and(|n| n > 0.0),
            Self::Missed => row.status == RunStatus::Missed,
            Self::Refused => row.status == RunStatus::Refused,
            Self::Failed => row.status == RunStatus::Failed,
            Self::NotAccepted => row.status != RunStatus::Accepted,
        }
    }
}

/// A limit on the rate of an event, such as "contacts < 0.001 at 95 %".
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Until {
    event: RunEvent,
    /// Limit of the event's share of all runs.
    limit: f64,
    /// Confidence level, 0.95 for 95 %.
    level: f64,
}

impl FromStr for Until {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let problem = |what: &str| format!("`{text}`: {what}; write it as \"contacts < 0.001 at 95 %\"");
        let (event, rest) = text.split_once('<').ok_or_else(|| problem("has no `<`"))?;
        let (limit, level) = rest.split_once(" at ").ok_or_else(|| problem("has no ` at `"))?;
        let names = EVENTS.map(|(name, _)| name).join(", ");
        let found = EVENTS.into_iter().find(|(name, _)| *name == event.trim());
        let (_, event) = found.ok_or_else(|| problem(&format!("`{}` is none of {names}", event.trim())))?;
        let number = |text: &str| text.trim().parse::<f64>().ok();
        let limit = number(limit).filter(|rate| (1e-6..=0.9).contains(rate));
        let level = level.trim().strip_suffix('%').and_then(number).filter(|level| (50.0..=99.999).contains(level));
        Ok(Self {
            event,
            limit: limit.ok_or_else(|| problem("the rate is a number of 1e-6 .. 0.9"))?,
            level: level.ok_or_else(|| problem("the level is 50 .. 99.999 %"))? / 100.0,
        })
    }
}

impl fmt::Display for Until {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = EVENTS.iter().find(|(_, event)| *event == self.event).map_or("", |(name, _)| name);
        // Rounding gives 99.9 instead of 99.90000000000001.
        let level = (1e5 * self.level).round() / 1e3;
        write!(f, "{name} < {} at {level} %", self.limit)
    }
}

/// Relation of a rate's interval to its limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Answer {
    /// The whole interval is below the limit.
    Below,
    /// The whole interval is above it.
    Above,
    /// The interval contains the limit.
    Open,
}

/// Answer of the campaign to one limit, under one setting or over all by their weights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct UntilResult {
    /// Index of the setting; `None` over all settings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub setting: Option<u32>,
    pub until: String,
    pub answer: Answer,
    /// Runs with the event when the answer was reached, or at the end; `runs` counts all runs until then.
    pub events: u64,
    pub runs: u64,
    /// Lower end of the rate's interval at that moment.
    pub low: f64,
    pub high: f64,
}

impl fmt::Display for UntilResult {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { until, events, runs, low, high, .. } = self;
        let answer = match self.answer {
            Answer::Below => "yes",
            Answer::Above => "NO, it is above",
            Answer::Open => "OPEN, more seeds are needed",
        };
        write!(f, "{until}: {answer}; {events} of {runs} runs, {low:.2e} .. {high:.2e}")
    }
}

/// A seed, and the number of settings that it is run under.
pub type MetSeed = (u64, usize);

/// Counter of rows until all limits have their answers.
#[derive(Debug)]
pub struct Stopping {
    limits: Vec<Until>,
    /// Seeds in the order in which they count.
    seeds: Vec<MetSeed>,
    n_counted: usize,
    /// Completed settings of each seed, and for each limit whether the event occurred.
    waiting: BTreeMap<u64, BTreeMap<u32, Vec<bool>>>,
    contacts: Option<usize>,
    /// Counts and answers by setting, then by limit.
    sequences: BTreeMap<u32, Vec<(RateSequence, Option<UntilResult>)>>,
    /// Weights of the settings, where they have some, and one answer per limit for all settings together.
    weights: Option<(Weights, Vec<Option<UntilResult>>)>,
}

impl Stopping {
    /// Starts the counting. `names` are those of the rows' figures. Each setting gets its own answer.
    #[must_use]
    pub fn new(limits: &[Until], seeds: Vec<MetSeed>, settings: BTreeSet<u32>, names: &[String]) -> Self {
        let fresh = vec![(RateSequence::default(), None); limits.len()];
        Self {
            limits: limits.to_vec(),
            seeds,
            n_counted: 0,
            waiting: BTreeMap::new(),
            sequences: settings.iter().map(|setting| (*setting, fresh.clone())).collect(),
            contacts: names.iter().position(|name| name == "contacts"),
            weights: None,
        }
    }

    /// Asks for one answer over all settings, where they have weights.
    #[must_use]
    pub fn weighted(self, weights: Option<Weights>) -> Self {
        let n_limits = self.limits.len();
        Self { weights: weights.map(|weights| (weights, vec![None; n_limits])), ..self }
    }

    /// Counts a row, in any order.
    pub fn add(&mut self, row: &Row) {
        let contacts = self.contacts.and_then(|place| row.figures.get(place).copied().flatten());
        let events = self.limits.iter().map(|limit| limit.event.is_in(row, contacts)).collect();
        self.waiting.entry(row.seed).or_default().insert(row.setting, events);
        while !self.is_answered() {
            let Some((seed, n_met)) = self.seeds.get(self.n_counted) else { break };
            let is_whole = self.waiting.get(seed).is_some_and(|found| found.len() == *n_met);
            let Some(found) = is_whole.then(|| self.waiting.remove(seed)).flatten() else { break };
            self.n_counted += 1;
            for (setting, events) in found {
                self.count(setting, &events);
            }
            self.answer_for_all();
        }
    }

    fn count(&mut self, setting: u32, events: &[bool]) {
        let Some(sequences) = self.sequences.get_mut(&setting) else { return };
        let is_for_all = self.weights.is_some();
        for ((limit, has_event), (sequence, result)) in self.limits.iter().zip(events).zip(sequences) {
            if result.is_some() {
                continue;
            }
            if *has_event {
                sequence.add_with();
            } else {
                sequence.add_without();
            }
            let now = limit.result(setting, sequence);
            *result = (now.answer != Answer::Open && !is_for_all).then_some(now);
        }
    }

    /// Answers limits over all settings, where these have weights.
    fn answer_for_all(&mut self) {
        let Some((weights, mut results)) = self.weights.take() else { return };
        for (place, result) in results.iter_mut().enumerate().filter(|(_, result)| result.is_none()) {
            let now = self.result_for_all(&weights, place);
            *result = (now.answer != Answer::Open).then_some(now);
        }
        self.weights = Some((weights, results));
    }

    fn result_for_all(&self, weights: &Weights, place: usize) -> UntilResult {
        let limit = self.limits[place];
        let counted = |setting| self.sequences.get(&setting).map(|each| each[place].0).unwrap_or_default();
        let mixed = weights.mixed(counted, limit.level);
        let counts = self.sequences.values().map(|each| each[place].0.counts());
        let [events, runs] = counts.fold([0, 0], |sum, one| [sum[0] + one[0], sum[1] + one[1]]);
        limit.answered(None, [events, runs], [mixed.low, mixed.high])
    }

    /// True if no further run is needed.
    #[must_use]
    pub fn is_answered(&self) -> bool {
        let are_answered = match &self.weights {
            Some((_, results)) => results.iter().all(Option::is_some),
            None => self.sequences.values().flatten().all(|(_, result)| result.is_some()),
        };
        !self.limits.is_empty() && are_answered
    }

    /// Seeds that the answers do not need.
    #[must_use]
    pub fn beyond(&self) -> BTreeSet<u64> {
        if !self.is_answered() {
            return BTreeSet::new();
        }
        self.seeds[self.n_counted..].iter().map(|(seed, _)| *seed).collect()
    }

    /// Answers so far.
    #[must_use]
    pub fn results(&self) -> Vec<UntilResult> {
        if let Some((weights, results)) = &self.weights {
            let each = results.iter().enumerate();
            return each.map(|(k, known)| known.clone().unwrap_or_else(|| self.result_for_all(weights, k))).collect();
        }
        let of = |(setting, sequences): (&u32, &Vec<(RateSequence, Option<UntilResult>)>)| -> Vec<UntilResult> {
            let each = self.limits.iter().zip(sequences);
            each.map(|(limit, (sequence, result))| result.clone().unwrap_or_else(|| limit.result(*setting, sequence)))
                .collect()
        };
        self.sequences.iter().flat_map(of).collect()
    }
}

impl Until {
    fn result(&self, setting: u32, sequence: &RateSequence) -> UntilResult {
        self.answered(Some(setting), sequence.counts(), sequence.interval(self.level))
    }

    fn answered(&self, setting: Option<u32>, [events, runs]: [u64; 2], [low, high]: [f64; 2]) -> UntilResult {
        let answer = match () {
            () if high < self.limit => Answer::Below,
            () if low > self.limit => Answer::Above,
            () => Answer::Open,
        };
        UntilResult { setting, until: self.to_string(), answer, events, runs, low, high }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::table_file::tests::{names, row};

    fn stopping(limits: &[&str], n_seeds: u64, n_settings: u32) -> Stopping {
        let limits: Vec<Until> = limits.iter().map(|text| text.parse().expect("a limit")).collect();
        let seeds = (1..=n_seeds).map(|seed| (seed, n_settings as usize)).collect();
        Stopping::new(&limits, seeds, (0..n_settings).collect(), &names())
    }

    /// A row that is refused once in `every` seeds.
    fn row_of(setting: u32, seed: u64, every: u64) -> Row {
        let status = if seed.is_multiple_of(every) { RunStatus::Refused } else { RunStatus::Accepted };
        Row { status, ..row(setting, seed) }
    }

    #[test]
    fn a_limit_is_read_or_its_fault_is_named() {
        let limit: Until = "contacts < 1e-3 at 99.9 %".parse().expect("a limit");
        assert_eq!(limit.to_string(), "contacts < 0.001 at 99.9 %");
        assert_eq!(limit.to_string().parse(), Ok(limit));
        let texts = [
            "contacts 1e-3 at 95 %",
            "contacts < 1e-3",
            "bumps < 1e-3 at 95 %",
            "contacts < 0 at 95 %",
            "contacts < nan at 95 %",
            "contacts < 0.1 at 95",
            "contacts < 0.1 at 100 %",
        ];
        insta::assert_snapshot!("limits", texts.map(|text| text.parse::<Until>().expect_err(text)).join("\n"));
    }

    /// For any order of the rows, the campaign ends at the same seed with the same answers.
    #[test]
    fn the_last_seed_does_not_depend_on_the_order_of_rows() {
        let rows: Vec<Row> = (1..=400).flat_map(|seed| [row_of(0, seed, 50), row_of(1, seed, 2)]).collect();
        let run = |order: &dyn Fn(usize) -> usize| {
            let mut stopping = stopping(&["refused < 0.2 at 95 %"], 400, 2);
            for place in 0..rows.len() {
                stopping.add(&rows[order(place)]);
            }
            (stopping.results(), stopping.beyond())
        };
        let (results, beyond) = run(&|place| place);
        assert_eq!(results.iter().map(|result| result.answer).collect::<Vec<_>>(), [Answer::Below, Answer::Above]);
        assert!(results[0].runs > 15 && beyond.len() > 300, "{results:?}");
        let first = *beyond.first().expect("seeds that are left");
        assert_eq!(first, results.iter().map(|result| result.runs).max().expect("two") + 1);
        // 233 and 800 have no common divisor.
        assert_eq!(run(&|place| (place * 233) % rows.len()), (results, beyond));
    }

    #[test]
    fn without_enough_seeds_the_answer_is_open() {
        let mut stopping = stopping(&["refused < 0.001 at 95 %"], 20, 1);
        (1..=20).for_each(|seed| stopping.add(&row(0, seed)));
        assert!(!stopping.is_answered() && stopping.beyond().is_empty());
        let [result] = &stopping.results()[..] else { panic!("one") };
        assert_eq!((result.answer, result.runs), (Answer::Open, 20));
        insta::assert_snapshot!("open", result);
    }

    /// Each of these rows has three contacts.
    #[test]
    fn contacts_are_read_from_the_figures() {
        let mut stopping = stopping(&["contacts < 0.001 at 95 %"], 20, 1);
        (1..=20).for_each(|seed| stopping.add(&row(0, seed)));
        let [result] = &stopping.results()[..] else { panic!("one") };
        assert_eq!((result.answer, result.events), (Answer::Above, result.runs), "{result}");
        assert!(!stopping.beyond().is_empty(), "{result}");
    }

    /// A rare setting that is always refused does not spoil the rate of all; one half of all does.
    #[test]
    fn weights_answer_for_all_settings_at_once() {
        let answer = |rare: f64| {
            let weights = Weights::new([(0, 1.0 - rare), (1, rare)].into());
            let mut stopping = stopping(&["refused < 0.1 at 95 %"], 400, 2).weighted(Some(weights));
            for seed in 1..=400 {
                [row_of(0, seed, 1000), row_of(1, seed, 1)].iter().for_each(|row| stopping.add(row));
            }
            let [result] = &stopping.results()[..] else { panic!("one answer") };
            assert_eq!(result.setting, None);
            (result.answer, stopping.beyond().is_empty())
        };
        assert_eq!(answer(0.02), (Answer::Below, false));
        assert_eq!(answer(0.5), (Answer::Above, false));
        assert_eq!(answer(0.1), (Answer::Open, true));
    }
}
