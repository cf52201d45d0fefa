//! `--live` in a viewer that is killed while the arm moves.

use super::{connection, in_namespace};
use crate::support::{ShortRoutine, shared_run, temp};

/// A viewer's server without a window; `$VIEWER` is its process.
const VIEWER: &str = "VIEWER_PROGRAM=$(python3 -c 'import sysconfig; print(sysconfig.get_paths()[\"purelib\"])')\
                      /rerun_sdk/rerun_cli/rerun; \
                      export RUST_LOG=error; \
                      $VIEWER_PROGRAM --serve-grpc --bind 127.0.0.1 --port 9876 2>viewer.log & VIEWER=$!; \
                      until ss -ltn | grep -q 127.0.0.1:9876 || ! kill -0 $VIEWER; do sleep 0.05; done;";

/// A served arm is calibrated as without a viewer.
#[test]
#[ignore = "needs user namespaces and Python's rerun-sdk"]
fn a_viewer_that_is_killed_does_not_disturb_the_arm() {
    let out = temp();
    let routine = ShortRoutine::default().write(out.path());
    connection(out.path(), "");
    let script = format!(
        "{VIEWER} $ARMCAL serve $ROUTINE --arm arm.toml --factor 8 2>serve.log & SERVER=$!; \
         $ARMCAL drive $ROUTINE --arm arm.toml --unattended --live --out out & RUN=$!; \
         sleep 12; kill -9 $VIEWER && kill -0 $RUN && echo killed; wait $RUN; CODE=$?; \
         kill -INT $SERVER; wait $SERVER; exit $CODE"
    );
    let said = in_namespace(out.path(), &routine, &script);
    said.expect("run --live", 0, &["killed", "ACCEPTED", "[viewer_lost]", " ms, 99 % "]);
}

/// A simulated run writes the same bytes as without a viewer.
#[test]
#[ignore = "needs user namespaces and Python's rerun-sdk"]
fn a_viewer_that_is_killed_changes_no_file() {
    let out = temp();
    let run = shared_run();
    let script = format!(
        "{VIEWER} $ARMCAL run $ROUTINE --live --out out & RUN=$!; \
         sleep 1; kill -9 $VIEWER && kill -0 $RUN && echo killed; wait $RUN"
    );
    let said = in_namespace(out.path(), &run.routine, &script);
    said.expect("run --live", 0, &["killed", "ACCEPTED", "[viewer_lost]"]);
    for name in ["run.mcap", "truth.mcap", "run.rrd", "calibration.toml", "calibration.covariance.toml"] {
        let shown = std::fs::read(out.path().join("out").join(name)).expect("it reads");
        assert!(shown == run.bytes(name), "{name} differs");
    }
}
