//! A rosbridge in a thread: an arm behind it, faults of the line, and messages of all kinds.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, LazyLock, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use rand_distr::{Distribution, Uniform};
use serde_json::{Value, json};
use tungstenite::protocol::Role;
use tungstenite::{Message as Frame, WebSocket};

use super::{Kept, titan4};
use crate::rosbridge::{Listener, Said, accept_key};
use crate::topics::Content;
use crate::{Connection, Heard, LiveArm, Rosbridge, RosbridgeWire, StopWays, Wire};
use armcal_core::codes::{Code, Coded};
use armcal_core::log::Stream;
use armcal_core::sensor::ArmSensors;
use armcal_core::stats::stream_rng;
use armcal_core::streams::{Arm, JointCounts, Message};

type Log = Arc<Mutex<Vec<Value>>>;

/// Reading a robot takes longer than a period.
static NAMES: LazyLock<Vec<String>> = LazyLock::new(|| titan4().joint_names());

/// Server on the loopback, with the messages that it received.
struct Bridge {
    url: String,
    log: Log,
    thread: Option<JoinHandle<()>>,
}

impl Bridge {
    /// Starts a server that runs `play` with the stream of its only client.
    fn raw(play: impl FnOnce(TcpStream, &Log) + Send + 'static) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let url = format!("ws://{}", listener.local_addr().expect("an address"));
        let log = Log::default();
        let theirs = Arc::clone(&log);
        let serve = move || play(listener.accept().expect("a client").0, &theirs);
        Self { url, log, thread: Some(std::thread::spawn(serve)) }
    }

    /// Starts a server that speaks WebSocket.
    fn new(play: impl FnOnce(&mut WebSocket<TcpStream>, &Log) + Send + 'static) -> Self {
        Self::raw(move |mut stream, log| {
            let (mut head, mut byte) = (Vec::new(), [0]);
            while !head.ends_with(b"\r\n\r\n") {
                stream.read_exact(&mut byte).expect("a request");
                head.push(byte[0]);
            }
            let head = String::from_utf8(head).expect("text");
            let key = head.lines().find_map(|line| line.strip_prefix("Sec-WebSocket-Key: ")).expect("a key");
            let answer = format!(
                "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
                 Sec-WebSocket-Accept: {}\r\n\r\n",
                accept_key(key)
            );
            stream.write_all(answer.as_bytes()).expect("it is sent");
            play(&mut WebSocket::from_raw_socket(stream, Role::Server, None), log);
        })
    }

    fn connection(&self, ros: u32) -> Connection {
        let mut connection = Connection {
            rosbridge: Some(Rosbridge { url: self.url.clone(), ros }),
            stop: StopWays { service: "/halt".to_owned(), ..StopWays::default() },
            ..Connection::default()
        };
        connection.guard.ready_s = 0.5;
        connection
    }

    fn wire(&self) -> RosbridgeWire {
        let connection = self.connection(1);
        let bridge = connection.rosbridge.as_ref().expect("it was given");
        RosbridgeWire::open(&connection, bridge, &titan4()).expect("it connects")
    }

    /// Returns the messages with this operation that the bridge received.
    fn told(&self, op: &str) -> Vec<Value> {
        self.log.lock().expect("whole").iter().filter(|message| message["op"] == op).cloned().collect()
    }

    fn join(&mut self) {
        self.thread.take().expect("once").join().expect("the bridge is sound");
    }
}

fn stamp(ros: u32, at_s: f64) -> Value {
    let (sec, nanos) = (1_000 + at_s as u64, (at_s.fract() * 1e9) as u64);
    if ros == 1 { json!({ "secs": sec, "nsecs": nanos }) } else { json!({ "sec": sec, "nanosec": nanos }) }
}

fn reading(ros: u32, at_s: f64, counts: &[f64]) -> Value {
    let header = json!({ "seq": 7, "stamp": stamp(ros, at_s), "frame_id": "" });
    let velocity: Vec<Option<f64>> = vec![None; counts.len()];
    let message = json!({ "header": header, "name": *NAMES, "position": counts, "velocity": velocity, "effort": [] });
    json!({ "op": "publish", "topic": "/joint_sensors", "msg": message })
}

fn say(socket: &mut WebSocket<TcpStream>, message: &Value) -> bool {
    socket.send(Frame::text(message.to_string())).is_ok()
}

fn stowed() -> Vec<f64> {
    let robot = titan4();
    ArmSensors::nominal(&robot).counts(&robot.stowed).to_vec()
}

