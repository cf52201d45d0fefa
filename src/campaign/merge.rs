//! The tables of several shards as one.

use std::collections::BTreeMap;
use std::path::PathBuf;

use crate::campaign::store::read_summary;
use crate::campaign::{CampaignError, CampaignSummary, Origin, Row, Table, read_table, statistics};

/// Puts tables of one campaign together. A row that is in several must be the same in all.
///
/// # Errors
/// [`CampaignError`] for tables of different campaigns or figures, and rows that contradict each other.
pub fn merge(paths: &[PathBuf]) -> Result<(Table, CampaignSummary), CampaignError> {
    let mut rows: BTreeMap<(u32, u64), Row> = BTreeMap::new();
    let mut names: Option<Vec<String>> = None;
    let mut of: Option<(String, String, Option<Origin>)> = None;
    for path in paths {
        let table = read_table(path)?;
        let problem = |problem: &str| CampaignError::Table { path: path.clone(), problem: problem.to_owned() };
        if names.get_or_insert_with(|| table.names.clone()) != &table.names {
            return Err(problem("has other columns than the first table"));
        }
        if let Some(summary) = read_summary(path)? {
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
    let table = Table { names: names.unwrap_or_default(), rows: rows.into_values().collect() };
    let (routine, fingerprint, origin) = of.unwrap_or_default();
    let summary = CampaignSummary { origin, ..statistics(&table, &routine, &fingerprint) };
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
}
