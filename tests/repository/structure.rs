//! The structure of the sources: no import circles between files, short lines, short module roots.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use super::expect_none;
use crate::support::{files_below, root};

/// Folders of the members below `src/`; the rest of `src/` is the root crate.
const MEMBERS: [&str; 10] = ["core", "belief", "paper", "detect", "sim", "replay", "charts", "lab", "live", "python"];
const MAX_LINE: usize = 120;
/// Largest number of lines of a mod.rs or lib.rs without its documentation.
const MAX_MODULE_ROOT: usize = 60;

/// Rooms of the estimator, each of which imports only the ones before it. `calib.rs`, their front, is none of them.
const ROOMS: [&str; 17] = [
    "model",
    "measure",
    "judge",
    "say",
    "views",
    "positions",
    "solve",
    "file",
    "explain",
    "checks",
    "tagmap",
    "methods",
    "batch",
    "follow",
    "plan",
    "verify",
    "session",
];

/// Module path within a crate; empty for its root.
type Module = Vec<String>;

/// The files of one crate by module, without tests.
struct Sources {
    texts: BTreeMap<Module, String>,
    /// Re-exports of each module: the name there, and its full path.
    exports: BTreeMap<Module, BTreeMap<String, Vec<String>>>,
}

impl Sources {
    fn read(folder: &Path, is_of_crate: impl Fn(&Path) -> bool) -> Self {
        let mut texts = BTreeMap::new();
        for file in files_below(folder, "rs").into_iter().filter(|file| is_of_crate(file)) {
            let relative = file.strip_prefix(folder).expect("below").with_extension("");
            let mut module: Module = relative.iter().map(|part| part.to_string_lossy().into_owned()).collect();
            if module.last().is_some_and(|name| ["mod", "lib"].contains(&name.as_str())) {
                module.pop();
            }
            texts.insert(module, without_tests(&fs::read_to_string(&file).expect("the source reads")));
        }
        Self::of(texts)
    }

    fn of(texts: BTreeMap<Module, String>) -> Self {
        let export = |(module, text): (&Module, &String)| {
            let public = imports(text).into_iter().filter(|import| import.is_public);
            let named = public.map(|import| (import.path.last().cloned().unwrap_or_default(), import.path));
            (module.clone(), named.collect())
        };
        Self { exports: texts.iter().map(export).collect(), texts }
    }

    /// The module whose file defines what `path` names in `module`; `None` for other crates.
    fn resolve(&self, module: &Module, path: &[String], depth: usize) -> Option<Module> {
        let (first, rest) = path.split_first()?;
        let n_up = path.iter().take_while(|name| *name == "super").count();
        let full: Module = match first.as_str() {
            "crate" => rest.to_vec(),
            "self" => [module, rest].concat(),
            "super" => [module.get(..module.len().checked_sub(n_up)?)?, &path[n_up..]].concat(),
            _ => [module, path].concat(),
        };
        let is_local = ["crate", "self", "super"].contains(&first.as_str());
        if !is_local && !self.texts.contains_key(&full[..module.len() + 1]) {
            return None;
        }
        let n = (0..=full.len()).rev().find(|n| self.texts.contains_key(&full[..*n]))?;
        let found = full[..n].to_vec();
        let exported = full.get(n).and_then(|name| self.exports[&found].get(name)).filter(|_| depth < 8);
        exported.and_then(|path| self.resolve(&found, path, depth + 1)).or(Some(found))
    }

    /// Modules that each module imports, without its own ancestors and descendants.
    fn edges(&self) -> BTreeMap<&Module, BTreeSet<Module>> {
        let is_fixture = |module: &Module| {
            module.iter().any(|name| name == "tests")
                || module.last().is_some_and(|name| ["fixture", "samples"].contains(&name.as_str()))
        };
        let of = |(module, text): (_, &String)| {
            let targets = imports(text).into_iter().filter_map(|import| self.resolve(module, &import.path, 0));
            (module, targets.filter(|target| !target.starts_with(module) && !module.starts_with(target)).collect())
        };
        self.texts.iter().filter(|(module, _)| !is_fixture(module)).map(of).collect()
    }