/// Arm that follows its set-points, until its client leaves or `hangs_up_s` is over.
fn play_arm(ros: u32, hangs_up_s: f64) -> impl FnOnce(&mut WebSocket<TcpStream>, &Log) + Send + 'static {
    move |socket, log| {
        let (start, mut counts, mut n) = (Instant::now(), stowed(), 0_u32);
        socket.get_ref().set_read_timeout(Some(Duration::from_millis(1))).expect("it is set");
        while start.elapsed().as_secs_f64() < hangs_up_s {
            match socket.read() {
                Ok(Frame::Text(text)) => {
                    let message: Value = serde_json::from_str(&text).expect("JSON");
                    if message["topic"] == "/joint_commands" && message["op"] == "publish" {
                        let goal = message["msg"]["points"][0]["positions"].as_array().expect("positions");
                        counts = goal.iter().map(|count| count.as_f64().expect("a number")).collect();
                    }
                    log.lock().expect("whole").push(message);
                }
                Ok(Frame::Close(_)) | Err(tungstenite::Error::ConnectionClosed) => return,
                _ => {}
            }
            if start.elapsed().as_secs_f64() >= 0.01 * f64::from(n) {
                n += 1;
                let noise = f64::from(n % 2);
                let counts: Vec<f64> = counts.iter().map(|count| count + noise).collect();
                if !say(socket, &reading(ros, start.elapsed().as_secs_f64(), &counts)) {
                    return;
                }
            }
        }
    }
}

#[test]
fn an_arm_of_either_ros_is_heard_moved_and_stopped() {
    for (ros, state, trajectory) in [
        (1, "sensor_msgs/JointState", "trajectory_msgs/JointTrajectory"),
        (2, "sensor_msgs/msg/JointState", "trajectory_msgs/msg/JointTrajectory"),
    ] {
        let mut bridge = Bridge::new(play_arm(ros, 60.0));
        let (connection, robot) = (bridge.connection(ros), titan4());
        let wire = RosbridgeWire::open(&connection, connection.rosbridge.as_ref().unwrap(), &robot).unwrap();
        let (mut arm, survey) = LiveArm::connect(wire, &robot, &connection).expect("it is ready");
        assert!(survey.readings > 10 && survey.unusable.is_none(), "{survey:?}");
        let mut kept = Kept::default();
        let goal = JointCounts::from_fn(survey.counts.len(), |j| {
            survey.counts[j] + if j == 1 { 0.05 * robot.sensors[1].counts_per_rad } else { 0.0 }
        });
        for _ in 0..25 {
            arm.command(&goal).and_then(|()| arm.step(&mut kept)).expect("it moves");
        }
        let reached = arm.reading().expect("a reading")[1];
        assert!((reached - goal[1]).abs() < 2.0, "{reached} counts, {} asked", goal[1]);
        arm.stop("enough");
        drop(arm);
        bridge.join();

        let typed = |op: &str, topic: &str| {
            bridge.told(op).iter().find(|told| told["topic"] == topic).map(|told| told["type"].clone())
        };
        assert_eq!(typed("subscribe", "/joint_sensors"), Some(json!(state)));
        assert_eq!(typed("advertise", "/joint_commands"), Some(json!(trajectory)));
        let published = bridge.told("publish");
        let n_set_points = published.iter().filter(|told| told["topic"] == "/joint_commands").count();
        assert!(n_set_points > 20, "{n_set_points}");
        let header = &published[0]["msg"]["header"];
        assert_eq!((header["stamp"]["secs"].is_u64(), header["seq"].is_u64()), (ros == 1, ros == 1), "{header}");
        assert_eq!(header["stamp"]["sec"].is_u64(), ros == 2, "{header}");
        assert_eq!(published[0]["msg"]["joint_names"], json!(robot.joint_names()));
        let log = bridge.log.lock().unwrap();
        let [topic, service] = &log[log.len() - 2..] else { panic!("{log:?}") };
        assert_eq!((&topic["topic"], &topic["msg"]), (&json!("/stop"), &json!({ "data": true })));
        assert_eq!((&service["op"], &service["service"]), (&json!("call_service"), &json!("/halt")));
    }
}

#[test]
fn readings_of_the_other_ros_are_refused() {
    let bridge = Bridge::new(play_arm(2, 60.0));
    let mut connection = bridge.connection(1);
    connection.guard.connect_s = 0.5;
    let problem = LiveArm::connect(bridge.wire(), &titan4(), &connection).err().expect("not ready");
    assert_eq!(problem.code(), Code::ArmNotReady, "{problem}");
}

