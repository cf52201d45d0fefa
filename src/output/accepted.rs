//! Protection of an accepted calibration: a refused or less certain result is written next to it.

use std::fmt;
use std::path::{Path, PathBuf};

use armcal_belief::calib::{Calibration, Status};

/// Factor on the U95 of the result in place above which a new result is worse. Assumed: views of another day change U95
/// by a few percent.
const WORSE: f64 = 1.1;

/// Place of a result that does not replace the accepted one.
#[derive(Debug)]
pub struct AcceptedKept {
    /// Folder of the new result.
    pub folder: PathBuf,
    why: &'static str,
}

impl fmt::Display for AcceptedKept {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { folder, why } = self;
        write!(f, "the accepted calibration stays: the new one is {why}, and is in {}", folder.display())
    }
}

/// Returns the place of the new result if the accepted calibration in `out` stays; `None` if `new` replaces it.
pub fn accepted_kept(out: &Path, new: &Calibration) -> Option<AcceptedKept> {
    let old = Calibration::read(&out.join("calibration.toml")).ok()?;
    let is_accepted = old.status == Status::Accepted && old.robot == new.robot;
    let is_comparable = old.u95.tolerance_m.is_some() == new.u95.tolerance_m.is_some();
    let u95_m = old.u95.max_m.zip(new.u95.max_m).filter(|_| is_comparable);
    let is_worse = || u95_m.is_some_and(|(old_m, new_m)| new_m > WORSE * old_m);
    let (name, why) = match new.status {
        Status::Refused if is_accepted => ("refused", "refused"),
        Status::Accepted if is_accepted && is_worse() => ("worse", "less certain (larger U95)"),
        _ => return None,
    };
    Some(AcceptedKept { folder: out.join(name), why })
}
