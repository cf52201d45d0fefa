//! Rows on disk: each one as soon as it is complete, and all in order at the end.
//!
//! While a campaign runs, rows grow in FILE.partial: a line with the fingerprint, the names, then rows in the order in
//! which runs ended. Each row is flushed and synced, so a kill can damage only the last line. At the end FILE and its
//! companions are written completely and put in place, and FILE.partial is removed last. After a kill in between they
//! are only written again.

use std::collections::BTreeSet;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use crate::campaign::html::campaign_page;
use crate::campaign::statistics::{CampaignSummary, statistics};
use crate::campaign::table_file::{Table, parse_table, read_table, row_line, table_text};
use crate::campaign::tables::markdown;
use crate::campaign::{CampaignError, Origin, Row, Share, Stopping, UntilResult, Weights};
use crate::output::{self, OutputError};
use armcal_core::files::{self, FileKind};

/// Rows of one campaign, locked against other processes.
#[derive(Debug)]
pub struct Store {
    out: PathBuf,
    file: File,
    fingerprint: String,
    origin: Option<Origin>,
    share: Option<Share>,
    until: Vec<UntilResult>,
    weights: Option<Weights>,
    table: Table,
    /// True if the files in place already hold all rows.
    in_place: bool,
}

/// Treatment of rows that exist already.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExistingRows {
    /// Continue from the existing rows.
    Keep,
    Discard,
}

/// Beginning of a partial file's first line.
const MARK: &str = "# armcal campaign ";

impl Store {
    /// Opens the rows at `out` (a .csv), including those of earlier calls.
    ///
    /// # Errors
    /// [`CampaignError::OtherCampaign`] for rows of another fingerprint, [`CampaignError::Busy`], or an error of
    /// reading or writing.
    pub fn open(
        out: &Path,
        fingerprint: &str,
        names: Vec<String>,
        existing: ExistingRows,
    ) -> Result<Self, CampaignError> {
        output::make_folder(output::parent(out))?;
        let partial = output::partial(out);
        output::refuse_link(&partial)?;
        let file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&partial);
        let file = file.map_err(OutputError::of(&partial, "cannot be opened"))?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(CampaignError::Busy { path: out.to_owned() }),
            // Some file systems have no locks; then nothing prevents two writers.
            Err(TryLockError::Error(_)) => {}
        }
        let table = Table { names, rows: Vec::new() };
        let mut store = Self {
            out: out.to_owned(),
            file,
            fingerprint: fingerprint.to_owned(),
            origin: None,
            share: None,
            until: Vec::new(),
            weights: None,
            table,
            in_place: false,
        };
        let loaded = store.load(&partial, existing);
        if loaded.is_err() && std::fs::metadata(&partial).is_ok_and(|found| found.len() == 0) {
            let _ = std::fs::remove_file(&partial);
        }
        loaded.map(|()| store)
    }

    /// Sets the rows' origin for the summary.
    #[must_use]
    pub fn of(self, origin: Origin) -> Self {
        Self { origin: Some(origin), ..self }
    }

    /// Sets the share of a campaign that the rows are.
    #[must_use]
    pub fn sharing(self, share: Option<Share>) -> Self {
        Self { share, ..self }
    }

    /// Sets the weight of each setting.
    #[must_use]
    pub fn weighed(self, weights: Option<Weights>) -> Self {
        // Weights are no part of the fingerprint: the rows in place may have been summarised with other weights.
        Self { in_place: self.in_place && weights.is_none(), weights, ..self }
    }

    /// Ends the campaign early: records the answers, and removes the seeds that they do not need.
    #[must_use]
    pub fn answered(mut self, stopping: &Stopping) -> Self {
        let beyond = stopping.beyond();
        let n_before = self.table.rows.len();
        self.table.rows.retain(|row| !beyond.contains(&row.seed));
        self.until = stopping.results();
        self.in_place &= self.until.is_empty() && n_before == self.table.rows.len();
        self
    }

    fn load(&mut self, partial: &Path, existing: ExistingRows) -> Result<(), CampaignError> {
        if existing == ExistingRows::Discard {
            for path in results(&self.out).into_iter().chain([self.out.with_extension("parquet")]) {
                output::remove(&path)?;
            }
            return self.restart();
        }
        let mut bytes = Vec::new();
        self.file.read_to_end(&mut bytes).map_err(|source| CampaignError::Read { path: partial.to_owned(), source })?;
        if let Some(whole) = whole_lines(&bytes) {
            return self.resume(&bytes[..whole], partial);
        }
        if self.out.exists() {
            self.rows_in_place()?;
        }
        self.restart()
    }

    /// Takes over the rows of an interrupted campaign. `bytes` holds at least one whole line.
    fn resume(&mut self, bytes: &[u8], partial: &Path) -> Result<(), CampaignError> {
        let first = bytes.iter().position(|byte| *byte == b'\n').map_or(bytes.len(), |end| end + 1);
        if bytes[..first] != *self.mark_line().as_bytes() {
            return Err(CampaignError::OtherCampaign { path: partial.to_owned() });
        }
        if bytes.len() == first {
            return self.restart();
        }
        let table = parse_table(&bytes[first..])
            .map_err(|problem| CampaignError::Table { path: partial.to_owned(), problem })?;
        self.take_over(table, partial)?;
        let end = bytes.len() as u64;
        self.file
            .set_len(end)
            .and_then(|()| self.file.seek(SeekFrom::Start(end)))
            .map_err(OutputError::of(partial, "cannot be written"))?;
        Ok(())
    }

    /// Takes over the rows of a finished campaign.
    fn rows_in_place(&mut self) -> Result<(), CampaignError> {
        let other = || CampaignError::OtherCampaign { path: self.out.clone() };
        if read_summary(&self.out)?.is_none_or(|summary| summary.fingerprint != self.fingerprint) {
            return Err(other());
        }
        let path = self.out.clone();
        self.take_over(read_table(&path)?, &path)?;
        self.in_place = true;
        Ok(())
    }

    fn take_over(&mut self, table: Table, path: &Path) -> Result<(), CampaignError> {
        if table.names != self.table.names {
            return Err(CampaignError::OtherCampaign { path: path.to_owned() });
        }
        self.table = table;
        Ok(())
    }

    fn mark_line(&self) -> String {
        format!("{MARK}{}\n", self.fingerprint)
    }

    /// Writes a new partial file with the rows known so far.
    fn restart(&mut self) -> Result<(), CampaignError> {
        let path = output::partial(&self.out);
        let text = self.mark_line() + &table_text(&self.table);
        self.file
            .set_len(0)
            .and_then(|()| self.file.seek(SeekFrom::Start(0)))
            .and_then(|_| self.write(&text))
            .map_err(OutputError::of(&path, "cannot be written"))?;
        Ok(())
    }

    fn write(&mut self, text: &str) -> std::io::Result<()> {
        self.file.write_all(text.as_bytes())?;
        self.file.sync_data()
    }

    /// Setting and seed of every row in the store.
    #[must_use]
    pub fn done(&self) -> BTreeSet<(u32, u64)> {
        self.table.rows.iter().map(Row::key).collect()
    }

    #[must_use]
    pub fn table(&self) -> &Table {
        &self.table
    }

    /// Keeps a row.
    ///
    /// # Errors
    /// [`CampaignError::Output`] when it cannot be written.
    pub fn append(&mut self, row: Row) -> Result<(), CampaignError> {
        let text = row_line(&row, &self.table.names);
        self.write(&text).map_err(OutputError::of(&output::partial(&self.out), "cannot be written"))?;
        self.in_place = false;
        self.table.rows.push(row);
        Ok(())
    }

    /// Sorts the rows and puts the files in place.
    ///
    /// # Errors
    /// [`CampaignError`] naming the file that could not be written.
    pub fn finish(mut self, routine: &str) -> Result<(Table, CampaignSummary), CampaignError> {
        self.table.rows.sort_by_key(Row::key);
        let summary = statistics(&self.table, routine, &self.fingerprint);
        let summary = CampaignSummary { origin: self.origin, share: self.share, until: self.until, ..summary };
        let summary = summary.weighed(self.weights.as_ref());
        if !self.in_place {
            write_results(&self.out, &self.table, &summary)?;
        }
        output::remove(&output::partial(&self.out))?;
        Ok((self.table, summary))
    }
}

