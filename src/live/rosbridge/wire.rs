//! An arm behind a rosbridge.

use std::time::{Duration, Instant};

use super::handshake;
use super::link::Link;
use super::protocol::{Listener, greeting, set_point, stop};
use crate::messages::Command;
use crate::topics::newest_stamp;
use crate::{Connection, Heard, LiveError, Rosbridge, Wire};
use armcal_core::codes::Coded;
use armcal_core::robot::Robot;
use armcal_core::streams::{JointCounts, LogLevel, LogLine, Message};
use armcal_core::time::Stamp;

/// Longest wait until a stop is on its way.
const STOP_LIMIT: Duration = Duration::from_millis(100);

/// A connection over a rosbridge. Once lost, it stays lost: nothing comes in its place, and the recording says why.
pub struct RosbridgeWire {
    connection: Connection,
    bridge: Rosbridge,
    /// The driver's joint names, in the robot's order of joints.
    names: Vec<String>,
    link: Link,
    start: Instant,
    newest: Stamp,
    /// True if the recording was told that the connection is lost.
    is_told: bool,
}

impl RosbridgeWire {
    /// Connects and subscribes; no set-point is sent.
    ///
    /// # Errors
    /// [`LiveError::Rosbridge`] when nobody answers within `guard.connect_s`, or no rosbridge does.
    pub fn open(connection: &Connection, bridge: &Rosbridge, robot: &Robot) -> Result<Self, LiveError> {
        let failed = |problem: String| LiveError::rosbridge(&bridge.url, problem);
        let names: Vec<String> =
            robot.joint_names().iter().map(|name| connection.driver_name(name).to_owned()).collect();
        let limit = Duration::from_secs_f64(connection.guard.connect_s);
        let (host, port) = bridge.address().map_err(failed)?;
        let opened = handshake::open(host, port, limit).map_err(failed)?;
        let link = Link::start(opened, Listener::new(connection, bridge, &names), &bridge.url)?;
        link.send(greeting(connection, bridge)).map_err(failed)?;
        Ok(Self {
            connection: connection.clone(),
            bridge: bridge.clone(),
            names,
            link,
            start: Instant::now(),
            newest: Stamp { nanos: 0 },
            is_told: false,
        })
    }

    fn lost(&self, why: &str) -> LiveError {
        LiveError::rosbridge(&self.bridge.url, format!("the connection is lost: {why}"))
    }
}

impl Wire for RosbridgeWire {
    fn elapsed(&self) -> Duration {
        self.start.elapsed()
    }

    fn receive(&mut self, timeout: Duration, heard: &mut Vec<Heard>) -> Result<(), LiveError> {
        let before = heard.len();
        let Err(why) = self.link.take(timeout, heard) else {
            self.newest = newest_stamp(&heard[before..], self.newest);
            return Ok(());
        };
        let error = self.lost(&why);
        if std::mem::replace(&mut self.is_told, true) {
            return Err(error);
        }
        // The recording gets the line first.
        let line = LogLine {
            stamp: self.newest,
            level: LogLevel::Error,
            name: "rosbridge".to_owned(),
            text: format!("{error} [{}]", error.code()),
        };
        heard.push(Heard::Other(Message::Log(line)));
        Ok(())
    }

    fn send(&mut self, counts: &JointCounts, within_s: f64) -> Result<(), LiveError> {
        let command = Command { stamp: self.newest, names: self.names.clone(), positions: counts.to_vec(), within_s };
        let text = set_point(&self.connection, &self.bridge, &command)?;
        match self.link.send([text]) {
            // The next `receive` reports it, to the recording first.
            Err(_) if !self.is_told => Ok(()),
            sent => sent.map_err(|why| self.lost(&why)),
        }
    }

    fn stop(&mut self) -> Result<(), LiveError> {
        let sent = self.link.send(stop(&self.connection)).and_then(|()| self.link.flush(STOP_LIMIT));
        sent.map_err(|why| self.lost(&why))
    }
}
