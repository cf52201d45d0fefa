//! The simulated world from outside: its messages, and its truth.

mod camera;
mod faults;
mod gripper;
mod happenings;
mod moves;
mod streams;
mod truth;

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use armcal::robot::{Robot, Vehicle, load, load_vehicle};
use armcal::routine::Scene;
use armcal::sensor::ArmSensors;
use armcal::sim::truth::{TruthClearance, TruthContact, TruthFault, TruthHeader, TruthSink, TruthState};
use armcal::sim::{World, WorldInput, WorldSpec};
use armcal::streams::{Arm, JointAngles, JointCounts, Message, Sink, SinkError};
use armcal::time::Stamp;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).to_owned()
}

struct Site {
    robot: Robot,
    vehicle: Vehicle,
    scene: Scene,
}

impl Site {
    fn titan() -> Self {
        let robot = load(&root().join("robots/titan4")).expect("the robot reads");
        let vehicle = load_vehicle(&root().join("robots/vehicles/work-class-front.toml")).expect("the vehicle reads");
        Self { robot, vehicle, scene: Scene::default() }
    }

    fn world(&self, spec: WorldSpec, seed: u64) -> World {
        let Self { robot, vehicle, scene } = self;
        World::new(WorldInput { robot, vehicle, scene, spec, seed }).expect("a world")
    }

    fn nominal_counts(&self, angles: &[f64]) -> JointCounts {
        ArmSensors::nominal(&self.robot).counts(&JointAngles::from_slice(angles))
    }
}

/// A listener that keeps every message.
#[derive(Default)]
struct Tape {
    messages: Vec<(Stamp, Message)>,
}

impl Sink for Tape {
    fn record(&mut self, log_time: Stamp, message: &Message) -> Result<(), SinkError> {
        self.messages.push((log_time, message.clone()));
        Ok(())
    }
}

impl Tape {
    fn run(&mut self, world: &mut World, seconds: f64) {
        for _ in 0..(seconds / world.period_s()).round() as u32 {
            world.step(self).expect("the world steps");
        }
    }

    /// Mean nominal angles of the readings since `since`, rad.
    fn mean_angles(&self, site: &Site, since: Stamp) -> JointAngles {
        let sensors = ArmSensors::nominal(&site.robot);
        let mut sum = JointAngles::zeros(site.robot.n_joints());
        let mut n = 0.0;
        for (_, message) in self.messages.iter().filter(|(log_time, _)| *log_time > since) {
            if let Message::JointSensors(sample) = message {
                let angles = sensors.angles(&sample.counts);
                sum = JointAngles::from_fn(sum.len(), |j| sum[j] + angles[j]);
                n += 1.0;
            }
        }
        JointAngles::from_fn(sum.len(), |j| sum[j] / n)
    }
}

/// A sink that keeps the truth for the test.
#[derive(Clone, Default)]
struct Witness {
    header: Rc<RefCell<Option<TruthHeader>>>,
    states: Rc<RefCell<Vec<TruthState>>>,
    contacts: Rc<RefCell<Vec<TruthContact>>>,
    clearances: Rc<RefCell<Vec<TruthClearance>>>,
    faults: Rc<RefCell<Vec<TruthFault>>>,
}

impl TruthSink for Witness {
    fn begin(&mut self, header: &TruthHeader) -> Result<(), SinkError> {
        *self.header.borrow_mut() = Some(header.clone());
        Ok(())
    }

    fn state(&mut self, state: &TruthState) -> Result<(), SinkError> {
        self.states.borrow_mut().push(*state);
        Ok(())
    }

    fn contact(&mut self, contact: &TruthContact) -> Result<(), SinkError> {
        self.contacts.borrow_mut().push(contact.clone());
        Ok(())
    }

    fn clearance(&mut self, clearance: &TruthClearance) -> Result<(), SinkError> {
        self.clearances.borrow_mut().push(clearance.clone());
        Ok(())
    }

    fn fault(&mut self, fault: &TruthFault) -> Result<(), SinkError> {
        self.faults.borrow_mut().push(fault.clone());
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<(), SinkError> {
        Ok(())
    }
}
