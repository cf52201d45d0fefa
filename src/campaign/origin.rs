//! Routine, robot and vehicle of rows, as written in a baseline's first lines.

use std::fmt::Write as _;

use serde::{Deserialize, Serialize};
use toml::{Table as Toml, Value};

use crate::campaign::fingerprint::without_seeds;
use crate::campaign::{CampaignError, Prepared};
use armcal_core::files::{self, FileKind};
use armcal_core::routine::effective_table;

/// Version of the lines before the table; a new meaning of its columns needs a new version.
const FORMAT: u32 = 1;
const MARK: &str = "# armcal baseline ";

/// Origin of rows: a comparison of pairs is valid only if both sides have the same origin.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Origin {
    pub routine: Named,
    /// Robots of all settings, in their order.
    pub robots: Vec<Named>,
    pub vehicles: Vec<Named>,
}

/// Name that a file gives itself, and the hash of its contents without comments, seeds, `[regress]` and `assert` steps.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Named {
    pub name: String,
    /// First 16 hexadecimal digits of the BLAKE3 hash.
    pub hash: String,
}

impl Named {
    fn new(name: &str, texts: &[&str]) -> Self {
        let mut hasher = blake3::Hasher::new();
        for text in texts {
            hasher.update(&(text.len() as u64).to_le_bytes());
            hasher.update(text.as_bytes());
        }
        Self { name: name.to_owned(), hash: hasher.finalize().to_hex()[..16].to_owned() }
    }

    /// The file in words: `titan4 (hash 9be7058b2b0ac6d5)`.
    pub(super) fn in_words(&self) -> String {
        format!("{} (hash {})", self.name, self.hash)
    }
}

/// The file's values without comments; the unchanged text where it is no TOML.
fn plain(text: &str) -> String {
    text.parse::<Toml>().map_or_else(|_| text.to_owned(), |table| table.to_string())
}

/// The routine without its `assert` steps: limits on a run do not change the run.
fn without_limits(mut table: Toml) -> String {
    if let Some(steps) = table.get_mut("step").and_then(Value::as_array_mut) {
        steps.retain(|step| step.get("do").and_then(Value::as_str) != Some("assert"));
    }
    table.to_string()
}

impl Origin {
    /// Origin of the runs of `prepared` with the overrides `set`.
    pub(super) fn of(prepared: &Prepared, set: &[armcal_core::routine::Override]) -> Result<Self, CampaignError> {
        let table = effective_table(&prepared.request.routine, set)?;
        let routine = Named::new(&prepared.routine.name, &[&without_limits(without_seeds(&table))]);
        let (mut robots, mut vehicles) = (Vec::new(), Vec::new());
        for inputs in &prepared.inputs {
            let path = inputs.robot.folder.join("robot.toml");
            let text = files::read_text(&path, FileKind::Text)
                .map_err(|source| CampaignError::Read { path: path.clone(), source })?;
            let robot = Named::new(&inputs.robot.name, &[&plain(&text), &inputs.robot.urdf_text]);
            let vehicle = Named::new(&inputs.vehicle.name, &[&plain(&inputs.vehicle.text)]);
            if !robots.contains(&robot) {
                robots.push(robot);
            }
            if !vehicles.contains(&vehicle) {
                vehicles.push(vehicle);
            }
        }
        Ok(Self { routine, robots, vehicles })
    }

    /// Origin of the campaign's runs.
    ///
    /// # Errors
    /// [`CampaignError::Read`] for a file that has vanished meanwhile.
    pub fn of_campaign(prepared: &Prepared) -> Result<Self, CampaignError> {
        Self::of(prepared, &prepared.request.overrides.set)
    }

    pub(super) fn head(&self) -> String {
        let mut text = format!("{MARK}{FORMAT}\n");
        let lines =
            [("routine", std::slice::from_ref(&self.routine)), ("robot", &self.robots), ("vehicle", &self.vehicles)];
        for (what, named) in lines.into_iter().flat_map(|(what, all)| all.iter().map(move |one| (what, one))) {
            // Writing into memory cannot fail.
            let _ = writeln!(text, "# {what} {} {}", named.hash, named.name);
        }
        text
    }

    /// Reads the output of [`Self::head`]; `None` where the first line is not the mark.
    pub(super) fn read(text: &str) -> Result<Option<Self>, String> {
        let Some(format) = text.lines().next().and_then(|line| line.strip_prefix(MARK)) else { return Ok(None) };
        if format.trim() != FORMAT.to_string() {
            return Err(format!("is a baseline of format {}; this program reads format {FORMAT}", format.trim()));
        }
        let all = |what: &str| -> Vec<Named> {
            let lines = text.lines().map_while(|line| line.strip_prefix("# "));
            let values = lines.filter_map(|line| line.strip_prefix(what)?.strip_prefix(' ')?.split_once(' '));
            values.map(|(hash, name)| Named { name: name.to_owned(), hash: hash.to_owned() }).collect()
        };
        let routine = all("routine").into_iter().next().ok_or("does not name its routine")?;
        Ok(Some(Self { routine, robots: all("robot"), vehicles: all("vehicle") }))
    }

    /// First difference between `self`, a baseline's origin, and `now`, in words.
    pub(super) fn difference(&self, now: &Self) -> Option<String> {
        let sides = [
            ("routine", std::slice::from_ref(&self.routine), std::slice::from_ref(&now.routine)),
            ("robot", &self.robots[..], &now.robots[..]),
            ("vehicle", &self.vehicles[..], &now.vehicles[..]),
        ];
        let names = |all: &[Named]| all.iter().map(|one| one.name.as_str()).collect::<Vec<_>>().join(", ");
        let (what, was, is) = sides.into_iter().find(|(_, was, is)| was != is)?;
        Some(if names(was) == names(is) {
            format!("{what} `{}` has changed since it was made", names(was))
        } else {
            format!("is of {what} `{}`, and this is `{}`", names(was), names(is))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn origin() -> Origin {
        let named = |name: &str| Named::new(name, &[name]);
        Origin { routine: named("r"), robots: vec![named("titan 4"), named("b")], vehicles: vec![named("v")] }
    }

    #[test]
    fn what_a_baseline_is_of_reads_back() {
        let text = origin().head() + "setting,settings\n# routine 1 x\n";
        assert_eq!(Origin::read(&text), Ok(Some(origin())));
        assert_eq!(Origin::read("setting,settings\n"), Ok(None));
        let other = Origin::read(&text.replace("baseline 1", "baseline 2")).expect_err("another format");
        insta::assert_snapshot!("another_format", other);
    }

    #[test]
    fn differences_are_named() {
        let mut now = origin();
        assert_eq!(origin().difference(&now), None);
        now.robots[0].hash = "0".to_owned();
        let changed = origin().difference(&now).expect("another robot");
        now.routine.name = "s".to_owned();
        let other = origin().difference(&now).expect("another routine");
        insta::assert_snapshot!("differences", [changed, other].join("\n"));
    }

    #[test]
    fn comments_and_limits_do_not_count() {
        let table = |text: &str| without_limits(text.parse().expect("TOML"));
        let base = "name = \"a\"\n[[step]]\ndo = \"reach\"\n";
        assert_eq!(table(base), table(&format!("# why\n{base}[[step]]\ndo = \"assert\"\nhits = 4\n")));
        assert_ne!(table(base), table(&format!("{base}[[step]]\ndo = \"capture\"\n")));
        assert_eq!(plain("a = 1 # x\n"), plain("a = 1\n"));
    }
}
