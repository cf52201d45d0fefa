//! Tables with which later runs can be compared.

use std::path::Path;

use crate::campaign::store::read_summary;
use crate::campaign::{CampaignError, Metric, Origin, Prepared, Request, Table, parse_table, read_table, table_text};
use armcal_core::files::{self, FileKind};
use armcal_core::routine::Overrides;

/// The table's text, with its routine, robot and vehicle in its first lines.
///
/// # Errors
/// [`CampaignError::Read`] for a file that has vanished meanwhile.
pub fn baseline_text(prepared: &Prepared, table: &Table) -> Result<String, CampaignError> {
    Ok(Origin::of_campaign(prepared)?.head() + &table_text(table))
}

/// Reads a baseline, or a campaign's table with its summary next to it, that `prepared` can be compared with. It must
/// have the same routine (without the current overrides), robot and vehicle, and all compared figures.
///
/// # Errors
/// [`CampaignError::Table`] that names the difference, and how to make a new baseline.
pub fn read_baseline(path: &Path, prepared: &Prepared) -> Result<Table, CampaignError> {
    let bytes = files::read_bytes(path, FileKind::Table)
        .map_err(|source| CampaignError::Read { path: path.to_owned(), source })?;
    let refused = |problem: String| CampaignError::Table { path: path.to_owned(), problem };
    let anew = |problem: String| {
        let (asked, file) = (command_options(&prepared.request), path.display());
        refused(format!("{problem}; make it anew: armcal regress {asked} --write-baseline {file}"))
    };
    let table = parse_table(&bytes).map_err(refused)?;
    let origin = match Origin::read(&String::from_utf8_lossy(&bytes)).map_err(anew)? {
        Some(origin) => Some(origin),
        None => read_summary(path)?.and_then(|summary| summary.origin),
    };
    let origin = origin.ok_or_else(|| anew("does not name its routine and robot".to_owned()))?;
    // The overrides are under test, unless the baseline was made with them.
    let (plainly, with_overrides) = (Origin::of(prepared, &[])?, Origin::of_campaign(prepared)?);
    if let (Some(difference), Some(_)) = (origin.difference(&plainly), origin.difference(&with_overrides)) {
        return Err(anew(difference));
    }
    match lacking(&table) {
        Some(metric) => Err(anew(format!("is of another version of armcal: it has no column {}", metric.name()))),
        None => Ok(table),
    }
}

/// The first compared figure that the table lacks.
fn lacking(table: &Table) -> Option<Metric> {
    Metric::COMPARED.iter().copied().find(|metric| table.place(*metric).is_none())
}

/// Reads the new rows from a campaign's table instead of running them. Only rows that have a partner in `baseline` are
/// kept.
///
/// # Errors
/// [`CampaignError::Table`] for a table without a figure that is compared, of another robot or vehicle, or with none of
/// the baseline's seeds and settings.
pub fn read_rows(path: &Path, prepared: &Prepared, baseline: &Table) -> Result<Table, CampaignError> {
    let mut table = read_table(path)?;
    let refused = |problem: String| Err(CampaignError::Table { path: path.to_owned(), problem });
    if let Some(metric) = lacking(&table) {
        return refused(format!("is of another version of armcal: it has no column {}", metric.name()));
    }
    if let Some(origin) = read_summary(path)?.and_then(|summary| summary.origin) {
        let mut here = Origin::of(prepared, &[])?;
        // Changes by `--set` may be under test; another routine is not.
        if here.routine.name == origin.routine.name {
            here.routine = origin.routine.clone();
        }
        if let Some(difference) = origin.difference(&here) {
            return refused(difference);
        }
    }
    table.rows.retain(|row| baseline.rows.iter().any(|b| b.seed == row.seed && b.settings == row.settings));
    if table.rows.is_empty() {
        return refused("has none of the baseline's seeds and settings".to_owned());
    }
    Ok(table)
}

/// Command options for the requested routine, robot and vehicle. Other changes by `--set` are under test, so no
/// baseline has them.
fn command_options(request: &Request) -> String {
    let mut words = request.routine.display().to_string();
    let Overrides { robot, vehicle, .. } = &request.overrides;
    for (option, path) in [("--robot ", robot), ("--set vehicle=", vehicle)] {
        if let Some(path) = path {
            words += &format!(" {option}{}", path.display());
        }
    }
    words
}
