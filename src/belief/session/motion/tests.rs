//! An arm that reaches its set-points at once, while its oil warms.

use crate::model::JointParameters;
use crate::session::motion::*;
use armcal_core::log::{RecordingHeader, RecordingWriter, read_recording};
use armcal_core::sensor::Terms;
use armcal_core::streams::{JointSensorSample, PressureSample, TemperatureSample, Thermometer};
use armcal_core::time::SIMULATION_EPOCH;

struct WarmingArm {
    now: Stamp,
    counts: JointCounts,
    oil_c: f64,
    pressure_pa: f64,
}

impl Arm for WarmingArm {
    fn now(&self) -> Stamp {
        self.now
    }

    fn command(&mut self, set_point: &JointCounts) -> Result<(), ArmError> {
        self.counts = *set_point;
        Ok(())
    }

    fn step(&mut self, sink: &mut dyn Sink) -> Result<(), ArmError> {
        self.now = self.now.plus_s(0.01);
        let stamp = self.now;
        let (counts, temperature_c, pressure_pa) = (self.counts, self.oil_c, self.pressure_pa);
        let thermometer = Thermometer::Oil;
        for message in [
            Message::JointSensors(JointSensorSample { stamp, counts }),
            Message::Temperature(TemperatureSample { stamp, thermometer, temperature_c, variance_c2: 0.01 }),
            Message::Temperature(TemperatureSample {
                stamp,
                thermometer: Thermometer::Water,
                temperature_c: -1.0,
                variance_c2: 0.01,
            }),
            Message::Pressure(PressureSample { stamp, pressure_pa, variance_pa2: 1.0 }),
        ] {
            sink.record(stamp, &message).map_err(ArmError::Sink)?;
        }
        Ok(())
    }

    fn period_s(&self) -> f64 {
        0.01
    }
}

struct Silent;

impl Progress for Silent {
    fn update(&mut self, _: Phase, _: usize, _: usize, _: f64) {}

    fn wall_s(&self) -> f64 {
        0.0
    }
}

fn titan() -> Robot {
    let folder = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots/titan4");
    armcal_core::robot::load(&folder).expect("the robot reads")
}

#[test]
fn sensors_with_terms_are_used_under_what_was_heard_last() {
    let robot = titan();
    let nominal = ArmSensors::nominal(&robot);
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("run.mcap");
    let writer = RecordingWriter::create(&file, RecordingHeader::new(robot.joint_names())).expect("a file");
    let mut recorder = Recorder::new(writer);
    let counts = nominal.counts(&robot.stowed);
    let mut arm = WarmingArm { now: SIMULATION_EPOCH, counts, oil_c: 20.0, pressure_pa: 1e6 };
    let mut progress = Silent;
    let mut driver = Driver::new(&robot, &mut arm, &mut recorder, nominal.clone(), &mut progress).expect("it steps");

    let reference = Conditions { oil_c: Some(20.0), pressure_pa: Some(1e6), stamp: Some(driver.now()) };
    let mut parameters = JointParameters { reference, ..JointParameters::default() };
    let [per_k, per_mpa, per_h] = [1e-3, 2e-3, 0.5];
    parameters.terms[0] = Terms { offset_rad_per_k: per_k, ..Terms::default() };
    parameters.terms[1] = Terms { offset_rad_per_mpa: per_mpa, ..Terms::default() };
    parameters.terms[2] = Terms { drift_rad_per_h: per_h, ..Terms::default() };
    parameters.terms[3].nonlinearity_rad[2] = 5e-3;
    driver.believe(parameters.sensors(&robot));
    // At the reference conditions only the nonlinearity has an effect.
    let at_rest = driver.believed_angles().expect("readings");
    for joint in [0, 1, 2, 4, 5] {
        assert!((at_rest[joint] - robot.stowed[joint]).abs() < 1e-9);
    }
    assert!((at_rest[3] - robot.stowed[3]).abs() > 1e-4);
    assert!(driver.set_point().max_abs_difference(&at_rest) < 1e-9);

    // Warmer oil, greater depth and a later time change the angle that belongs to a reading.
    let ends = Path::at_full_speed(vec![at_rest, at_rest]);
    driver.arm.command(&counts).expect("taken");
    drop(driver);
    (arm.oil_c, arm.pressure_pa) = (35.0, 4e6);
    let mut driver =
        Driver::new(&robot, &mut arm, &mut recorder, parameters.sensors(&robot), &mut progress).expect("it steps");
    driver.arm.command(&counts).expect("taken");
    driver.step().expect("it steps");
    let warm = driver.believed_angles().expect("readings");
    let hours = driver.now().since_s(reference.stamp.expect("there")) / 3600.0;
    for (joint, expected) in [15.0 * per_k, 3.0 * per_mpa, hours * per_h, 0.0, 0.0, 0.0].into_iter().enumerate() {
        assert!((warm[joint] - at_rest[joint] - expected).abs() < 1e-9, "{joint}: {}", warm[joint] - at_rest[joint]);
    }
    // Other readings then belong to the same angles, and the estimate is at the set-point.
    assert_eq!(driver.follow(&ends).expect("it moves"), MotionOutcome::Arrived);
    for _ in 0..3 {
        driver.step().expect("it steps");
    }
    let there = driver.believed_angles().expect("readings");
    assert!(there.max_abs_difference(&at_rest) < 1e-5, "{there:?} {at_rest:?}");
    let turned_rad = nominal.angles(&driver.counts().expect("readings"))[0] - nominal.angles(&counts)[0];
    assert!((turned_rad + 15.0 * per_k).abs() < 1e-6, "{turned_rad}");
    drop(driver);

    // The recorded belief is the same.
    recorder.writer.flush().expect("written");
    let recording = read_recording(&file).expect("it reads");
    let states: Vec<_> = recording
        .messages
        .iter()
        .filter_map(|(_, m)| if let Message::JointStates(state) = m { Some(state.angles) } else { None })
        .collect();
    assert!(states.last().expect("states").max_abs_difference(&at_rest) < 1e-5);
}

