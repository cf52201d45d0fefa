//! Connection maps that are proposed: for an arm with names of its own, and for domains that lack something.

use std::net::Ipv4Addr;
use std::path::Path;

use super::titan4;
use crate::{CommandType, Connection, Domain, Seen, SeenService, SeenTopic, ServiceMapping, propose_connection};

fn topic(name: &str, ros_type: &str, publishers: usize, subscribers: usize) -> SeenTopic {
    let mut topic = SeenTopic::new(name.to_owned(), ros_type.to_owned());
    (topic.publishers, topic.subscribers) = (publishers, subscribers);
    topic
}

/// Driver with its own names, among many other topics.
fn seen() -> Seen {
    let mut raw = topic("/titan/raw", "sensor_msgs/msg/JointState", 1, 2);
    raw.joints = titan4().joint_names().iter().map(|name| format!("titan_{name}")).collect();
    (raw.messages, raw.largest, raw.rate_hz) = (500, 12_345.0, Some(100.4));
    let mut thrusters = topic("/joint_sensors", "sensor_msgs/msg/JointState", 1, 0);
    thrusters.joints = ["port", "starboard"].map(str::to_owned).into();
    let topics = vec![
        raw,
        thrusters,
        topic("/cam/tags", "apriltag_msgs/msg/AprilTagDetectionArray", 1, 0),
        topic("/cam/jpeg", "sensor_msgs/msg/CompressedImage", 1, 0),
        topic("/hydraulics/temperature", "sensor_msgs/msg/Temperature", 1, 0),
        topic("/motor/temperature", "sensor_msgs/msg/Temperature", 1, 0),
        topic("/titan/set_points", "std_msgs/msg/Float64MultiArray", 0, 1),
        topic("/lamps", "std_msgs/msg/Float64MultiArray", 0, 1),
        topic("/titan/halt", "std_msgs/msg/Bool", 0, 1),
        topic("/titan/held", "std_msgs/msg/Bool", 1, 0),
        topic("/chatter\nversion = 2", "std_msgs/msg/String", 1, 0),
    ];
    let services = vec![SeenService {
        name: "/titan/stop".to_owned(),
        ros_type: "std_srvs/srv/Trigger".to_owned(),
        mapping: ServiceMapping::Cyclone,
    }];
    Seen { domain: Domain { number: 7, networks: vec![Ipv4Addr::LOCALHOST] }, topics, services }
}

fn read(text: &str) -> Result<Connection, String> {
    Connection::parse(Path::new("arm.toml"), text).map_err(|error| error.to_string())
}

#[test]
fn a_driver_with_names_of_its_own_is_recognised() {
    let proposed = propose_connection(&seen(), Some(&titan4()));
    assert_eq!(proposed.missing, Vec::<String>::new(), "{}", proposed.text);
    let connection = read(&proposed.text).unwrap_or_else(|problem| panic!("{problem}: {}", proposed.text));
    assert_eq!((connection.domain, connection.networks.as_slice()), (7, [Ipv4Addr::LOCALHOST].as_slice()));
    assert_eq!(connection.joint_sensors, "/titan/raw");
    assert!(titan4().joint_names().iter().all(|joint| connection.driver_name(joint) == format!("titan_{joint}")));
    assert_eq!((connection.detections.as_str(), connection.images.as_str()), ("/cam/tags", "/cam/jpeg"));
    assert_eq!(connection.oil_temperature, "/hydraulics/temperature");
    assert_eq!((connection.water_temperature.as_str(), connection.pressure.as_str()), ("", ""));
    assert_eq!(connection.commands.topic, "/titan/set_points");
    assert_eq!(connection.commands.message_type, CommandType::Float64MultiArray);
    assert_eq!(connection.commands.rate_hz, 50.0);
    assert_eq!((connection.stop.topic.as_str(), connection.stop.service.as_str()), ("/titan/halt", "/titan/stop"));
    assert_eq!(connection.stop.mapping, ServiceMapping::Cyclone);
    assert_eq!(connection.deadman.map(|deadman| deadman.topic).as_deref(), Some("/titan/held"));
    for said in ["/motor/temperature", "/lamps", "/joint_sensors", "12345"] {
        assert!(proposed.text.contains(said), "{said}: {}", proposed.text);
    }
}

#[test]
fn what_is_left_to_fill_in_is_named_and_does_not_pass_unseen() {
    for (lacking, key) in [
        ("/titan/set_points", "commands.topic"),
        ("/cam/", "detections"),
        ("stop", "stop"),
        ("titan_", "names.shoulder_yaw"),
        ("JointState", "joint_sensors"),
    ] {
        let mut seen = seen();
        match lacking {
            "stop" => {
                seen.services.clear();
                seen.topics.retain(|topic| topic.name != "/titan/halt");
            }
            "titan_" => seen.topics[0].joints = ["a", "b"].map(str::to_owned).into(),
            _ => {
                seen.topics.retain(|t| !t.name.contains(lacking) && !t.ros_type.contains(lacking) && t.name != "/lamps")
            }
        }
        let proposed = propose_connection(&seen, Some(&titan4()));
        assert!(proposed.missing.iter().any(|missing| missing == key), "{lacking}: {:?}", proposed.missing);
        assert!(proposed.text.contains("FILL IN"), "{lacking}: {}", proposed.text);
        let may_be_read = ["titan_", "/cam/"].contains(&lacking);
        assert_eq!(read(&proposed.text).is_ok(), may_be_read, "{lacking}: {}", proposed.text);
    }
}
