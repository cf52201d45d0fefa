//! Merging of the tables of several shards.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::campaign::store::read_summary;
use crate::campaign::{
    CampaignError, CampaignSummary, Origin, Row, Shard, Share, Table, Weights, read_table, statistics,
};
use crate::output;

/// Treatment of missing shards.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MissingShards {
    Refuse,
    /// The merged table has only the shards that were given.
    LeaveOut,
}

/// Shards found so far, from the summaries next to their tables.
#[derive(Default)]
struct Shares {
    first: Option<Share>,
    found: BTreeSet<Shard>,
}

impl Shares {
    fn add(&mut self, path: &Path, share: Share) -> Result<(), CampaignError> {
        let first = self.first.get_or_insert_with(|| share.clone());
        if first.seeds != share.seeds || !first.shard.all().any(|shard| shard == share.shard) {
            let [a, b] = [&share, first].map(|share| {
                let [low, high] = share.seeds;
                format!("shard {} of the seeds {low}..{high}", share.shard)
            });
            let problem = format!("is {a}, and the first table is {b}: one number of shards and one range of seeds");
            return Err(CampaignError::Table { path: path.to_owned(), problem });
        }
        self.found.insert(share.shard);
        Ok(())
    }

    /// Shards without a table.
    fn missing(&self) -> Vec<Shard> {
        let all = self.first.iter().flat_map(|first| first.shard.all());
        all.filter(|shard| !self.found.contains(shard)).collect()
    }
}

/// Merges tables of one campaign. A row in several tables must be the same in all.
///
/// # Errors
/// [`CampaignError`] for tables of different campaigns, figures or numbers of shards, and for rows that contradict each
/// other. Also for an unfinished shard, and for missing ones unless they may be omitted.
pub fn merge(paths: &[PathBuf], missing: MissingShards) -> Result<(Table, CampaignSummary), CampaignError> {
    let mut shares = Shares::default();
    let mut rows: BTreeMap<(u32, u64), Row> = BTreeMap::new();
    let mut names: Option<Vec<String>> = None;
    let mut of: Option<(String, String, Option<Origin>)> = None;
    let mut weights: Option<Weights> = None;
    for path in paths {
        if !path.exists() && output::partial(path).exists() {
            return Err(CampaignError::Unfinished { path: path.clone() });
        }
        let table = read_table(path)?;
        let problem = |problem: &str| CampaignError::Table { path: path.clone(), problem: problem.to_owned() };
        if names.get_or_insert_with(|| table.names.clone()) != &table.names {
            return Err(problem("has other columns than the first table"));
        }
        if let Some(summary) = read_summary(path)? {
            weights = match (weights, summary.weights()) {
                (Some(known), Some(more)) => Some(known.joined(more)),
                (known, more) => known.or(more),
            };
            if let Some(share) = summary.share {
                shares.add(path, share)?;
            }
            let its = (summary.routine, summary.fingerprint, summary.origin);
            if of.get_or_insert_with(|| its.clone()) != &its {
                return Err(problem("is of another campaign than the tables before it, by the summaries beside them"));
            }
        }
        for row in table.rows {
            let (setting, seed) = row.key();
            if rows.get(&row.key()).is_some_and(|known| known != &row) {
                return Err(CampaignError::Conflict { path: path.clone(), setting, seed });
            }
            rows.insert(row.key(), row);
        }
    }
    let absent = shares.missing();
    if missing == MissingShards::Refuse && !absent.is_empty() {
        return Err(CampaignError::MissingShards { shards: absent });
    }
    let table = Table { names: names.unwrap_or_default(), rows: rows.into_values().collect() };
    let (routine, fingerprint, origin) = of.unwrap_or_default();
    let summary = CampaignSummary { origin, ..statistics(&table, &routine, &fingerprint) }.weighed(weights.as_ref());
    Ok((table, summary))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::table_file::tests::{names, row};
    use crate::campaign::{ExistingRows, Store, table_text};

    #[test]
    fn shards_together_are_the_whole() {
        let folder = tempfile::tempdir().expect("a folder");
        let campaign = |name: &str, fingerprint: &str, keys: &[(u32, u64)]| {
            let out = folder.path().join(name);
            let mut store = Store::open(&out, fingerprint, names(), ExistingRows::Keep).expect("opened");
            for (setting, seed) in keys {
                store.append(row(*setting, *seed)).expect("kept");
            }
            (store.finish("r").expect("finished"), out)
        };
        let merge = |paths: &[PathBuf]| merge(paths, MissingShards::Refuse);
        let (whole, _) = campaign("whole.csv", "f", &[(0, 1), (0, 2), (0, 3), (1, 1), (1, 2), (1, 3)]);
        let (_, first) = campaign("first.csv", "f", &[(1, 1), (0, 1), (0, 3), (1, 3)]);
        let (_, second) = campaign("second.csv", "f", &[(0, 2), (1, 2), (0, 1)]);
        assert_eq!(merge(&[second.clone(), first.clone()]).expect("merged"), whole);
        let (_, other) = campaign("other.csv", "g", &[(0, 9)]);
        assert!(matches!(merge(&[first.clone(), other]), Err(CampaignError::Table { .. })));
        let changed = crate::campaign::Row { exit_code: 4, ..row(0, 1) };
        let liar = folder.path().join("liar.csv");
        std::fs::write(&liar, table_text(&Table { names: names(), rows: vec![changed] })).expect("written");
        assert!(matches!(merge(&[first, liar]), Err(CampaignError::Conflict { setting: 0, seed: 1, .. })));
    }

    #[test]
    fn shards_that_are_missing_are_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let shard = |k: u64, n: u64, seeds: [u64; 2]| {
            let out = folder.path().join(format!("{k}-of-{n}-{}.csv", seeds[1]));
            let store = Store::open(&out, "f", names(), ExistingRows::Keep).expect("opened");
            let shard = format!("{k}/{n}").parse().expect("a shard");
            let mut store = store.sharing(Some(Share { shard, seeds }));
            store.append(row(0, k)).expect("kept");
            store.finish("r").expect("finished");
            out
        };
        let [first, second, third] = [1, 2, 3].map(|k| shard(k, 3, [1, 3]));
        let (whole, _) =
            merge(&[first.clone(), second.clone(), third.clone()], MissingShards::Refuse).expect("all are there");
        assert_eq!(whole.rows.len(), 3);
        let two = [third.clone(), first.clone()];
        let mut told = vec![merge(&two, MissingShards::Refuse).expect_err("one is missing")];
        let (rest, summary) = merge(&two, MissingShards::LeaveOut).expect("two of three");
        assert_eq!((rest.rows.len(), summary.share), (2, None));
        // One has another number of shards, the other has other seeds.
        for other in [shard(2, 4, [1, 3]), shard(2, 3, [1, 9])] {
            told.push(merge(&[first.clone(), other], MissingShards::LeaveOut).expect_err("other shares"));
        }
        let under_way = folder.path().join("late.csv");
        std::fs::write(output::partial(&under_way), "# armcal campaign f\n").expect("written");
        told.push(merge(&[first, under_way], MissingShards::LeaveOut).expect_err("not at its end"));
        let told = told.iter().map(|problem| format!("{problem}\n")).collect::<String>();
        insta::assert_snapshot!("shards", told.replace(&folder.path().display().to_string(), "FOLDER"));
    }
}
