//! Settings of many runs of a routine: `[campaign]` and `[regress]`.

use crate::codes::Code;
use std::collections::BTreeMap;
use std::fmt;
use std::ops::RangeInclusive;
use std::path::Path;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::Deserialize;
use toml::{Table, Value};

use super::error::RoutineError;
use super::overrides::Override;
use crate::robot::FileIssue;

/// Seeds from the first to the last, both included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SeedRange {
    first: u64,
    last: u64,
}

impl SeedRange {
    /// Returns the range; `None` if `last` is below `first`.
    #[must_use]
    pub fn new(first: u64, last: u64) -> Option<Self> {
        (first <= last).then_some(Self { first, last })
    }

    /// Every seed of the range, ascending.
    #[must_use]
    pub fn seeds(self) -> RangeInclusive<u64> {
        self.first..=self.last
    }

    /// Returns true if the range contains this seed.
    #[must_use]
    pub fn contains(self, seed: u64) -> bool {
        self.seeds().contains(&seed)
    }
}

impl FromStr for SeedRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let problem = || format!("`{text}` is neither A..B, both included and A not above B, nor one number");
        let (first, last) = text.split_once("..").unwrap_or((text, text));
        let parse = |part: &str| part.trim().parse::<u64>().map_err(|_| problem());
        Self::new(parse(first)?, parse(last)?).ok_or_else(problem)
    }
}

impl fmt::Display for SeedRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}..{}", self.first, self.last)
    }
}

/// `[campaign]`: the seeds, and the settings that each of them runs with.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CampaignSettings {
    /// Seeds; `None` if the command line must give them.
    pub seeds: Option<SeedRange>,
    /// Keys with their values, sorted by key; the full product is run.
    pub matrix: Vec<(String, Vec<Value>)>,
    /// Relative frequencies of the values, by key of the matrix. Empty: all points have equal weight.
    pub weights: Vec<(String, Vec<f64>)>,
}

/// `[regress]`: tolerated deterioration against the baseline.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RegressSettings {
    /// Limit of the tool error, new over baseline, typical of the pairs.
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub tool_error_ratio: f64,
    /// Limit of the distance between target and tool, new over baseline, typical of the pairs.
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub reach_error_ratio: f64,
    /// Limit of the fit's residual in the image, new over baseline, typical of the pairs.
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub residual_ratio: f64,
    /// Limit of the held-out tags' position error, new over baseline, typical of the pairs.
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub held_out_ratio: f64,
    /// Limit of the scatter of corners within a capture, new over baseline, typical of the pairs.
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub corner_scatter_ratio: f64,
    /// Limit of the simulated time, new over baseline, typical of the pairs.
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub time_ratio: f64,
    /// Limit of the number of poses captured, baseline over new, typical of the pairs.
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub poses_ratio: f64,
    /// Limit of the loss of clearance, baseline less new, typical of the pairs, m.
    #[schemars(range(min = 1e-6, max = 10.0))]
    pub clearance_drop_m: f64,
    /// Limit of the new tool error, median over the seeds, m; absent: no limit.
    #[schemars(range(min = 1e-6, max = 10.0))]
    pub tool_error_m: Option<f64>,
    /// Limit of the new distance between target and tool, median over the seeds, m; absent: no limit.
    #[schemars(range(min = 1e-6, max = 10.0))]
    pub reach_error_m: Option<f64>,
}

impl Default for RegressSettings {
    fn default() -> Self {
        Self {
            tool_error_ratio: 1.10,
            reach_error_ratio: 1.10,
            residual_ratio: 1.10,
            held_out_ratio: 1.10,
            corner_scatter_ratio: 1.10,
            time_ratio: 1.10,
            poses_ratio: 1.10,
            clearance_drop_m: 0.005,
            tool_error_m: None,
            reach_error_m: None,
        }
    }
}

impl RegressSettings {
    pub(super) fn check(&self, file: &Path) -> Result<(), RoutineError> {
        let ratios = [
            ("tool_error_ratio", self.tool_error_ratio),
            ("reach_error_ratio", self.reach_error_ratio),
            ("residual_ratio", self.residual_ratio),
            ("held_out_ratio", self.held_out_ratio),
            ("corner_scatter_ratio", self.corner_scatter_ratio),
            ("time_ratio", self.time_ratio),
            ("poses_ratio", self.poses_ratio),
        ];
        for (key, value) in ratios {
            FileIssue::check_range(file, &format!("regress.{key}"), value, 1.0..=1000.0)?;
        }
        let lengths = [
            ("clearance_drop_m", Some(self.clearance_drop_m)),
            ("tool_error_m", self.tool_error_m),
            ("reach_error_m", self.reach_error_m),
        ];
        for (key, value) in lengths {
            if let Some(value) = value {
                FileIssue::check_range(file, &format!("regress.{key}"), value, 1e-6..=10.0)?;
            }
        }
        Ok(())
    }
}

/// Smallest and largest weight of a setting, relative to the others.
const MIN_WEIGHT: f64 = 1e-9;
const MAX_WEIGHT: f64 = 1e9;

#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct CampaignFile {
    /// Seeds `A..B`, both included.
    seeds: Option<String>,
    /// Keys of the routine with the values that they take; the full product is run.
    #[serde(default)]
    #[schemars(with = "BTreeMap<String, serde_json::Value>")]
    matrix: Table,
    /// Frequency of each value of a key of the matrix.
    #[serde(default)]
    #[schemars(with = "BTreeMap<String, serde_json::Value>")]
    weights: Table,
}