    /// Modules that import each other, directly or through others.
    fn circles(&self) -> Vec<BTreeSet<Module>> {
        let edges = self.edges();
        let reached = |from: &Module| {
            let mut reached = BTreeSet::new();
            let mut open = vec![from.clone()];
            while let Some(module) = open.pop() {
                let next = edges.get(&module).into_iter().flatten();
                open.extend(next.filter(|module| reached.insert((*module).clone())).cloned());
            }
            reached
        };
        let reached: BTreeMap<&Module, BTreeSet<Module>> = edges.keys().map(|from| (*from, reached(from))).collect();
        let circle = |from: &&Module| {
            let others =
                reached[from].iter().filter(|other| reached.get(other).is_some_and(|back| back.contains(*from)));
            others.cloned().collect::<BTreeSet<Module>>()
        };
        let circles: BTreeSet<BTreeSet<Module>> = reached.keys().map(circle).filter(|c| !c.is_empty()).collect();
        circles.into_iter().collect()
    }
}

struct Import {
    is_public: bool,
    path: Vec<String>,
}

/// A source without line comments and without its `mod tests { .. }`.
pub(super) fn without_tests(text: &str) -> String {
    let code = text.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n");
    let end = code
        .match_indices("#[cfg(test)]")
        .find(|(at, attribute)| code[at + attribute.len()..].trim_start().starts_with("mod tests {"));
    end.map_or(code.clone(), |(at, _)| code[..at].to_owned())
}

/// Paths of all `use` declarations, and those in the code that begin with `crate` or `super`.
fn imports(text: &str) -> Vec<Import> {
    let mut found = Vec::new();
    for (at, _) in text.match_indices("use ") {
        let line_start = text[..at].rfind('\n').map_or(0, |at| at + 1);
        let before = text[line_start..at].trim();
        let is_public = before.starts_with("pub");
        if (before.is_empty() || is_public && !before.contains(char::is_whitespace))
            && let Some((tree, _)) = text[at + "use ".len()..].split_once(';')
        {
            let mut paths = Vec::new();
            leaves(&[], tree, &mut paths);
            found.extend(paths.into_iter().map(|path| Import { is_public, path }));
        }
    }
    let is_name = |c: char| c.is_alphanumeric() || c == '_';
    for start in ["crate::", "super::"] {
        for (at, _) in text.match_indices(start) {
            let is_start = !text[..at].ends_with(|c| is_name(c) || c == ':');
            let end = text[at..].find(|c| !is_name(c) && c != ':').unwrap_or(text.len() - at);
            let path = text[at..at + end].split("::").filter(|name| !name.is_empty()).map(str::to_owned).collect();
            found.extend(is_start.then_some(Import { is_public: false, path }));
        }
    }
    found
}

/// The paths of a `use` tree.
fn leaves(before: &[String], tree: &str, paths: &mut Vec<Vec<String>>) {
    let names =
        |text: &str| text.split("::").map(str::trim).filter(|name| !name.is_empty()).map(str::to_owned).collect();
    let Some((start, group)) = tree.trim().split_once('{') else {
        let path: Vec<String> = names(tree.split(" as ").next().unwrap_or_default());
        return paths.extend((!path.is_empty()).then(|| [before, &path].concat()));
    };
    let prefix = [before, &names(start)].concat();
    let group = group.trim_end().strip_suffix('}').unwrap_or(group);
    let mut depth = 0;
    for branch in group.split(|c| {
        depth += i32::from(c == '{') - i32::from(c == '}');
        c == ',' && depth == 0
    }) {
        leaves(&prefix, branch, paths);
    }
}

