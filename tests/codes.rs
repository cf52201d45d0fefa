//! Each code is used somewhere in the sources, and small files produce the classes of wrong input.

use std::collections::BTreeSet;
use std::path::Path;

use armcal_core::codes::{Code, CodeKind, explanation};

use crate::support::{
    Answer, ShortRoutine, answer, edit, files_below, program, read, robot_copy, root, temp, vehicle_file, write,
};

/// Variant names of the codes that a product source names outside the list of codes itself.
fn made() -> BTreeSet<String> {
    let src = root().join("src");
    let mut found = BTreeSet::new();
    for file in files_below(&src, "rs") {
        let place = file.strip_prefix(&src).expect("below").to_string_lossy().into_owned();
        if place.starts_with("core/codes/") || place.ends_with("tests.rs") || place.contains("/tests/") {
            continue;
        }
        let text = read(&file);
        let product = text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
        let names = product.split("Code::").skip(1);
        found
            .extend(names.map(|rest| rest.split(|c: char| !c.is_alphanumeric()).next().unwrap_or_default().to_owned()));
    }
    found
}

#[test]
fn every_code_is_made_by_a_product_source() {
    let made = made();
    let unmade: Vec<String> =
        Code::ALL.iter().map(|code| format!("{code:?}")).filter(|name| !made.contains(name)).collect();
    assert!(unmade.is_empty(), "no source makes {unmade:?}");
}

#[test]
fn explain_prints_every_code_and_proposes_the_nearest() {
    let list = answer(program().args(["explain", "--json"]));
    let entries: serde_json::Value = serde_json::from_str(&list.stdout).expect("JSON");
    let codes: Vec<&str> = entries.as_array().expect("a list").iter().filter_map(|one| one["code"].as_str()).collect();
    assert_eq!(codes, Code::ALL.iter().map(|code| code.as_str()).collect::<Vec<_>>());
    for code in Code::ALL {
        let one = explanation(*code).expect("an explanation");
        assert!(list.stdout.contains(&one.page), "{code}");
    }
    let one = answer(program().args(["explain", "value_out_of_range"]));
    assert_eq!(one.code, 0, "{one:?}");
    for label in ["value_out_of_range", "kind", "cause", "measured", "remedy", "page"] {
        assert!(one.stdout.lines().any(|line| line.starts_with(label)), "no {label}: {one:?}");
    }
    let unknown = answer(program().args(["explain", "value_out_of_rang"]));
    unknown.expect("a misspelt code", 2, &["value_out_of_range", "[name_unknown]"]);
}

/// One wrong input: arguments of `armcal` in a folder of its own.
struct Case {
    code: Code,
    exit: i32,
    call: fn(&Path) -> Answer,
}

fn check(file: &Path) -> Answer {
    answer(program().arg("check").arg(file))
}

fn short(folder: &Path, from: &str, to: &str) -> Answer {
    let routine =
        ShortRoutine { robot: robot_copy(folder), vehicle: vehicle_file(), ..ShortRoutine::default() }.write(folder);
    edit(&routine, from, to);
    check(&routine)
}

fn robot(folder: &Path, from: &str, to: &str) -> Answer {
    let robot = robot_copy(folder);
    edit(&robot.join("robot.toml"), from, to);
    check(&robot)
}

fn urdf(folder: &Path, from: &str, to: &str) -> Answer {
    let robot = robot_copy(folder);
    edit(&robot.join("titan4.urdf"), from, to);
    check(&robot)
}

fn text(folder: &Path, name: &str, text: &str) -> Answer {
    let file = folder.join(name);
    write(&file, text);
    check(&file)
}

fn calibrate(folder: &Path, recording: &Path, more: &[&str]) -> Answer {
    let out = folder.join("out");
    answer(program().arg("calibrate").arg(recording).arg("--out").arg(out).args(more))
}

fn titan() -> String {
    root().join("robots/titan4").display().to_string()
}

fn sample(name: &str) -> std::path::PathBuf {
    root().join("recordings/sample").join(name)
}

