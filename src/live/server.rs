//! Server of any arm, such as the simulated one, on the topics of a connection.

use std::time::{Duration, Instant};

use crate::messages::{BOOL, Bool, Command};
use crate::ros2::{Node, Reader, TriggerRequest, TriggerResponse, Writer, service_mapping};
use crate::topics::streams;
use crate::{Connection, LiveError};
use armcal_core::log::{RecordingHeader, Stream, decode, encode_message};
use armcal_core::robot::Robot;
use armcal_core::streams::{Arm, ArmError, ImageDemand, JointCounts, Message, Sink, SinkError};
use armcal_core::time::Stamp;

/// Speed and duration for which an arm is served.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// Rate of the arm's time over ours.
    pub factor: f64,
    /// Duration by our clock, s; `None`: until the caller ends it.
    pub seconds: Option<f64>,
}

/// Counts and durations of a served arm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Served {
    /// Duration by the arm's clock, s.
    pub arm_s: f64,
    /// Duration by our clock, s.
    pub wall_s: f64,
    /// Number of set-points that were carried out.
    pub commands: u64,
    /// Number of unusable set-points.
    pub unusable: u64,
    /// True if the arm was told to stop.
    pub stopped: bool,
}

/// Serves `arm` until the time is over, or `is_over` returns true. A stop holds the arm at its reading until the stop
/// topic says `false`.
///
/// # Errors
/// [`ArmError`] of the arm itself, [`ArmError::Connection`] when the domain cannot be joined.
pub fn serve(
    arm: &mut dyn Arm,
    robot: &Robot,
    connection: &Connection,
    pace: Pace,
    is_over: &dyn Fn() -> bool,
) -> Result<Served, ArmError> {
    let mut server = Server::open(robot, connection).map_err(|error| ArmError::Connection(Box::new(error)))?;
    let (start, first) = (Instant::now(), arm.now());
    // The camera is always on.
    arm.request_images(ImageDemand::All);
    let mut served = Served::default();
    while !is_over() && pace.seconds.is_none_or(|seconds| start.elapsed().as_secs_f64() < seconds) {
        if let Some(counts) = server.next_set_point(&mut served) {
            arm.command(&counts)?;
        }
        arm.step(&mut server)?;
        served.arm_s = arm.now().since_s(first);
        let due = Duration::from_secs_f64(served.arm_s / pace.factor);
        std::thread::sleep(due.saturating_sub(start.elapsed()));
    }
    served.wall_s = start.elapsed().as_secs_f64();
    Ok(served)
}

struct Server<'a> {
    connection: &'a Connection,
    /// The driver's joint names, in the robot's order.
    names: Vec<String>,
    header: RecordingHeader,
    writers: Vec<(Stream, Writer)>,
    commands: Reader,
    stop: Option<Reader>,
    stop_service: Option<ros2_client::Server<TriggerRequest, TriggerResponse>>,
    latest: Option<JointCounts>,
    is_stopped: bool,
    /// Last: readers and writers leave the domain before it does.
    node: Node,
}

impl<'a> Server<'a> {
    fn open(robot: &Robot, connection: &'a Connection) -> Result<Self, LiveError> {
        let mut node = Node::new(connection.domain, &connection.networks, "armcal_arm")?;
        let names: Vec<String> =
            robot.joint_names().iter().map(|name| connection.driver_name(name).to_owned()).collect();
        let all = std::iter::once((Stream::JointSensors, connection.joint_sensors.as_str()));
        let writers = all
            .chain(streams(connection))
            .map(|(stream, topic)| Ok((stream, node.writer(topic, stream.schema().name)?)))
            .collect::<Result<_, LiveError>>()?;
        let commands = node.reader(&connection.commands.topic, connection.commands.message_type.name())?;
        let stop = &connection.stop;
        let stop_topic = (!stop.topic.is_empty()).then(|| node.reader(&stop.topic, BOOL)).transpose()?;
        let stop_service = (!stop.service.is_empty()).then(|| trigger(&mut node, connection)).transpose()?;
        Ok(Self {
            node,
            connection,
            header: RecordingHeader::new(names.clone()).with_tags_of(robot.tag_family),
            names,
            writers,
            commands,
            stop: stop_topic,
            stop_service,
            latest: None,
            is_stopped: false,
        })
    }

    /// Returns the newest set-point that came since the last call; the arm's reading if it was told to stop.
    fn next_set_point(&mut self, served: &mut Served) -> Option<JointCounts> {
        self.node.warn_of_mismatches();
        let was_stopped = self.is_stopped;
        while let Some(taken) = self.stop.as_ref().and_then(Reader::take) {
            if let Ok(stop) = taken.and_then(|bytes| decode::<Bool>(&bytes).map_err(|error| error.to_string())) {
                self.is_stopped = stop.data;
            }
        }
        while let Some(Ok(Some((request, _)))) = self.stop_service.as_ref().map(|server| server.receive_request()) {
            self.is_stopped = true;
            let answer = TriggerResponse { success: true, message: "the arm holds".to_owned() };
            // The client that asked may have left.
            let _ = self.stop_service.as_ref().map(|server| server.send_response(request, answer));
        }
        served.stopped |= self.is_stopped;
        let mut newest = None;
        while let Some(taken) = self.commands.take() {
            match taken.ok().and_then(|bytes| self.set_point(&bytes)) {
                Some(counts) => {
                    served.commands += u64::from(!self.is_stopped);
                    newest = Some(counts);
                }
                None => served.unusable += 1,
            }
        }
        match (self.is_stopped, was_stopped) {
            (true, false) => self.latest,
            (true, true) => None,
            (false, _) => newest,
        }
    }

    fn set_point(&self, bytes: &[u8]) -> Option<JointCounts> {
        let command = Command::decode(self.connection.commands.message_type, bytes).ok()?;
        let names: Vec<&str> = self.names.iter().map(String::as_str).collect();
        command.in_order(&names).map(|positions| JointCounts::from_slice(&positions))
    }
}

fn trigger(
    node: &mut Node,
    connection: &Connection,
) -> Result<ros2_client::Server<TriggerRequest, TriggerResponse>, LiveError> {
    let name = ros2_client::Name::parse(&connection.stop.service).map_err(LiveError::dds("stop.service"))?;
    let qos = ros2_client::QosProfile::publisher_default();
    let type_name = ros2_client::ServiceTypeName::new("std_srvs", "Trigger");
    let mapping = service_mapping(connection.stop.mapping);
    node.ros.create_server(mapping, &name, &type_name, qos.clone(), qos).map_err(LiveError::dds("stop.service"))
}

impl Sink for Server<'_> {
    fn record(&mut self, _: Stamp, message: &Message) -> Result<(), SinkError> {
        if let Message::JointSensors(sample) = message {
            self.latest = Some(sample.counts);
        }
        let stream = Stream::of(message);
        let Some((_, writer)) = self.writers.iter().find(|(own, _)| *own == stream) else { return Ok(()) };
        let mut bytes = Vec::new();
        encode_message(message, &self.header, &mut bytes)?;
        Ok(writer.write(bytes)?)
    }
}
