//! Hash of all inputs that a campaign's rows depend on.

use toml::Table;

use crate::campaign::CampaignError;
use crate::run::RunInputs;
use armcal_core::files::{self, FileKind};

/// Version of the rows' meaning; a new meaning needs a new version.
const DOMAIN: &[u8] = b"armcal campaign 1";

/// BLAKE3 over the routine with its overrides, the files that its settings name, and the program's version; 64
/// hexadecimal digits. Seeds, weights and `[regress]` are omitted: they select or judge rows and do not change their
/// contents. Comments and paths of files are omitted too.
///
/// # Errors
/// [`CampaignError::Read`] for a file that has vanished meanwhile.
pub fn fingerprint(effective: &Table, settings: &[RunInputs]) -> Result<String, CampaignError> {
    let mut hasher = blake3::Hasher::new();
    let mut add = |bytes: &[u8]| {
        hasher.update(&(bytes.len() as u64).to_le_bytes());
        hasher.update(bytes);
    };
    add(DOMAIN);
    add(env!("CARGO_PKG_VERSION").as_bytes());
    add(without_seeds(effective).to_string().as_bytes());
    for inputs in settings {
        for path in [inputs.robot.folder.join("robot.toml"), inputs.routine.vehicle_file.clone()] {
            add(&files::read_bytes(&path, FileKind::Text).map_err(|source| CampaignError::Read { path, source })?);
        }
        add(inputs.robot.urdf_text.as_bytes());
    }
    Ok(hasher.finalize().to_hex().to_string())
}

/// The routine without seeds and limits. It omits paths of files as well, because their contents count.
pub(super) fn without_seeds(effective: &Table) -> Table {
    let mut table = effective.clone();
    for key in ["seed", "regress", "robot", "vehicle"] {
        table.remove(key);
    }
    if let Some(campaign) = table.get_mut("campaign").and_then(toml::Value::as_table_mut) {
        campaign.remove("seeds");
        campaign.remove("weights");
        if campaign.is_empty() {
            table.remove("campaign");
        }
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> String {
        fingerprint(&text.parse().expect("TOML"), &[]).expect("no files")
    }

    #[test]
    fn seeds_and_budgets_do_not_count_and_all_else_does() {
        let base = "name = \"a\"\n[world.camera]\nrate_hz = 5.0\n";
        assert_eq!(of(base), of(&format!("# a comment\nseed = 3\n{base}[campaign]\nseeds = \"1..9\"\n[regress]\n")));
        assert_eq!(of(base).len(), 64);
        for other in [
            base.replace("5.0", "6.0"),
            base.replace("\"a\"", "\"b\""),
            format!("{base}[campaign.matrix]\n\"world.camera.rate_hz\" = [1.0]\n"),
        ] {
            assert_ne!(of(base), of(&other), "{other}");
        }
    }
}
