//! An arm in a dive whose sensors differ from the estimator's model. Temperature acts with a lag, pressure with
//! hysteresis, offsets walk, and the datasheet's noise is wrong by a factor of two.

use rand_chacha::ChaCha8Rng;

use crate::batch::tests::data::{Noise, Truth, normal, rng, titan, views};
use crate::follow::estimator::OnlineEstimator;
use crate::follow::event::OnlineEvent;
use crate::follow::settings::{OnlineSettings, online_model};
use crate::model::scales::Hyperparameters;
use crate::views::view::View;
use armcal_core::joints::{JointAngles, MAX_JOINTS};
use armcal_core::robot::Robot;
use armcal_core::sensor::Conditions;
use armcal_core::time::{SIMULATION_EPOCH, Stamp};

const HOURS: f64 = 8.0;
const TASK_EVERY_S: f64 = 600.0;
const SENSOR_LAG_S: f64 = 600.0;
const WALK_RAD_PER_SQRT_H: f64 = 0.02 * std::f64::consts::PI / 180.0;
const RAD_PER_K: f64 = 0.02 * std::f64::consts::PI / 180.0;
const RAD_PER_MPA: f64 = 2e-4;

/// A simulated arm in a dive.
#[derive(Clone)]
pub(crate) struct Dive<'a> {
    robot: &'a Robot,
    pub truth: Truth,
    at_start: [f64; MAX_JOINTS],
    noise: Noise,
    per_k: [f64; MAX_JOINTS],
    per_mpa: [f64; MAX_JOINTS],
    walk_rad: [f64; MAX_JOINTS],
    sensor_c: f64,
    /// Pressure that acts on the sensors, MPa, with a hysteresis of a tenth of the depth's.
    acting_mpa: f64,
    now_s: f64,
    rng: ChaCha8Rng,
}

/// Returns the depth as a share of the deepest: down in two hours, up in the last two.
fn depth_share(at_s: f64) -> f64 {
    let h = at_s / 3600.0;
    (h / 2.0).min((HOURS - h) / 2.0).clamp(0.0, 1.0)
}

fn water_c(at_s: f64) -> f64 {
    let share = depth_share(at_s);
    2.0 + 23.0 * (1.0 - share).powi(3)
}

fn pressure_pa(at_s: f64) -> f64 {
    1e5 + 4e7 * depth_share(at_s)
}

impl<'a> Dive<'a> {
    pub fn new(robot: &'a Robot, seed: u64) -> Self {
        let mut rng = rng(seed, "dive");
        let mut scales = Hyperparameters::datasheet(robot);
        let mut model = online_model(robot);
        for kinds in &mut model.joints {
            use crate::model::parameters::ParameterKind as Kind;
            kinds.retain(|kind| !matches!(kind, Kind::OffsetPerK | Kind::GainPerK | Kind::OffsetPerMpa));
        }
        scales.joint_std_rad.iter_mut().for_each(|std| *std *= if seed.is_multiple_of(2) { 0.5 } else { 1.5 });
        let truth = Truth::draw(robot, &model, &scales, &mut rng);
        let noise = Noise { corner_px: 0.5, n_frames: 6, joint_rad: scales.joint_std_rad };
        let mut draw = |std: f64| std::array::from_fn(|_| std * normal(&mut rng));
        let (per_k, per_mpa) = (draw(RAD_PER_K), draw(RAD_PER_MPA));
        let at_start = truth.parameters.offset_rad;
        Self {
            robot,
            truth,
            at_start,
            noise,
            per_k,
            per_mpa,
            walk_rad: [0.0; MAX_JOINTS],
            sensor_c: water_c(0.0),
            acting_mpa: 0.0,
            now_s: 0.0,
            rng,
        }
    }

    /// Lets time pass, with thermometer readings.
    pub fn advance(&mut self, online: &mut OnlineEstimator, at_s: f64) {
        while self.now_s < at_s {
            self.advance_to((self.now_s + 30.0).min(at_s));
            online.hear_temperature(self.stamp(), water_c(self.now_s));
        }
    }

