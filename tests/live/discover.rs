//! `armcal discover` proposes maps that connect to an arm, with our own middleware and another one.

use super::in_namespace;
use crate::support::{ShortRoutine, read, robot_folder, temp, titan, write};

/// Discovers the arm, and listens to it by the proposed map.
const LOOK: &str = "$ARMCAL discover --network 127.0.0.1 --for 4 --robot $ROBOT --out arm.toml && \
                    $ARMCAL drive $ROUTINE --arm arm.toml --no-motion; CODE=$?;";

/// The arm has other names for topics and joints, and the second type of set-points.
#[test]
#[ignore = "needs user namespaces"]
fn a_served_arm_is_discovered_and_heard() {
    let out = temp();
    let routine = ShortRoutine::default().write(out.path());
    let names: String = titan().joint_names().iter().map(|name| format!("{name} = \"titan_{name}\"\n")).collect();
    let served = format!(
        "version = 1\nkind = \"arm\"\n\
         networks = [\"127.0.0.1\"]\njoint_sensors = \"/titan/raw\"\noil_temperature = \"/hpu/oil\"\n[names]\n{names}\
         [commands]\ntopic = \"/titan/set_points\"\ntype = \"std_msgs/msg/Float64MultiArray\"\n\
         [stop]\ntopic = \"/titan/stop\"\nservice = \"/titan/halt\"\n"
    );
    write(&out.path().join("served.toml"), &served);
    let script = format!(
        "export ROBOT={:?}; $ARMCAL serve $ROUTINE --arm served.toml 2>serve.log & SERVER=$!; \
         {LOOK} kill -INT $SERVER; wait $SERVER; exit $CODE",
        robot_folder()
    );
    let said = in_namespace(out.path(), &routine, &script);
    said.expect("discover and drive --no-motion", 0, &["shoulder_yaw", "1 service"]);
    let map = read(&out.path().join("arm.toml"));
    assert!(!map.contains("FILL IN"), "{map}");
    for line in [
        "joint_sensors = \"/titan/raw\"",
        "\"shoulder_yaw\" = \"titan_shoulder_yaw\"",
        "oil_temperature = \"/hpu/oil\"",
        "topic = \"/titan/set_points\"",
        "type = \"std_msgs/msg/Float64MultiArray\"",
        "rate_hz = 50.0",
        "topic = \"/titan/stop\"",
        "service = \"/titan/halt\"",
        "mapping = \"enhanced\"",
    ] {
        assert!(map.contains(line), "{line}: {map}");
    }
}

/// The arm uses another middleware; it has no camera, which the output says.
#[test]
#[ignore = "needs user namespaces and Python's cyclonedds"]
fn an_arm_of_another_make_is_discovered_and_heard() {
    let out = temp();
    let routine = ShortRoutine::default().write(out.path());
    super::write_peer_start(out.path());
    let script = format!(
        "export ROBOT={:?}; python3 $PEER peer.jsonl start.json & PEER=$!; {LOOK} kill $PEER; exit $CODE",
        robot_folder()
    );
    let said = in_namespace(out.path(), &routine, &script);
    said.expect("discover and drive --no-motion", 0, &["shoulder_yaw", ": detections"]);
    let map = read(&out.path().join("arm.toml"));
    for line in ["joint_sensors = \"/joint_sensors\"", "topic = \"/joint_commands\"", "topic = \"/stop\"", "FILL IN"] {
        assert!(map.contains(line), "{line}: {map}");
    }
}

#[test]
#[ignore = "needs user namespaces"]
fn nobody_is_an_error_that_says_what_to_look_at() {
    let out = temp();
    let script = "$ARMCAL discover --network 127.0.0.1 --domain 7 --for 1";
    let said = in_namespace(out.path(), out.path(), script);
    said.expect("discover", 1, &["[arm_connection]", "--network"]);
}