/// Length of the part of `bytes` that is whole lines; `None` without any whole line.
fn whole_lines(bytes: &[u8]) -> Option<usize> {
    bytes.iter().rposition(|byte| *byte == b'\n').map(|last| last + 1)
}

/// Paths of the table and of the files written with it.
fn results(out: &Path) -> [PathBuf; 4] {
    let bare = out.with_extension("");
    let beside = |suffix| output::with_suffix(&bare, suffix);
    [out.to_owned(), beside("-summary.json"), beside("-summary.md"), beside("-report.html")]
}

/// The summary next to a table; `None` if there is none.
pub(super) fn read_summary(out: &Path) -> Result<Option<CampaignSummary>, CampaignError> {
    let [_, path, ..] = results(out);
    match files::read_bytes(&path, FileKind::Table) {
        Ok(bytes) => serde_json::from_slice(&bytes)
            .map(Some)
            .map_err(|error| CampaignError::Table { path, problem: format!("is no summary of a campaign: {error}") }),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(source) => Err(CampaignError::Read { path, source }),
    }
}

/// Writes the table, sorted by the caller, as CSV (and Parquet, where the build has it). Writes its summary as JSON,
/// Markdown and a page.
///
/// # Errors
/// [`CampaignError`] naming the file that could not be written.
pub fn write_results(out: &Path, table: &Table, summary: &CampaignSummary) -> Result<(), CampaignError> {
    let [csv, json, text, html] = results(out);
    #[cfg(feature = "parquet")]
    crate::campaign::parquet_file::write_parquet(&out.with_extension("parquet"), table)?;
    // A Parquet file of another build would hold other rows.
    #[cfg(not(feature = "parquet"))]
    output::remove(&out.with_extension("parquet"))?;
    output::write_whole(&json, format!("{}\n", serde_json::to_string_pretty(summary)?).as_bytes())?;
    output::write_whole(&text, markdown(summary).as_bytes())?;
    output::write_whole(&html, campaign_page(table, summary).as_bytes())?;
    // The table comes last: it exists only with all files that belong to it.
    Ok(output::write_whole(&csv, table_text(table).as_bytes())?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::table_file::tests::{names, row};

    fn open(out: &Path, fingerprint: &str) -> Result<Store, CampaignError> {
        Store::open(out, fingerprint, names(), ExistingRows::Keep)
    }

    fn started(out: &Path, seeds: &[u64]) {
        let mut store = open(out, "f").expect("opened");
        for seed in seeds {
            store.append(row(0, *seed)).expect("kept");
        }
    }

    #[test]
    fn a_torn_line_is_dropped_and_whole_ones_stay() {
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("c.csv");
        started(&out, &[3, 1, 2]);
        let partial = output::partial(&out);
        let bytes = std::fs::read(&partial).expect("rows");
        let begins: Vec<usize> = bytes.iter().enumerate().filter(|(_, b)| **b == b'\n').map(|(at, _)| at + 1).collect();
        // Cuts at many places in the last line, and at a sample of those before it: each cut costs a dozen syncs.
        let last = begins[begins.len() - 2];
        for cut in (0..last).step_by(23).chain((last - 1..=bytes.len()).step_by(3)).chain([bytes.len()]) {
            std::fs::write(&partial, &bytes[..cut]).expect("cut");
            let store = open(&out, "f").expect("opened");
            // The file has two lines before the rows.
            let expected = begins.iter().filter(|begin| **begin <= cut).count().saturating_sub(2);
            assert_eq!(
                store.done(),
                [3, 1, 2].into_iter().take(expected).map(|seed| (0, seed)).collect(),
                "cut at {cut}"
            );
            let done = store.done();
            drop(store);
            let mut store = open(&out, "f").expect("opened again");
            for seed in [1, 2, 3, 4] {
                if !done.contains(&(0, seed)) {
                    store.append(row(0, seed)).expect("kept");
                }
            }
            let (table, _) = store.finish("r").expect("finished");
            assert_eq!(table.rows.iter().map(|row| row.seed).collect::<Vec<_>>(), [1, 2, 3, 4]);
            assert_eq!(read_table(&out).expect("it reads"), table);
            for path in results(&out) {
                std::fs::remove_file(path).expect("it was there");
            }
        }
    }

    #[test]
    fn files_do_not_depend_on_the_order_or_on_being_broken_off() {
        let bytes_of = |orders: &[&[u64]]| {
            let folder = tempfile::tempdir().expect("a folder");
            let out = folder.path().join("c.csv");
            for seeds in orders {
                started(&out, seeds);
            }
            open(&out, "f").expect("opened").finish("r").expect("finished");
            assert!(!output::partial(&out).exists());
            results(&out).map(|path| std::fs::read(path).expect("a result"))
        };
        let expected = bytes_of(&[&[1, 2, 3]]);
        assert!(bytes_of(&[&[3, 2, 1]]) == expected);
        assert!(bytes_of(&[&[2], &[3, 1]]) == expected);
        assert!(bytes_of(&[&[1, 2]]) != expected);
    }

    #[test]
    fn a_finished_campaign_takes_more_seeds_and_keeps_its_rows() {
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("c.csv");
        started(&out, &[1]);
        open(&out, "f").expect("opened").finish("r").expect("finished");
        let before = std::fs::read(&out).expect("rows");
        let store = open(&out, "f").expect("opened");
        assert_eq!(store.done().len(), 1);
        store.finish("r").expect("finished");
        assert!(std::fs::read(&out).expect("rows") == before);
        started(&out, &[2]);
        // The campaign was interrupted: the partial file holds the earlier rows, too.
        assert_eq!(open(&out, "f").expect("opened").done().len(), 2);
    }

    #[test]
    fn rows_of_another_campaign_are_left_alone() {
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("c.csv");
        started(&out, &[1]);
        assert!(matches!(open(&out, "g"), Err(CampaignError::OtherCampaign { .. })));
        open(&out, "f").expect("opened").finish("r").expect("finished");
        let error = open(&out, "g").expect_err("refused").to_string();
        assert!(error.contains("c.csv") && error.contains("--fresh"), "{error}");
        assert!(!output::partial(&out).exists(), "a refusal leaves nothing");
        let fresh = Store::open(&out, "g", names(), ExistingRows::Discard).expect("opened");
        assert!(fresh.done().is_empty() && !out.exists());
        assert!(matches!(open(&out, "g"), Err(CampaignError::Busy { .. })));
    }
}
