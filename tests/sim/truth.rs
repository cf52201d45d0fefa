//! truth.mcap: written, read back, and reproducible.

use armcal::log::Completeness;
use armcal::sim::WorldSpec;
use armcal::sim::truth::{TruthRecorder, read_truth};
use armcal::streams::Arm;

use super::{Site, Tape, Witness};

fn recorded(path: &std::path::Path) {
    let mut world = Site::titan().world(WorldSpec::default(), u64::MAX);
    world.set_truth_sink(Box::new(TruthRecorder::create(path).expect("a file"))).expect("accepted");
    Tape::default().run(&mut world, 3.0);
    world.finish_truth().expect("finished");
}

#[test]
fn what_was_written_reads_back() {
    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join("truth.mcap");
    recorded(&path);
    let truth = read_truth(&path).expect("it reads");
    assert_eq!(truth.completeness, Completeness::Whole);

    let mut world = Site::titan().world(WorldSpec::default(), u64::MAX);
    let witness = Witness::default();
    world.set_truth_sink(Box::new(witness.clone())).expect("accepted");
    let start = world.now();
    Tape::default().run(&mut world, 3.0);
    assert_eq!(Some(truth.header.clone()), *witness.header.borrow());
    assert_eq!(truth.states.len(), 150);
    for (read, written) in truth.states.iter().zip(witness.states.borrow().iter()) {
        assert_eq!((read.stamp, read.angles, read.oil_c), (written.stamp, written.angles, written.oil_c));
        // Reading normalises quaternions, so the last digit may change.
        let apart = read.base_from_tool.inverse() * written.base_from_tool;
        assert!(apart.origin().vector().norm() < 1e-12 && apart.rotation().angle() < 1e-7);
    }
    assert_eq!(truth.clearances, *witness.clearances.borrow());
    assert!(truth.min_clearance_m().is_some_and(|distance| distance > 0.01));

    let (a, b) = (&truth.states[10], &truth.states[11]);
    let middle = truth.state_at(a.stamp.plus_s(0.01)).expect("within the run");
    assert!((middle.angles[0] - 0.5 * (a.angles[0] + b.angles[0])).abs() < 1e-12);
    assert!(truth.state_at(start).is_none() && truth.state_at(start.plus_s(4.0)).is_none());
    let spec: toml::Table = truth.header.spec_toml.parse().expect("TOML");
    let complete = WorldSpec::default().completed(&Site::titan().robot);
    assert_eq!(WorldSpec::from_table(&spec, &path).expect("a spec"), complete);
}

#[test]
fn the_file_is_the_same_each_time() {
    let dir = tempfile::tempdir().expect("a directory");
    let [first, second] = ["a.mcap", "b.mcap"].map(|name| {
        let path = dir.path().join(name);
        recorded(&path);
        std::fs::read(path).expect("written")
    });
    assert!(first == second);
}

#[test]
fn a_file_that_is_no_truth_is_refused_by_name() {
    let dir = tempfile::tempdir().expect("a directory");
    let error = read_truth(dir.path().join("absent.mcap")).expect_err("refused").to_string();
    assert!(error.contains("absent.mcap"), "{error}");
}
