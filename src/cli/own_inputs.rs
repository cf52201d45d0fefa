//! Outputs at the path of a file that the same command reads.

use std::path::Path;

use armcal_core::codes::Code;

use crate::cli::exit::UsageError;

/// Refuses an output that would overwrite one of `inputs`, through links as well.
///
/// # Errors
/// Error with the output's path, if it leads to an input.
pub(super) fn spare_inputs<'a>(output: &Path, inputs: impl IntoIterator<Item = &'a Path>) -> Result<(), UsageError> {
    let Ok(place) = output.canonicalize() else { return Ok(()) };
    let is_output = |input: &Path| input.canonicalize().is_ok_and(|input| input == place);
    if !inputs.into_iter().any(is_output) {
        return Ok(());
    }
    let file = output.display();
    Err(UsageError::new(Code::FileExists, format!("{file}: this command reads it, and would overwrite it; {REMEDY}")))
}

const REMEDY: &str = "name another file or folder to write";

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_core::codes::Coded;

    #[test]
    fn an_output_is_an_input_by_any_of_its_names() {
        let dir = tempfile::tempdir().unwrap();
        let [input, other, absent] = ["a.csv", "b.csv", "c.csv"].map(|name| dir.path().join(name));
        std::fs::write(&input, "1").unwrap();
        std::fs::write(&other, "2").unwrap();
        std::fs::create_dir(dir.path().join("sub")).unwrap();
        let roundabout = dir.path().join("sub/../a.csv");
        for output in [&input, &roundabout] {
            let error = spare_inputs(output, [other.as_path(), &input]).unwrap_err();
            assert_eq!(error.code(), Code::FileExists);
        }
        for output in [&other, &absent] {
            assert!(spare_inputs(output, [input.as_path(), Path::new("-")]).is_ok());
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_link_to_an_input_counts_as_the_input() {
        let dir = tempfile::tempdir().unwrap();
        let [input, link] = ["a.csv", "link.csv"].map(|name| dir.path().join(name));
        std::fs::write(&input, "1").unwrap();
        std::os::unix::fs::symlink(&input, &link).unwrap();
        assert!(spare_inputs(&link, [input.as_path()]).is_err());
        assert!(spare_inputs(&input, [link.as_path()]).is_err());
    }
}