    fn advance_to(&mut self, at_s: f64) {
        const STEP_S: f64 = 10.0;
        while self.now_s < at_s {
            let by_s = STEP_S.min(at_s - self.now_s);
            self.now_s += by_s;
            self.sensor_c += (water_c(self.now_s) - self.sensor_c) * (by_s / SENSOR_LAG_S).min(1.0);
            let mpa = 1e-6 * pressure_pa(self.now_s);
            self.acting_mpa = self.acting_mpa.clamp(mpa - 2.0, mpa + 2.0);
            let std = WALK_RAD_PER_SQRT_H * (by_s / 3600.0).sqrt();
            self.walk_rad.iter_mut().for_each(|walk| *walk += std * normal(&mut self.rng));
        }
        for joint in 0..MAX_JOINTS {
            self.truth.parameters.offset_rad[joint] = self.at_start[joint]
                + self.walk_rad[joint]
                + self.per_k[joint] * (self.sensor_c - water_c(0.0))
                + self.per_mpa[joint] * self.acting_mpa;
        }
    }

    /// Applies a fault to the truth, or to the initial offsets.
    pub fn befall(&mut self, happen: impl FnOnce(&mut Truth, &mut [f64; MAX_JOINTS])) {
        happen(&mut self.truth, &mut self.at_start);
        self.advance_to(self.now_s);
    }

    pub fn conditions(&self) -> Conditions {
        let stamp = Some(self.stamp());
        Conditions { oil_c: Some(water_c(self.now_s)), pressure_pa: Some(pressure_pa(self.now_s)), stamp }
    }

    fn stamp(&self) -> Stamp {
        SIMULATION_EPOCH.plus_s(self.now_s)
    }

    /// Returns a view now, at a random configuration that shows tags.
    pub fn view(&mut self) -> View {
        let mut view = views(self.robot, &self.truth, &self.noise, 1, &mut self.rng).remove(0);
        (view.conditions, view.end) = (self.conditions(), self.stamp());
        view
    }

    /// Returns the tool error at a configuration of a task, and its prediction by the covariance.
    pub fn task(&mut self, online: &OnlineEstimator) -> TaskError {
        let robot = self.robot;
        let posture = views(robot, &self.truth, &self.noise, 1, &mut self.rng).remove(0);
        let mut angles = self.truth.angles(robot, &posture);
        for (angle, std) in angles.iter_mut().zip(self.noise.joint_rad).take(robot.n_seen_joints()) {
            *angle += std * normal(&mut self.rng);
        }
        let parameters = online.parameters().expect("it runs");
        let departure = online.at_sensors(&self.conditions()).departure_from(&parameters.reference);
        let believed = JointAngles::from_fn(robot.n_joints(), |j| {
            let correction = parameters.correction(j);
            correction.angle_rad(&robot.sensors[j], posture.travel_rad[j], &departure, 0.0)
        });
        // Joints distal to the camera are excluded from this comparison.
        let believed =
            JointAngles::from_fn(robot.n_joints(), |j| if j < robot.n_seen_joints() { believed[j] } else { angles[j] });
        let tool_m = |at: &JointAngles| robot.chain.frame(at, &robot.tool.mount).translation.vector;
        let off_m = tool_m(&believed) - tool_m(&angles);
        let mut covariance = online.covariance(&self.conditions()).expect("it runs");
        let std = covariance.residual_std_rad.as_mut().expect("of each joint");
        (robot.n_seen_joints()..robot.n_joints()).for_each(|j| std[j] = 0.0);
        let sensors = parameters.sensors(robot);
        let at = Conditions { stamp: parameters.reference.stamp, ..online.at_sensors(&self.conditions()) };
        let mut sound = robot.clone();
        sound.sensors.iter_mut().skip(robot.n_seen_joints()).for_each(|spec| {
            (spec.gain_std, spec.offset_std_rad, spec.temperature_std_rad_per_k) = (0.0, 0.0, 0.0);
        });
        let predicted = covariance.tool_position_under_m2(&sound, &sensors, &believed, &at);
        let nees = predicted.cholesky().map_or(f64::NAN, |factor| off_m.dot(&factor.solve(&off_m)));
        TaskError { at_s: self.now_s, error_m: off_m.norm(), predicted_m: predicted.trace().sqrt(), nees }
    }
}

/// Truth and prediction at one task.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TaskError {
    pub at_s: f64,
    pub error_m: f64,
    pub predicted_m: f64,
    pub nees: f64,
}