/// An operator who answers in turn, and keeps the questions.
struct Operator {
    answers: Vec<crate::session::Approval>,
    asked: Vec<crate::session::MotionAhead>,
}

impl Progress for Operator {
    fn update(&mut self, _: Phase, _: usize, _: usize, _: f64) {}

    fn wall_s(&self) -> f64 {
        0.0
    }

    fn wants_to_approve(&self) -> bool {
        true
    }

    fn approve(&mut self, ahead: &crate::session::MotionAhead) -> crate::session::Approval {
        self.asked.push(ahead.clone());
        self.answers.remove(0)
    }
}

#[test]
fn an_operator_is_asked_before_a_motion_and_obeyed() {
    use crate::session::Approval;
    let robot = titan();
    let nominal = ArmSensors::nominal(&robot);
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("run.mcap");
    let writer = RecordingWriter::create(&file, RecordingHeader::new(robot.joint_names())).expect("a file");
    let mut recorder = Recorder::new(writer);
    let counts = nominal.counts(&robot.stowed);
    let mut arm = WarmingArm { now: SIMULATION_EPOCH, counts, oil_c: 20.0, pressure_pa: 1e6 };
    let abort = || Approval::Abort("enough".to_owned());
    let mut operator =
        Operator { answers: vec![Approval::Hold, Approval::Hold, Approval::Approve, abort()], asked: Vec::new() };
    let mut driver = Driver::new(&robot, &mut arm, &mut recorder, nominal, &mut operator).expect("it steps");
    let from = driver.set_point();
    let to = JointAngles::from_fn(6, |j| if j == 0 { from[0] + 0.3 } else { from[j] });
    let path = Path::at_full_speed(vec![from, to]);
    let duration_s = Timing::new(&robot).path_duration_s(&path);
    assert_eq!(driver.follow_told(&path, Some(0.07)).expect("it moves"), MotionOutcome::Arrived);
    // Two holds of 5 s, then the motion.
    assert!((driver.elapsed_s() - 0.01 - 10.0 - duration_s).abs() < 0.05, "{}", driver.elapsed_s());
    let back = Path::at_full_speed(vec![to, from]);
    assert!(matches!(driver.follow(&back), Err(SessionError::Interrupted { .. })));
    assert!(driver.set_point().max_abs_difference(&to) < 1e-12, "it stays");
    drop(driver);
    let clearances: Vec<Option<f64>> = operator.asked.iter().map(|ahead| ahead.clearance_m).collect();
    assert_eq!(clearances, [Some(0.07), Some(0.07), Some(0.07), None]);
    assert!(operator.asked.iter().all(|ahead| (ahead.duration_s - duration_s).abs() < 1e-9 && ahead.edges == 1));
    recorder.writer.flush().expect("written");
    let recording = read_recording(&file).expect("it reads");
    let lines: Vec<String> = recording
        .messages
        .into_iter()
        .filter_map(|(_, m)| if let Message::Log(line) = m { Some(line.text) } else { None })
        .collect();
    insta::assert_snapshot!("operator", lines.join("\n"));
}