#[test]
fn a_lost_connection_ends_a_run_at_once_and_the_recording_says_so() {
    let bridge = Bridge::new(play_arm(1, 1.5));
    let connection = bridge.connection(1);
    let (mut arm, survey) = LiveArm::connect(bridge.wire(), &titan4(), &connection).expect("it is ready");
    let (mut kept, mut result, mut since) = (Kept::default(), Ok(()), Instant::now());
    for _ in 0..200 {
        since = Instant::now();
        result = arm.command(&survey.counts).and_then(|()| arm.step(&mut kept));
        if result.is_err() {
            break;
        }
    }
    assert_eq!(result.expect_err("it is lost").code(), Code::ArmConnection);
    // Well before the guard would miss the readings.
    assert!(since.elapsed().as_secs_f64() < 0.8 * connection.guard.stale_s, "{:?}", since.elapsed());
    let is_told = |message: &Message| matches!(message, Message::Log(line) if line.name == "rosbridge");
    assert!(kept.0.iter().any(|(_, message)| is_told(message)));
    let mut wire = bridge_that_is_gone();
    wire.receive(Duration::from_millis(200), &mut Vec::new()).expect("the recording first");
    assert!(wire.send(&survey.counts, 0.02).is_err() && wire.stop().is_err());
}

/// Leaves after the client's greeting: a socket that is closed before makes the client's connect fail.
fn bridge_that_is_gone() -> RosbridgeWire {
    Bridge::new(|socket, _| drop(socket.read())).wire()
}

#[test]
fn a_bridge_that_takes_nothing_is_lost_and_holds_nothing_up() {
    let (done, is_done) = std::sync::mpsc::channel::<()>();
    let bridge = Bridge::new(move |_, _| assert!(is_done.recv().is_err()));
    let (mut wire, counts) = (bridge.wire(), JointCounts::from_slice(&stowed()));
    let (mut slowest, start) = (Duration::ZERO, Instant::now());
    let mut heard = Vec::new();
    let problem = loop {
        let since = Instant::now();
        let sent = (0..500).try_for_each(|_| wire.send(&counts, 0.02));
        let received = wire.receive(Duration::from_millis(1), &mut heard);
        slowest = slowest.max(since.elapsed());
        if let Err(error) = sent.and(received) {
            break error;
        }
        assert!(start.elapsed().as_secs() < 60, "it goes on for ever");
    };
    drop(done);
    assert_eq!(problem.code(), Code::ArmConnection, "{problem}");
    assert!(slowest < Duration::from_secs(1), "{slowest:?} for 500 set-points");
}

#[test]
fn a_message_that_drips_in_holds_nothing_up() {
    let bridge = Bridge::new(|socket, _| {
        let text = reading(1, 1.0, &stowed()).to_string();
        let mut frame = vec![0x81, 126];
        frame.extend((text.len() as u16).to_be_bytes());
        frame.extend(text.bytes());
        for byte in frame {
            socket.get_mut().write_all(&[byte]).expect("it is sent");
            std::thread::sleep(Duration::from_micros(500));
        }
        std::thread::sleep(Duration::from_secs(1));
    });
    let (mut wire, mut heard) = (bridge.wire(), Vec::new());
    let (start, mut n, mut slowest) = (Instant::now(), 0, Duration::ZERO);
    while heard.is_empty() && start.elapsed().as_secs() < 20 {
        let since = Instant::now();
        wire.receive(Duration::from_millis(5), &mut heard).expect("it holds");
        slowest = slowest.max(since.elapsed());
        n += 1;
    }
    assert!(matches!(heard[..], [Heard::Joints(_)]), "{heard:?}");
    assert!(n > 20 && slowest < Duration::from_millis(100), "{n} turns, {slowest:?}");
}

#[test]
fn of_what_came_while_nobody_listened_the_newest_is_kept() {
    let bridge = Bridge::new(|socket, log| {
        let counts = stowed();
        for n in 0..1000 {
            assert!(say(socket, &reading(1, 0.01 * f64::from(n), &counts)));
        }
        socket.send(Frame::Ping("there?".into())).expect("it is sent");
        while let Ok(message) = socket.read() {
            if message.is_pong() {
                log.lock().expect("whole").push(json!({ "op": "pong" }));
            }
        }
    });
    let mut wire = bridge.wire();
    let start = Instant::now();
    while bridge.told("pong").is_empty() && start.elapsed().as_secs() < 20 {
        std::thread::sleep(Duration::from_millis(5));
    }
    assert_eq!(bridge.told("pong").len(), 1, "the ping is not answered while nobody listens");
    let mut heard = Vec::new();
    wire.receive(Duration::ZERO, &mut heard).expect("it holds");
    let Some(Heard::Joints(last)) = heard.last() else { panic!("{heard:?}") };
    assert_eq!((heard.len(), last.stamp.nanos), (200, 1_009_990_000_000));
}

