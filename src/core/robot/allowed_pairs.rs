//! `allowed_pairs` of robot.toml: parts that touch by design, between which neither planning nor the simulator keeps a
//! distance.

use crate::codes::Code;
use std::path::Path;

use super::body::LinkBody;
use super::error::FileIssue;
use super::vehicle::Vehicle;

/// Pairs of links, or of a link and a part of the vehicle, that may touch.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct AllowedPairs(Vec<[String; 2]>);

impl AllowedPairs {
    pub(super) fn check(file: &Path, pairs: Vec<[String; 2]>, bodies: &[LinkBody]) -> Result<Self, FileIssue> {
        let links: Vec<&str> = bodies[1..].iter().map(|body| body.name.as_str()).collect();
        for (k, pair) in pairs.iter().enumerate() {
            if !pair.iter().any(|name| links.contains(&name.as_str())) || pair[0] == pair[1] {
                let problem = format!("{pair:?} needs a moving link and another part; moving links are {links:?}");
                return Err(FileIssue::new(Code::ValueInvalid, file, format!("allowed_pairs[{k}]"), problem));
            }
        }
        Ok(Self(pairs))
    }

    /// Returns true if two parts may touch, in either order.
    #[must_use]
    pub fn has(&self, a: &str, b: &str) -> bool {
        self.0.iter().any(|[first, second]| (first == a && second == b) || (first == b && second == a))
    }

    /// Checks that every name is one of the arm's links or one of the vehicle's parts.
    pub(super) fn check_names(&self, file: &Path, bodies: &[LinkBody], vehicle: &Vehicle) -> Result<(), FileIssue> {
        let is_known = |name: &String| {
            bodies.iter().any(|body| body.name == *name) || vehicle.parts.iter().any(|part| part.name == *name)
        };
        let unknown = |(k, pair): (usize, &[String; 2])| {
            let name = pair.iter().find(|name| !is_known(name))?;
            let problem = format!("`{name}` is neither a link of the arm nor a part of the vehicle `{}`", vehicle.name);
            Some(FileIssue::new(Code::ValueInvalid, file, format!("allowed_pairs[{k}]"), problem))
        };
        self.0.iter().enumerate().find_map(unknown).map_or(Ok(()), Err)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::{load, load_vehicle};

    #[test]
    fn names_are_those_of_links_and_of_the_vehicles_parts() {
        let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots");
        let vehicle = load_vehicle(&root.join("vehicles/work-class-front.toml")).expect("the vehicle reads");
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::copy(root.join("titan4/titan4.urdf"), folder.path().join("titan4.urdf")).expect("copied");
        let text = std::fs::read_to_string(root.join("titan4/robot.toml")).expect("read");
        let with = |pairs: &str| {
            std::fs::write(folder.path().join("robot.toml"), format!("allowed_pairs = {pairs}\n{text}"))
                .expect("written");
            load(folder.path()).and_then(|robot| robot.mounted_on(&vehicle)).map_err(|error| error.to_string())
        };
        let robot =
            with("[[\"trunk_link\", \"equipment_core\"], [\"base_link\", \"forearm_link\"]]").expect("it reads");
        assert!(robot.allowed_pairs.has("equipment_core", "trunk_link"));
        assert!(robot.allowed_pairs.has("base_link", "forearm_link"));
        assert!(!robot.allowed_pairs.has("base_link", "trunk_link"));
        let told =
            ["base_link\", \"equipment_core", "forearm_link\", \"forearm_link", "forearm_link\", \"lamp"].map(|pair| {
                let told = with(&format!("[[\"{pair}\"]]")).expect_err("refused");
                told.replace(&folder.path().display().to_string(), "FOLDER")
            });
        insta::assert_snapshot!("allowed_pairs", told.join("\n"));
    }
}