const CASES: &[Case] = &[
    Case { code: Code::KeyUnknown, exit: 2, call: |f| short(f, "poses = 12", "poses = 12\nposess = 3") },
    Case { code: Code::KeyMissing, exit: 2, call: |f| short(f, "name = \"short\"\n", "") },
    Case { code: Code::ValueOutOfRange, exit: 2, call: |f| short(f, "poses = 12", "poses = 2") },
    Case { code: Code::ValueType, exit: 2, call: |f| short(f, "tolerance_m = 0.03", "tolerance_m = \"small\"") },
    Case { code: Code::NameUnknown, exit: 2, call: |f| short(f, "seed = 1", "seed = 1\nmethod = \"best\"") },
    Case { code: Code::FileSyntax, exit: 2, call: |f| short(f, "version = 1", "version = 1 1") },
    Case {
        code: Code::KeysConflict,
        exit: 2,
        call: |f| short(f, "seed = 1", "seed = 1\n[world.camera]\nmode = \"rendered\"\nport = \"flat\""),
    },
    Case { code: Code::ValueDuplicate, exit: 2, call: |f| robot(f, "id = 1\n", "id = 0\n") },
    Case { code: Code::ValueCount, exit: 2, call: |f| robot(f, "stowed_rad = [-1.32, ", "stowed_rad = [") },
    Case { code: Code::UrdfStructure, exit: 2, call: |f| robot(f, "link = \"fisheye\"", "link = \"eye\"") },
    Case { code: Code::FileSyntax, exit: 2, call: |f| urdf(f, "</robot>", "") },
    Case { code: Code::FileKind, exit: 2, call: |f| text(f, "a.toml", "colour = \"red\"\n") },
    Case {
        code: Code::VersionUnsupported,
        exit: 2,
        call: |f| {
            text(
                f,
                "tags.toml",
                "version = 9\nkind = \"tag_map\"\nframe = \"base_link\"\n[[tag]]\nid = 1\n\
                 position_m = [0.0, 0.0, 1.0]\n",
            )
        },
    },
    Case { code: Code::FileUnreadable, exit: 2, call: |f| check(&f.join("none.toml")) },
    Case {
        code: Code::RecordingFormat,
        exit: 2,
        call: |f| {
            let file = f.join("empty.mcap");
            write(&file, "");
            calibrate(f, &file, &["--robot", &titan()])
        },
    },
    Case {
        code: Code::JointsMismatch,
        exit: 2,
        call: |f| {
            let robot = robot_copy(f);
            edit(&robot.join("robot.toml"), "joint = \"wrist_yaw\"", "joint = \"wrist_sway\"");
            edit(&robot.join("titan4.urdf"), "joint name=\"wrist_yaw\"", "joint name=\"wrist_sway\"");
            calibrate(f, &sample("run.mcap"), &["--robot", &robot.display().to_string()])
        },
    },
    Case {
        code: Code::RecordingDuplicate,
        exit: 2,
        call: |f| {
            let again = sample("run.mcap").display().to_string();
            calibrate(f, &sample("run.mcap"), &[&again, "--robot", &titan()])
        },
    },
    Case {
        code: Code::FileExists,
        exit: 2,
        call: |f| {
            write(&f.join("map.toml"), "mine\n");
            let map = f.join("map.toml");
            answer(program().arg("inspect").arg(sample("run.mcap")).arg("--write-input").arg(map))
        },
    },
    Case {
        code: Code::UsageInvalid,
        exit: 2,
        call: |f| {
            let map = f.join("map.toml");
            answer(program().arg("tagmap").arg(sample("run.mcap")).arg("--out").arg(map))
        },
    },
    Case {
        code: Code::CompactInvalid,
        exit: 2,
        call: |f| {
            let file = f.join("line.txt");
            write(&file, "armcal1 damaged #00000000\n");
            answer(program().args(["export", "--as", "json"]).arg(file))
        },
    },
    Case {
        code: Code::CovarianceMismatch,
        exit: 2,
        call: |f| {
            let lone = f.join("calibration.toml");
            std::fs::copy(sample("calibration.toml"), &lone).expect("copied");
            calibrate(f, &sample("run.mcap"), &["--robot", &titan(), "--prior", &lone.display().to_string()])
        },
    },
    Case {
        code: Code::PriorReused,
        exit: 4,
        call: |f| {
            let prior = sample("calibration.toml").display().to_string();
            calibrate(f, &sample("run.mcap"), &["--robot", &titan(), "--prior", &prior])
        },
    },
    Case {
        code: Code::FileUnwritable,
        exit: 1,
        call: |f| {
            write(&f.join("file"), "");
            let out = f.join("file/below");
            answer(program().arg("calibrate").arg(sample("run.mcap")).args(["--robot", &titan(), "--out"]).arg(out))
        },
    },
];

#[test]
fn wrong_inputs_end_with_the_code_of_their_class() {
    let mut wrong = Vec::new();
    for Case { code, exit, call } in CASES {
        let folder = temp();
        let said = call(folder.path());
        let tagged = format!("[{code}]");
        if said.code != *exit || !(said.stderr.contains(&tagged) || said.stdout.contains(&tagged)) {
            wrong.push(format!("{code}: {said:#?}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    let kinds: BTreeSet<CodeKind> =
        CASES.iter().filter_map(|case| explanation(case.code)).map(|explanation| explanation.kind).collect();
    assert!(kinds.contains(&CodeKind::Error) && kinds.contains(&CodeKind::Refusal));
}