#[test]
fn who_is_no_rosbridge_is_told_in_one_line() {
    let gone = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let web = Bridge::raw(|mut stream, _| {
        stream.write_all(b"HTTP/1.1 404 Not Found\r\n\r\n").expect("it is sent");
        let _ = stream.read_to_end(&mut Vec::new());
    });
    let silent = Bridge::raw(|mut stream, _| drop(stream.read_to_end(&mut Vec::new())));
    let endless = Bridge::raw(|mut stream, _| while stream.write_all(&[b'x'; 1000]).is_ok() {});
    let told = [format!("ws://{gone}"), web.url.clone(), silent.url.clone(), endless.url.clone()].map(|url| {
        let bridge = Rosbridge { url: url.clone(), ros: 1 };
        let mut connection = Connection::default();
        connection.guard.connect_s = 0.3;
        let start = Instant::now();
        let problem = RosbridgeWire::open(&connection, &bridge, &titan4()).err().expect("no bridge").to_string();
        assert!(start.elapsed().as_secs_f64() < 1.5, "{problem}: {:?}", start.elapsed());
        problem.replace(&url, "URL")
    });
    insta::assert_snapshot!("no_rosbridge", told.join("\n"));
}

fn listener(ros: u32) -> Listener {
    let robot = titan4();
    let deadman = Some(crate::Deadman { topic: "/held".to_owned(), timeout_s: 0.5 });
    let connection = Connection { deadman, ..Connection::default() };
    Listener::new(&connection, &Rosbridge { ros, ..Rosbridge::default() }, &robot.joint_names())
}

fn on(topic: &str, message: &Value) -> Value {
    json!({ "op": "publish", "topic": topic, "msg": message })
}

/// Returns one message of each kind, as a bridge of ROS 1 sends them.
fn one_of_each() -> Vec<Value> {
    let header = json!({ "seq": 7, "stamp": stamp(1, 0.5), "frame_id": "vehicle" });
    let (nine, vector) = (vec![0.0; 9], json!({ "x": 0.1, "y": 0, "z": -9.81 }));
    let corners: Vec<Value> = (0..4).map(|k| json!({ "x": 100.5 + f64::from(k), "y": 20 })).collect();
    let tag = json!({
        "family": "tag36h11", "id": 7, "hamming": 0, "goodness": 0.0, "decision_margin": 90.5,
        "centre": { "x": 1.0, "y": 2.0 }, "corners": corners, "homography": vec![Value::Null; 9],
    });
    let imu = json!({
        "header": header, "orientation": { "x": 0, "y": 0, "z": 0, "w": 1 }, "orientation_covariance": nine,
        "angular_velocity": vector, "angular_velocity_covariance": nine, "linear_acceleration": vector,
        "linear_acceleration_covariance": nine,
    });
    vec![
        reading(1, 0.5, &stowed()),
        on("/camera/wrist/detections", &json!({ "header": header, "detections": [tag] })),
        on("/camera/wrist/image/compressed", &json!({ "header": header, "format": "jpeg", "data": "/9j/4AAQ" })),
        on("/temperature/oil", &json!({ "header": header, "temperature": 40.5, "variance": 0 })),
        on("/temperature/water", &json!({ "header": header, "temperature": 4, "variance": 0.0 })),
        on("/depth_pressure", &json!({ "header": header, "fluid_pressure": 3e6, "variance": 0 })),
        on("/vehicle/imu", &imu),
        on("/held", &json!({ "data": true })),
    ]
}

#[test]
fn each_kind_of_message_is_heard() {
    let listener = listener(1);
    let heard: Vec<Said> = one_of_each().iter().map(|message| listener.read(&message.to_string())).collect();
    let mut streams = Vec::new();
    for said in &heard {
        let Said::Heard(content, heard) = said else { panic!("{said:?}") };
        match heard {
            Heard::Joints(sample) => {
                assert_eq!((sample.stamp.nanos, sample.counts.to_vec()), (1_000_500_000_000, stowed()));
            }
            Heard::Other(message) => {
                assert_eq!(*content, Content::Stream(Stream::of(message)));
                streams.push(Stream::of(message));
            }
            Heard::Deadman(is_held) => assert!(is_held),
            Heard::Unusable(why) => panic!("{why}"),
        }
    }
    assert_eq!((heard.len(), streams.len()), (8, 6));
}