impl CampaignFile {
    pub(super) fn check(&self, file: &Path) -> Result<CampaignSettings, RoutineError> {
        let seeds = self.seeds.as_deref().map(str::parse).transpose();
        let seeds =
            seeds.map_err(|problem: String| FileIssue::new(Code::ValueInvalid, file, "campaign.seeds", problem))?;
        let mut matrix = Vec::new();
        flatten(&self.matrix, "", &mut matrix).map_err(|(key, problem)| {
            FileIssue::new(Code::ValueInvalid, file, format!("campaign.matrix.{key}"), problem)
        })?;
        matrix.sort_by(|a, b| a.0.cmp(&b.0));
        let mut weights = Vec::new();
        flatten(&self.weights, "", &mut weights)
            .and_then(|()| weights.iter().map(|(key, values)| weights_of(key, values, &matrix)).collect())
            .map(|weights| CampaignSettings { seeds, matrix, weights })
            .map_err(|(key, problem)| {
                FileIssue::new(Code::ValueInvalid, file, format!("campaign.weights.{key}"), problem).into()
            })
    }
}

/// Reads the weights: one positive number for each value that the matrix gives the key.
fn weights_of(
    key: &str,
    values: &[Value],
    matrix: &[(String, Vec<Value>)],
) -> Result<(String, Vec<f64>), (String, String)> {
    let problem = |problem: String| (key.to_owned(), problem);
    let Some((_, points)) = matrix.iter().find(|(name, _)| name == key) else {
        return Err(problem("is no key of campaign.matrix".to_owned()));
    };
    if points.len() != values.len() {
        let (n, wanted) = (values.len(), points.len());
        return Err(problem(format!("has {n} weights; the matrix gives the key {wanted} values")));
    }
    let number = |value: &Value| value.as_float().or_else(|| value.as_integer().map(|n| n as f64));
    let weight = |value| number(value).filter(|weight| (MIN_WEIGHT..=MAX_WEIGHT).contains(weight));
    let weights = values.iter().map(weight).collect::<Option<Vec<f64>>>();
    let weights = weights.ok_or_else(|| problem(format!("must be numbers of {MIN_WEIGHT} .. {MAX_WEIGHT}")))?;
    Ok((key.to_owned(), weights))
}

/// Collects the keys of a table. Dotted keys may be quoted; unquoted ones are nested tables.
fn flatten(table: &Table, prefix: &str, into: &mut Vec<(String, Vec<Value>)>) -> Result<(), (String, String)> {
    for (key, value) in table {
        let key = format!("{prefix}{key}");
        match value {
            Value::Table(inner) => flatten(inner, &format!("{key}."), into)?,
            Value::Array(values) if values.is_empty() => return Err((key, "needs one value or more".to_owned())),
            Value::Array(values) => {
                Override::new(&key, Value::Boolean(true)).map_err(|problem| (key.clone(), problem))?;
                if key == "seed" || key.starts_with("campaign") {
                    return Err((key, "cannot be varied; seeds are given by `seeds`".to_owned()));
                }
                into.push((key, values.clone()));
            }
            _ => return Err((key, "must be a list of values".to_owned())),
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seed_ranges_include_both_ends() {
        let seeds = |text: &str| text.parse::<SeedRange>().map(|range| range.seeds().collect::<Vec<_>>());
        assert_eq!(seeds("2..4"), Ok(vec![2, 3, 4]));
        assert_eq!(seeds("7"), Ok(vec![7]));
        assert_eq!(seeds(" 7 .. 7 "), Ok(vec![7]));
        for bad in ["", "..", "1..", "..3", "4..2", "-1..3", "a..b", "1..2..3", "1..=3"] {
            assert!(seeds(bad).is_err(), "{bad}");
        }
        assert_eq!(
            "0..18446744073709551615".parse::<SeedRange>().expect("a range").to_string(),
            "0..18446744073709551615"
        );
    }

    #[test]
    fn a_matrix_takes_quoted_and_unquoted_keys() {
        let read = |text: &str| toml::from_str::<CampaignFile>(text).expect("TOML").check(Path::new("r.toml"));
        let quoted = read("seeds = \"1..3\"\n[matrix]\nmethod = [\"a\"]\n\"world.camera.rate_hz\" = [1.0, 2.0]");
        let unquoted = read("seeds = \"1..3\"\n[matrix]\nworld.camera.rate_hz = [1.0, 2.0]\nmethod = [\"a\"]");
        let quoted = quoted.expect("good");
        assert_eq!(quoted, unquoted.expect("good"));
        assert_eq!(
            quoted.matrix.iter().map(|(key, _)| key.as_str()).collect::<Vec<_>>(),
            ["method", "world.camera.rate_hz"]
        );
        let weighted = read("[matrix]\na = [true, false]\n[weights]\na = [0.99, 1]").expect("good");
        assert_eq!(weighted.weights, [("a".to_owned(), vec![0.99, 1.0])]);
        let told = [
            "seeds = \"3..1\"",
            "[matrix]\na = []",
            "[matrix]\na = 1",
            "[matrix]\nseed = [1]",
            "[matrix]\n\"a b\" = [1]",
            "[weights]\na = [1]",
            "[matrix]\na = [1, 2]\n[weights]\na = [1]",
            "[matrix]\na = [1, 2]\n[weights]\na = [1, 0]",
            "[matrix]\na = [1, 2]\n[weights]\na = [1, \"b\"]",
        ]
        .map(|bad| format!("{bad:?}\n  {}\n", read(bad).expect_err(bad)));
        insta::assert_snapshot!("campaign", told.concat());
        let weights = read("[matrix]\na = [1, 2]\n[weights]\na = [1, 0]").expect_err("a weight of none").to_string();
        assert!(weights.contains("1000000000") && !weights.contains("e8"), "{weights}");
    }
}