#[test]
fn no_import_circles() {
    let src = root().join("src");
    let is_of_root =
        |file: &Path| !MEMBERS.iter().any(|member| file.starts_with(src.join(member))) && file != src.join("main.rs");
    let mut crates = vec![("armcal".to_owned(), Sources::read(&src, is_of_root))];
    crates.extend(MEMBERS.map(|member| (format!("armcal_{member}"), Sources::read(&src.join(member), |_| true))));
    crates.push((
        "tests".to_owned(),
        Sources::read(&root().join("tests"), |file| !file.starts_with(root().join("tests/oracle/kornia"))),
    ));
    assert!(crates.iter().all(|(_, sources)| sources.texts.len() >= 2));
    let circles = crates.iter().flat_map(|(name, sources)| {
        let in_words = move |circle: BTreeSet<Module>| {
            let names: Vec<String> = circle.iter().map(|module| module.join("::")).collect();
            format!("{name}: a circle of {}", names.join(", "))
        };
        sources.circles().into_iter().map(in_words)
    });
    expect_none(&circles.collect::<Vec<_>>());
}

/// Imports of a room listed later, as sentences.
fn imports_upwards(sources: &Sources, rooms: &[&str]) -> Vec<String> {
    let room = |module: &Module| rooms.iter().position(|room| module.first().is_some_and(|first| first == room));
    let edges = sources.edges().into_iter();
    let pairs = edges.flat_map(|(from, targets)| targets.into_iter().map(move |target| (from, target)));
    let upwards = pairs.filter(|(from, to)| room(from).zip(room(to)).is_some_and(|(from, to)| to > from));
    upwards.map(|(from, to)| format!("{} imports {}", from.join("::"), to.join("::"))).collect()
}

#[test]
fn rooms_of_the_estimator_import_down_only() {
    let folder = root().join("src/belief");
    let below = fs::read_dir(&folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    let below: BTreeSet<String> = below
        .filter(|path| path.is_dir())
        .map(|path| path.file_name().expect("a name").to_string_lossy().into_owned())
        .collect();
    assert_eq!(below, ROOMS.into_iter().map(str::to_owned).collect(), "each folder is a room, and has its place");
    let sources = Sources::read(&folder, |_| true);
    expect_none(&imports_upwards(&sources, &ROOMS));
    // The test can fail: the reversed order has imports up.
    let turned: Vec<&str> = ROOMS.into_iter().rev().collect();
    assert!(!imports_upwards(&sources, &turned).is_empty());
}

#[test]
fn lines_and_module_roots_are_short() {
    let mut violations = Vec::new();
    for folder in ["src", "tests", "benches", "examples"] {
        for file in files_below(&root().join(folder), "rs") {
            let text = fs::read_to_string(&file).expect("the source reads");
            let long = text.lines().enumerate().filter(|(_, line)| line.chars().count() > MAX_LINE);
            violations
                .extend(long.map(|(k, _)| format!("{}:{}: more than {MAX_LINE} characters", file.display(), k + 1)));
            let is_root = file.ends_with("mod.rs") || file.ends_with("lib.rs");
            let below = file.strip_prefix(root()).expect("a source of the repository");
            let is_of_tests = below.iter().any(|part| part == "tests");
            let n = text.lines().filter(|line| !line.starts_with("//!")).count();
            if is_root && !is_of_tests && n > MAX_MODULE_ROOT {
                violations.push(format!("{}: {n} lines, a module root has at most {MAX_MODULE_ROOT}", file.display()));
            }
        }
    }
    expect_none(&violations);
}

#[test]
fn circles_are_found() {
    let module = |path: &str| path.split("::").filter(|name| !name.is_empty()).map(str::to_owned).collect::<Module>();
    let sources = |files: &[(&str, &str)]| {
        Sources::of(files.iter().map(|(path, text)| (module(path), without_tests(text))).collect())
    };
    let root = ("", "mod a;\npub(crate) use a::inner::Thing;");
    let inner = ("a::inner", "pub struct Thing;\n#[cfg(test)]\nmod tests { use crate::b; }");
    let b = ("b", "use crate::{Thing, a::{self as other}};");
    let straight = sources(&[root, ("a", "mod inner;"), inner, b]);
    assert_eq!(straight.edges()[&module("b")], BTreeSet::from([module("a"), module("a::inner")]));
    assert!(straight.circles().is_empty());
    let around = sources(&[root, ("a", "mod inner;"), ("a::inner", "fn f() { super::super::b::g() }"), b]);
    assert_eq!(around.circles(), [BTreeSet::from([module("a::inner"), module("b")])]);
}
