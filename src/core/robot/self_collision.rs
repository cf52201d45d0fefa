//! The file self_collision.toml of a robot folder: pairs of links that can come near each other.
//!
//! `plan::sample_self_pairs` (`new-robot --self-collision`) finds them by sampling; planning skips all other pairs. The
//! file holds the hash of the URDF and is valid for that URDF only.

use crate::codes::Code;
use crate::kind::Kind;
use crate::schema::{first_line, schema_of};
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::body::LinkBody;
use super::error::{FileIssue, RobotError, read_in};
use super::nominal::Robot;
use super::self_pairs::{SelfPair, SelfPairs};
use crate::document::{VERSION, parse_file};

/// Name of the file in a robot folder.
pub const SELF_COLLISION_FILE: &str = "self_collision.toml";

#[derive(Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct SelfCollisionFile {
    version: u32,
    #[serde(default = "Kind::self_collision")]
    kind: Kind,
    /// BLAKE3 of the URDF's text.
    urdf_blake3: String,
    /// Seed of the random configurations.
    seed: u64,
    /// Number of random configurations.
    n: u64,
    /// Distance below which a pair is listed.
    near_m: f64,
    /// Pairs of links that can come near each other.
    #[serde(default)]
    pair: Vec<PairFile>,
}

#[derive(Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct PairFile {
    /// Names of the two links.
    links: [String; 2],
    /// Smallest distance found.
    nearest_m: f64,
}

/// Returns the schema of self_collision.toml.
#[must_use]
pub fn self_collision_schema() -> serde_json::Value {
    schema_of::<SelfCollisionFile>(Kind::SelfCollision)
}

impl SelfPairs {
    /// Returns the text of the file for this robot.
    ///
    /// # Errors
    /// [`FileIssue`] if it has no TOML form.
    pub fn to_toml(&self, file: &Path, robot: &Robot) -> Result<String, FileIssue> {
        let name = |body: usize| robot.bodies[body].name.clone();
        let raw = SelfCollisionFile {
            version: VERSION,
            kind: Kind::SelfCollision,
            urdf_blake3: hash(&robot.urdf_text),
            seed: self.seed,
            n: self.n,
            near_m: self.near_m,
            pair: self
                .pairs
                .iter()
                .map(|pair| PairFile { links: pair.bodies.map(name), nearest_m: (pair.nearest_m * 1e4).floor() / 1e4 })
                .collect(),
        };
        let text = toml::to_string(&raw)
            .map_err(|error| FileIssue::new(Code::Internal, file, "pair", format!("has no TOML form: {error}")))?;
        Ok(format!(
            "{}# Links of this arm that can come nearer to each other than near_m, among n random configurations \
             within the joint\n\
             # limits and the datasheet's errors beyond them. Neighbours along the chain are left out. Made by\n\
             # `armcal new-robot --self-collision {}`; make it anew when the URDF changes.\n{text}",
            first_line(Kind::SelfCollision),
            robot.folder.display()
        ))
    }
}

/// Content of the file in a robot folder.
pub(super) enum Stored {
    Pairs(SelfPairs),
    /// Pairs of another URDF: planning must not use them.
    Stale(FileIssue),
    None,
}

/// Reads the file of a robot folder, if there is one.
pub(super) fn read(folder: &Path, urdf_text: &str, bodies: &[LinkBody]) -> Result<Stored, RobotError> {
    let file = folder.join(SELF_COLLISION_FILE);
    if !file.exists() {
        return Ok(Stored::None);
    }
    let raw: SelfCollisionFile = parse_file(Kind::SelfCollision, &file, &read_in(folder, &file)?)?;
    FileIssue::check_range(&file, "near_m", raw.near_m, 0.0..=10.0)?;
    if raw.urdf_blake3 != hash(urdf_text) {
        let problem = format!(
            "is of another URDF; make the file again with `armcal new-robot --self-collision {}`, or remove it",
            folder.display()
        );
        return Ok(Stored::Stale(FileIssue::new(Code::RobotMismatch, &file, SELF_COLLISION_FILE, problem)));
    }
    let mut pairs = Vec::new();
    for (k, pair) in raw.pair.iter().enumerate() {
        let body = |name: &String| {
            let problem = || {
                FileIssue::new(
                    Code::ValueInvalid,
                    &file,
                    format!("pair[{k}].links"),
                    format!("`{name}` is neither the base nor a moving link"),
                )
            };
            bodies.iter().position(|body| body.name == *name).ok_or_else(problem)
        };
        let (a, b) = (body(&pair.links[0])?, body(&pair.links[1])?);
        FileIssue::check_range(&file, &format!("pair[{k}].nearest_m"), pair.nearest_m, 0.0..=10.0)?;
        pairs.push(SelfPair { bodies: [a.min(b), a.max(b)], nearest_m: pair.nearest_m });
    }
    Ok(Stored::Pairs(SelfPairs { seed: raw.seed, n: raw.n, near_m: raw.near_m, pairs }))
}

fn hash(urdf_text: &str) -> String {
    blake3::hash(urdf_text.as_bytes()).to_hex().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stored_list_is_read_again_and_a_stale_one_stops_planning_alone() {
        let source = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots/titan4");
        let folder = tempfile::tempdir().expect("a folder");
        for name in ["robot.toml", "titan4.urdf"] {
            std::fs::copy(source.join(name), folder.path().join(name)).expect("copied");
        }
        let robot = super::super::load(folder.path()).expect("it reads without a list");
        assert_eq!(robot.self_pairs, None);
        let pair = |bodies, nearest_m| SelfPair { bodies, nearest_m };
        let pairs = SelfPairs { seed: 3, n: 10, near_m: 0.2, pairs: vec![pair([0, 3], 0.0), pair([1, 6], 0.125)] };
        let file = folder.path().join(SELF_COLLISION_FILE);
        std::fs::write(&file, pairs.to_toml(&file, &robot).expect("TOML")).expect("written");
        let read = super::super::load(folder.path()).expect("it reads").self_pairs.expect("a list");
        assert_eq!(read, pairs);
        assert!(read.has(1, 6) && !read.has(0, 4));
        let urdf = folder.path().join("titan4.urdf");
        std::fs::write(&urdf, robot.urdf_text.replace("0.83228", "0.83229")).expect("written");
        let stale = super::super::load(folder.path()).expect("it reads without the stale list");
        assert_eq!(stale.self_pairs, None);
        let error = stale.require_planning().expect_err("another drawing").to_string();
        insta::assert_snapshot!("stale_list", error.replace(&folder.path().display().to_string(), "FOLDER"));
        assert!(super::super::load_without_pairs(folder.path()).is_ok());
    }
}
