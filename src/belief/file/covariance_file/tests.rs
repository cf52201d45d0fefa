//! Two files that belong together, and the errors of files that do not.

use crate::file::calibration::Calibration;
use crate::file::covariance_file::*;
use crate::fixture::{estimate, titan, with_terms};
use armcal_core::stats::stream_rng;

/// Writes both files; returns the calibration's path.
fn written(folder: &Path, calibration: &Calibration) -> PathBuf {
    let (file, texts) = (folder.join("calibration.toml"), calibration.to_files());
    std::fs::write(&file, texts.calibration).expect("written");
    std::fs::write(covariance_file(&file), texts.covariance).expect("written");
    file
}

fn with_covariance(seed: u64) -> Calibration {
    let robot = titan();
    let (parameters, covariance) = estimate(&robot, 5, 2e-3, &mut stream_rng(seed, "covariance file"));
    with_terms(&robot, &parameters, &covariance)
}

#[test]
fn both_files_come_back_as_they_were() {
    for seed in 0..5 {
        let (folder, full) = (tempfile::tempdir().expect("a folder"), with_covariance(seed));
        let file = written(folder.path(), &full);
        assert!(file.with_file_name("calibration.covariance.toml").is_file());
        let read = Calibration::read(&file).expect("it reads");
        assert_eq!(read.covariance, full.covariance);
        assert_eq!(
            Calibration { covariance_hash: None, ..read.clone() },
            Calibration { covariance_hash: None, ..full.clone() }
        );
        assert_eq!(read.to_files(), full.to_files(), "written again, nothing changes");
    }
}

#[test]
fn comments_do_not_part_them_and_numbers_do() {
    let (folder, full) = (tempfile::tempdir().expect("a folder"), with_covariance(1));
    let file = written(folder.path(), &full);
    let text = std::fs::read_to_string(&file).expect("it reads");
    std::fs::write(&file, format!("# fitted on the bench\r\n\r\n{}", text.replace('\n', "\r\n"))).expect("written");
    assert_eq!(Calibration::read(&file).expect("still its own").covariance, full.covariance);
    std::fs::write(&file, text.replacen("views = 14", "views = 15", 1)).expect("written");
    let error = Calibration::read(&file).expect_err("edited");
    assert!(matches!(error, CalibrationFileError::ForeignCovariance { .. }), "{error}");
}

#[test]
fn a_missing_a_foreign_and_a_broken_one_are_named() {
    let (folder, other) = (tempfile::tempdir().expect("a folder"), tempfile::tempdir().expect("a folder"));
    let file = written(folder.path(), &with_covariance(1));
    let foreign = covariance_file(&written(other.path(), &with_covariance(2)));
    let place = covariance_file(&file);
    let told = || Calibration::read(&file).expect_err("refused");
    let in_words = |error: &CalibrationFileError| error.to_string().replace(&folder.path().display().to_string(), "..");

    std::fs::copy(foreign, &place).expect("copied");
    let foreign = told();
    assert!(matches!(foreign, CalibrationFileError::ForeignCovariance { .. }), "{foreign}");
    let own = with_covariance(1).to_files().covariance;
    std::fs::write(&place, own.replacen("lower_triangle = [", "lower_triangle = [[1.0], ", 1)).expect("written");
    let broken = told();
    assert!(matches!(broken, CalibrationFileError::File(_)), "{broken}");
    std::fs::remove_file(&place).expect("removed");
    let missing = told();
    assert!(matches!(missing, CalibrationFileError::NoCovariance { .. }), "{missing}");
    insta::assert_snapshot!("covariance_files", [foreign, broken, missing].each_ref().map(in_words).join("\n"));
    // The calibration file without its covariance still gives angles.
    let text = std::fs::read_to_string(&file).expect("it reads");
    let alone = Calibration::parse(&file, &text).expect("it reads alone");
    assert!(alone.sensors(&titan()).is_ok() && alone.covariance.parameters.is_empty());
    assert_eq!(alone.to_toml(), text, "the hash of what was not read stays");
}

/// Older files hold the covariance as a table.
#[test]
fn a_covariance_inside_the_file_still_reads() {
    let (folder, full) = (tempfile::tempdir().expect("a folder"), with_covariance(3));
    let inside = toml::to_string(&full.covariance).expect("a table");
    let text: String =
        full.to_toml().lines().filter(|l| !l.starts_with("covariance_hash")).map(|l| format!("{l}\n")).collect();
    let file = folder.path().join("old.toml");
    std::fs::write(&file, format!("{text}\n[covariance]\n{inside}")).expect("written");
    assert_eq!(Calibration::read(&file).expect("it reads"), full);
}
