//! Robots and routines that come with the program, by their names.
//!
//! `titan4` is the folder `robots/titan4` and `titan4-quickstart` the file `routines/titan4-quickstart.toml`. They are
//! searched in the working directory, then in the shared folder: the one that was set, or else the program's own.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// The shared folder, with `robots` and `routines`, that was set.
static SHARED: OnceLock<PathBuf> = OnceLock::new();

/// Sets the folder with `robots` and `routines`, for a program in another folder. Only the first call has an effect.
pub fn set_shared_folder(folder: PathBuf) {
    let _ = SHARED.set(folder);
}

/// The robot folder of this name, or `given` where there is such a path or no such name.
#[must_use]
pub fn robot_folder(given: &Path) -> PathBuf {
    found(given, |name| Path::new("robots").join(name))
}

/// The routine of this name, or `given` where there is such a path or no such name.
#[must_use]
pub fn routine_file(given: &Path) -> PathBuf {
    found(given, |name| Path::new("routines").join(format!("{name}.toml")))
}

fn found(given: &Path, place: impl Fn(&str) -> PathBuf) -> PathBuf {
    let name = given.to_str().filter(|name| !name.contains(['/', '\\', '.']) && !given.exists());
    let Some(place) = name.map(place) else { return given.to_owned() };
    let of_program = || Some(std::env::current_exe().ok()?.parent()?.to_owned());
    let folders = [Some(PathBuf::new()), SHARED.get().cloned(), of_program()];
    let places = folders.into_iter().flatten().map(|folder| folder.join(&place));
    places.into_iter().find(|path| path.exists()).unwrap_or_else(|| given.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_a_file_of_the_shared_folder_and_a_path_stays() {
        // Tests run in the package's folder.
        assert_eq!(robot_folder(Path::new("titan4")), Path::new("robots/titan4"));
        assert_eq!(routine_file(Path::new("titan4-quickstart")), Path::new("routines/titan4-quickstart.toml"));
        for given in ["robots/titan4", "no-such", "src", "titan4.toml", "../titan4"] {
            assert_eq!(robot_folder(Path::new(given)), Path::new(given));
        }
    }
}