#[test]
fn what_says_nothing_usable_is_told() {
    let listener = listener(1);
    let unfinite = {
        let mut message = reading(1, 0.5, &stowed());
        message["msg"]["position"][2] = Value::Null;
        message.to_string()
    };
    let many = format!("{{\"op\":\"publish\",\"msg\":[0{}]}}", ",0".repeat(4 << 20));
    let keys = format!("{{\"op\":\"publish\",\"msg\":{{\"a\":0{}}}}}", ",\"a\":0".repeat(200_000));
    let texts = [
        "",
        "[[[",
        "7",
        &"[".repeat(100_000),
        &many,
        &keys,
        "{\"op\":\"fragment\"}",
        "{\"op\":\"publish\",\"topic\":\"/other\",\"msg\":{}}",
        "{\"op\":\"publish\",\"topic\":\"/joint_sensors\"}",
        &reading(2, 0.5, &stowed()).to_string(),
        &unfinite,
        "{\"op\":\"status\",\"level\":\"error\",\"msg\":\"no\\nsuch\\u202e type\"}",
        "{\"op\":\"service_response\",\"service\":\"/halt\",\"result\":false,\"values\":\"gone\"}",
        "{\"op\":\"service_response\",\"service\":\"/halt\",\"result\":true,\"values\":{\"success\":false}}",
    ];
    let told = texts.map(|text| {
        let why = match listener.read(text) {
            Said::Heard(_, Heard::Unusable(why)) | Said::Complaint(why) => why,
            said => panic!("{said:?}"),
        };
        assert!(why.chars().count() < 400 && !why.contains('\n'), "{why}");
        why
    });
    insta::assert_snapshot!("unusable", told.join("\n"));
    for text in [
        "{\"op\":\"status\",\"level\":\"info\",\"msg\":\"hello\"}",
        "{\"op\":\"service_response\",\"service\":\"/halt\",\"result\":true,\"values\":{\"success\":true}}",
    ] {
        assert_eq!(listener.read(text), Said::Nothing);
    }
}

/// Bytes exchanged, removed, doubled and moved cause no panic, and no count is accepted that is no number.
#[test]
fn mutated_messages_are_read_or_refused() {
    let (listener, stowed, mut rng) = (listener(1), stowed(), stream_rng(11, "mutations"));
    let pieces = ["null", "NaN", "1e999", "-0", "\"\"", "[]", "{}", "\"secs\"", ",", "1e308", "\\u0000", "\"AAAA\""];
    let (mut accepted, mut refused) = (0, 0);
    for message in one_of_each().iter().map(Value::to_string) {
        for _ in 0..4000 {
            let mut bytes = message.clone().into_bytes();
            let mut draw = |n: usize| Uniform::new(0, n.max(1)).expect("a range").sample(&mut rng);
            for _ in 0..=draw(2) {
                let at = draw(bytes.len());
                match draw(4) {
                    0 if at < bytes.len() => bytes[at] = draw(128) as u8,
                    1 => drop(bytes.drain(at..(at + draw(40)).min(bytes.len()))),
                    2 => drop(bytes.splice(at..at, pieces[draw(pieces.len())].bytes())),
                    _ => bytes.extend_from_within(at..(at + draw(40)).min(bytes.len())),
                }
            }
            let Ok(text) = String::from_utf8(bytes) else { continue };
            match listener.read(&text) {
                Said::Heard(_, Heard::Joints(sample)) => {
                    assert_eq!(sample.counts.len(), stowed.len(), "{text}");
                    assert!(sample.counts.iter().all(|count| count.is_finite()), "{text}");
                    accepted += 1;
                }
                Said::Heard(_, Heard::Unusable(_)) | Said::Complaint(_) => refused += 1,
                _ => accepted += 1,
            }
        }
    }
    assert!(accepted > 300 && refused > 10_000, "{accepted} accepted, {refused} refused");
}

/// A megabyte of JPEG, which comes between the readings.
#[test]
fn a_large_image_is_read_soon() {
    let jpeg: Vec<u8> = (0..1_000_000_u32).map(|k| (k.wrapping_mul(k) >> 5) as u8).collect();
    let header = json!({ "stamp": stamp(1, 0.5), "frame_id": "camera" });
    let message = json!({ "header": header, "format": "bgr8; jpeg compressed bgr8", "data": STANDARD.encode(&jpeg) });
    let text = on("/camera/wrist/image/compressed", &message).to_string();
    let start = Instant::now();
    let said = listener(1).read(&text);
    eprintln!("1 MB of JPEG: {:?}", start.elapsed());
    let Said::Heard(_, Heard::Other(Message::Image(image))) = said else { panic!("no image") };
    assert!(image.jpeg == jpeg);
    assert!(start.elapsed() < Duration::from_secs(2), "{:?}", start.elapsed());
}