/// Simulates a day: twenty views at first, then a view at each third task, none from the fourth hour to the sixth.
fn day(robot: &Robot, seed: u64) -> (Vec<TaskError>, Vec<OnlineEvent>, OnlineEstimator) {
    let mut dive = Dive::new(robot, seed);
    let mut online = OnlineEstimator::new(robot.clone(), OnlineSettings::default());
    for k in 0..24 {
        dive.advance(&mut online, 12.0 * f64::from(k));
        online.add_view(&dive.view());
    }
    let mut errors = Vec::new();
    for task in 1..(HOURS * 3600.0 / TASK_EVERY_S) as usize {
        let at_s = task as f64 * TASK_EVERY_S;
        dive.advance(&mut online, at_s);
        errors.push(dive.task(&online));
        let in_gap = (4.0..6.0).contains(&(at_s / 3600.0));
        if task % 3 == 0 && !in_gap {
            let view = dive.view();
            online.add_view(&view);
            let at_s = at_s + 20.0;
            dive.advance(&mut online, at_s);
            let view = dive.view();
            online.add_view(&view);
        }
    }
    let events = online.take_events();
    (errors, events, online)
}

fn quantile(values: &mut [f64], q: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * q).round() as usize]
}

#[test]
fn the_tool_stays_known_all_day_and_the_prediction_is_right() {
    let robot = titan();
    let n_seeds: u64 = std::env::var("ARMCAL_DIVES").ok().and_then(|n| n.parse().ok()).unwrap_or(6);
    let (mut all, mut n_events) = (Vec::new(), 0);
    for seed in 0..n_seeds {
        let (errors, events, online) = day(&robot, seed);
        events.iter().for_each(|event| println!("seed {seed}: {}", event.to_line()));
        println!("seed {seed}: factors {:.2?}, lag {} s", online.drift_factors(), online.temperature_lag_s());
        n_events += events.len();
        all.extend(errors);
    }
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    for hour in 0..8 {
        let of_hour: Vec<&TaskError> = all.iter().filter(|task| (task.at_s / 3600.0) as usize == hour).collect();
        let mut errors: Vec<f64> = of_hour.iter().map(|task| 1e3 * task.error_m).collect();
        let nees: Vec<f64> = of_hour.iter().map(|task| task.nees).collect();
        let squares = |f: &dyn Fn(&TaskError) -> f64| mean(&of_hour.iter().map(|t| f(t).powi(2)).collect::<Vec<_>>());
        let ratio = (squares(&|t| t.error_m) / squares(&|t| t.predicted_m)).sqrt();
        let (median, p95) = (quantile(&mut errors, 0.5), quantile(&mut errors, 0.95));
        println!("hour {hour}: median {median:.2} mm, 95 % {p95:.2} mm, NEES {:.2}, ratio {ratio:.2}", mean(&nees));
    }
    let mut errors: Vec<f64> = all.iter().map(|task| 1e3 * task.error_m).collect();
    let nees = mean(&all.iter().map(|task| task.nees).collect::<Vec<_>>());
    let (median, p95) = (quantile(&mut errors, 0.5), quantile(&mut errors, 0.95));
    println!("day: median {median:.2} mm, 95 % {p95:.2} mm, NEES {nees:.2}, events {n_events}");
    assert!(median < 2.0 && p95 < 6.0, "{median} {p95}");
    assert!((2.0..4.3).contains(&nees), "{nees}");
}

/// Tags passed hours after a few views at rest in the morning are used, too.
#[test]
fn tags_passed_after_a_short_start_are_used() {
    let robot = titan();
    let mut dive = Dive::new(&robot, 1);
    let mut online = OnlineEstimator::new(robot.clone(), OnlineSettings::default());
    for k in 0..8 {
        dive.advance(&mut online, 12.0 * f64::from(k));
        online.add_view(&dive.view());
    }
    dive.advance(&mut online, 3600.0);
    let before = dive.task(&online).predicted_m;
    for k in 0..6 {
        dive.advance(&mut online, 3600.0 + f64::from(k));
        let mut view = dive.view();
        view.rate_rad_s[0] = 0.05;
        assert!(online.add_view(&view), "it tells something");
    }
    let after = dive.task(&online).predicted_m;
    assert!(after < 0.7 * before, "{before} {after}");
}
