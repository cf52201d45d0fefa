//! Jobs of a campaign: the settings' checked inputs, and one job for each of their seeds.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::campaign::matrix::{Setting, settings};
use crate::campaign::{CampaignError, Columns, Shard, Weights, fingerprint};
use crate::run::RunInputs;
use armcal_core::routine::{self, Overrides, Routine, SeedRange, effective_table};

/// A routine and its overrides, as the user gave them.
#[derive(Clone, Debug)]
pub struct Request {
    pub routine: PathBuf,
    pub overrides: Overrides,
}

/// All inputs, read and checked before the first run.
#[derive(Debug)]
pub struct Prepared {
    pub request: Request,
    /// The routine with the overrides, before any point of the matrix.
    pub routine: Routine,
    pub settings: Vec<Setting>,
    /// Checked inputs of each setting.
    pub inputs: Vec<RunInputs>,
    pub columns: Columns,
    pub fingerprint: String,
}

/// One run that is to be made.
#[derive(Clone, Debug, PartialEq)]
pub struct Job {
    /// Index of the setting.
    pub setting: u32,
    pub settings: String,
    pub seed: u64,
    /// Command that repeats the run.
    pub command: String,
}

impl Prepared {
    /// Reads the routine, and all files that any point of its matrix names.
    ///
    /// # Errors
    /// [`CampaignError`] naming file, key and allowed range.
    pub fn load(request: Request) -> Result<Self, CampaignError> {
        let Request { routine: file, overrides } = &request;
        let routine = routine::load_with(file, overrides)?;
        let matrix = &routine.campaign.matrix;
        if let Some(twice) = overrides.set.iter().find(|one| matrix.iter().any(|(key, _)| *key == one.key)) {
            let problem = format!("--set {twice}: campaign.matrix gives values of this key, too");
            return Err(CampaignError::Usage(problem));
        }
        let settings = settings(matrix, &routine.campaign.weights)?;
        let load = |setting: &Setting| {
            let set = overrides.set.iter().chain(&setting.set).cloned().collect();
            RunInputs::load(file, &Overrides { set, ..overrides.clone() })
        };
        let inputs = settings.iter().map(load).collect::<Result<Vec<_>, _>>()?;
        let mut joints: Vec<String> = Vec::new();
        for name in inputs.iter().flat_map(|inputs| inputs.robot.joint_names()) {
            if !joints.contains(&name) {
                joints.push(name);
            }
        }
        let n_targets = inputs.iter().map(|inputs| inputs.routine.task.targets_m.len()).max().unwrap_or_default();
        let fingerprint = fingerprint(&effective_table(file, &overrides.set)?, &inputs)?;
        Ok(Self { routine, settings, inputs, columns: Columns::new(joints, n_targets), fingerprint, request })
    }

    /// The job for one seed under one setting.
    #[must_use]
    pub fn job(&self, setting: &Setting, seed: u64) -> Job {
        Job { setting: setting.index, settings: setting.text(), seed, command: self.command(setting, seed) }
    }

    fn command(&self, setting: &Setting, seed: u64) -> String {
        let Request { routine, overrides } = &self.request;
        let text = |path: &Path| path.display().to_string();
        let mut words =
            vec!["armcal".to_owned(), "run".to_owned(), text(routine), "--seed".to_owned(), seed.to_string()];
        words.extend(overrides.robot.iter().flat_map(|path| ["--robot".to_owned(), text(path)]));
        let vehicle = |path: &PathBuf| ["--set".to_owned(), format!("vehicle={}", text(path))];
        words.extend(overrides.vehicle.iter().flat_map(vehicle));
        let set = overrides.set.iter().chain(&setting.set);
        words.extend(set.flat_map(|one| ["--set".to_owned(), one.to_string()]));
        words.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" ")
    }
}

impl Prepared {
    /// Settings that the seed at `place` in the range, counted from 0, is run under.
    pub fn met_by(&self, place: u64) -> impl Iterator<Item = &Setting> {
        self.settings.iter().filter(move |setting| setting.takes(place))
    }

    /// Weight of each setting; `None` where the routine gives none.
    #[must_use]
    pub fn weights(&self) -> Option<Weights> {
        let weights = self.settings.iter().map(|setting| (setting.index, setting.weight));
        (!self.routine.campaign.weights.is_empty()).then(|| Weights::new(weights.collect()))
    }
}

/// Remaining jobs of a campaign, seed by seed, so that the settings of a seed stay together.
#[must_use]
pub fn jobs(prepared: &Prepared, range: SeedRange, shard: Option<Shard>, done: &BTreeSet<(u32, u64)>) -> Vec<Job> {
    let taken = (0..).zip(range.seeds()).filter(|(place, _)| shard.is_none_or(|shard| shard.takes(*place)));
    taken
        .flat_map(|(place, seed)| prepared.met_by(place).map(move |setting| (setting, seed)))
        .filter(|(setting, seed)| !done.contains(&(setting.index, *seed)))
        .map(|(setting, seed)| prepared.job(setting, seed))
        .collect()
}

/// A word quoted for a shell, where it needs quotes.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "_-./=:,+@%".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', "'\\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_quoted_where_a_shell_would_take_them_apart() {
        for plain in ["a.toml", "--seed", "world.camera.rate_hz=5.0", "../robots/titan4"] {
            assert_eq!(quoted(plain), plain);
        }
        assert_eq!(quoted("a b"), "'a b'");
        assert_eq!(quoted("k=[1.0, 2.0]"), "'k=[1.0, 2.0]'");
        assert_eq!(quoted("it's $HOME"), "'it'\\''s $HOME'");
        assert_eq!(quoted(""), "''");
    }
}
