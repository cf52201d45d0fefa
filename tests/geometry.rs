//! Closed loops of arms whose geometry differs from their URDF within robot.toml's standard deviations.

use armcal::log::read_attachments;
use armcal::robot::Robot;
use armcal::sim::truth::{Truth, read_truth};
use armcal::sim::{GeometryAsBuilt, PlaceError};

use crate::support::{FinishedRun, ShortRoutine, read, robot_folder, shared, titan};
use crate::wall::{all_contents, find};

const SEEDS: [u64; 2] = [21, 22];

fn drawn_run(seed: u64) -> &'static FinishedRun {
    let tail = "[world.geometry]\nerror_ratio = 1.0\n".to_owned();
    shared(&ShortRoutine { seed, tail, ..ShortRoutine::default() })
}

fn geometry(truth: &Truth) -> &GeometryAsBuilt {
    truth.header.as_built.geometry.as_ref().expect("a geometry")
}

/// All lengths and angles of the drawn errors.
fn values(geometry: &GeometryAsBuilt) -> Vec<f64> {
    let of_place = |place: &PlaceError| [place.shift_m, place.turn_rad].concat();
    let places = geometry.joints.iter().chain([&geometry.survey]).flat_map(of_place);
    geometry.tool_shift_m.into_iter().chain(places).collect()
}

#[test]
fn the_truth_alone_holds_the_drawn_arm() {
    let run = drawn_run(SEEDS[0]);
    let truth = read_truth(run.file("truth.mcap")).expect("it reads");
    let values = values(geometry(&truth));
    assert_eq!(values.len(), 3 + 6 * 7);
    let [in_run, in_truth] = ["run.mcap", "truth.mcap"].map(|name| all_contents(&run.file(name)));
    // One value of each pose is enough, because a search of the whole recording takes a second.
    for value in values.into_iter().step_by(6) {
        let text = value.to_string();
        assert!(value != 0.0 && find(&in_truth, text.as_bytes()), "the truth lacks {value}");
        assert!(!find(&in_run, &value.to_le_bytes()) && !find(&in_run, text.as_bytes()), "the recording holds {value}");
    }
    assert!(!find(&in_run, b"error_ratio"));
    let attached = read_attachments(run.file("run.mcap")).expect("it reads");
    let urdf = attached.iter().find(|(name, _)| name == "titan4.urdf").expect("attached");
    assert!(urdf.1 == read(&robot_folder().join("titan4.urdf")).as_bytes(), "the nominal model");

    let (nominal, arm) = (titan(), truth.header.as_built.arm(&titan()));
    for state in truth.states.iter().step_by(501) {
        let tool_m = |robot: &Robot| robot.chain.frame(&state.angles, &robot.tool.mount);
        let off_m = |robot| (tool_m(robot).translation.vector - state.base_from_tool.origin().vector()).norm();
        assert!(off_m(&arm) < 1e-9 && off_m(&nominal) > 1e-5, "{} {}", off_m(&arm), off_m(&nominal));
    }
}

/// Tool errors of the drawn arm are within their predictions.
#[test]
fn no_target_is_beyond_three_times_its_u95() {
    for seed in SEEDS {
        let summary = drawn_run(seed).summary();
        let score = summary.score.as_ref().expect("a score");
        assert!(score.targets.len() >= 4, "{}", score.targets.len());
        for target in &score.targets {
            let u95 = summary.u95_m.targets.iter().find(|u95| u95.index == target.target).expect("a target");
            let (u95_m, error_m) = (u95.u95_m.expect("judged"), target.tool_error_after_m.expect("a rest"));
            let (p, nees) = (target.p_larger_error.expect("predicted"), target.nees_with_priors.expect("predicted"));
            eprintln!("seed {seed}: {:.2} mm of {:.2} mm, p {p:.3}, NEES {nees:.2}", 1e3 * error_m, 1e3 * u95_m);
            assert!(error_m < 3.0 * u95_m, "seed {seed}: {error_m} of {u95_m}");
            assert_eq!(p < 0.05, error_m > u95_m, "one distribution gives both: {p}");
        }
    }
}
