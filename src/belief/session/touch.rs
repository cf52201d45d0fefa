//! Touches surveyed surfaces with the tool's tip, so that the arm's own sensors measure the tool position.
//!
//! The arm moves by a certified path to a pose before the surface, then slowly along the surface's normal. On that slow
//! way only the believed arm is kept clear, and of everything but the touched part, because a contact is intended. The
//! contact is detected when readings stay behind the set-point by more than on the free way before (`TouchDetector`).

use crate::plan::constants::targets::IK_TOLERANCE_M;
use crate::session::constants::touch::{
    BACK_SPEED_M_S, BEYOND_M, HELD_UP_M, HELD_UP_SIGMAS, LASTS_S, LEARNT_BEFORE_M, MAX_STRIDE_RAD, PART_CLEARANCE_M,
    RANDOM_SEEDS, REST_CLEARANCE_M, REST_S, SMOOTHING_S, SPEED_M_S, STRIDE_M, UNTOLD,
};
use nalgebra::{Matrix3, Vector3};
use rand::RngExt;

use crate::plan::{ClearanceModel, Edge};
use crate::session::SessionError;
use crate::session::motion::Driver;
use crate::session::runner::ScriptRunner;
use armcal_core::kinematics::{IkGoal, IkSettings, solve_position};
use armcal_core::routine::TouchSettings;
use armcal_core::streams::{JointAngles, LogLevel, Message, Phase, ToolTouch};

/// Detects that the tool no longer follows.
#[derive(Clone, Debug)]
struct TouchDetector {
    period_s: f64,
    smooth_m: Option<f64>,
    /// Statistics of the free way: number, mean, sum of squares about it.
    learnt: (f64, f64, f64),
    behind_s: f64,
}

impl TouchDetector {
    fn new(period_s: f64) -> Self {
        Self { period_s, smooth_m: None, learnt: (0.0, 0.0, 0.0), behind_s: 0.0 }
    }

    /// Smooths the distance by which the tool is behind its set-point, m.
    fn smooth(&mut self, behind_m: f64) -> f64 {
        let share = (self.period_s / SMOOTHING_S).min(1.0);
        let before_m = self.smooth_m.unwrap_or(behind_m);
        let smooth_m = before_m + share * (behind_m - before_m);
        self.smooth_m = Some(smooth_m);
        smooth_m
    }

    fn learn(&mut self, behind_m: f64) {
        let smooth_m = self.smooth(behind_m);
        let (n, mean_m, squares) = self.learnt;
        let apart_m = smooth_m - mean_m;
        let (n, mean_m) = (n + 1.0, mean_m + apart_m / (n + 1.0));
        self.learnt = (n, mean_m, squares + apart_m * (smooth_m - mean_m));
    }

    /// Returns the distance by which the tool is held up, m, if it is.
    fn felt_m(&mut self, behind_m: f64) -> Option<f64> {
        let (n, mean_m, squares) = self.learnt;
        let std_m = (squares / (n - 1.0).max(1.0)).sqrt();
        let held_up_m = self.smooth(behind_m) - mean_m;
        let is_behind = held_up_m > HELD_UP_M.max(HELD_UP_SIGMAS * std_m);
        self.behind_s = if is_behind { self.behind_s + self.period_s } else { 0.0 };
        (self.behind_s >= LASTS_S).then_some(held_up_m)
    }
}

/// The slow way to a surface and beyond it, at equal distances of the tip.
struct SlowWay {
    waypoints: Vec<JointAngles>,
    length_m: f64,
}

impl SlowWay {
    fn at(&self, way_m: f64) -> JointAngles {
        let last = self.waypoints.len() - 1;
        let place = (way_m / self.length_m).clamp(0.0, 1.0) * last as f64;
        let from = (place.floor() as usize).min(last - 1);
        let share = place - from as f64;
        let (a, b) = (&self.waypoints[from], &self.waypoints[from + 1]);
        JointAngles::from_fn(a.len(), |j| a[j] + share * (b[j] - a[j]))
    }
}

impl ScriptRunner<'_, '_> {
    /// Makes one touch and returns, or logs why not.
    pub(crate) fn touch_surface(&mut self, step: usize, settings: &TouchSettings) -> Result<(), SessionError> {
        let Some(radius_m) = self.robot.tool.tip_radius_m else {
            let problem = "robot.toml has no [tool] tip_radius_m: nobody says what touches".to_owned();
            return Err(SessionError::Step { step, problem });
        };
        let part = &settings.part;
        self.driver.phase(Phase::Move)?;
        self.progress_at(Phase::Move, 0, 1);
        let Some(way) = self.slow_way(settings, radius_m) else {
            let text =
                format!("the touch of {part} is left out: no configuration brings the tip there first, and clear");
            return self.driver.log(LogLevel::Warn, &text);
        };
        if !self.go(&way.waypoints[0])? || !self.driver.settle()? {
            return self
                .driver
                .log(LogLevel::Warn, &format!("the touch of {part} is left out: the arm did not get there"));
        }
        self.driver.ask(&crate::plan::Path::slowly(way.waypoints.clone()), Some(0.0))?;
        let normal = Vector3::from(settings.normal);
        let learnt_m = settings.approach_m - LEARNT_BEFORE_M;
        let (reached_m, is_felt) = self.driver.feel(&way, &normal, learnt_m)?;
        if is_felt {
            self.driver.phase(Phase::Settle)?;
            self.driver.hold(REST_S)?;
            self.driver.phase(Phase::Capture)?;
            self.record_touch(settings, radius_m)?;
        } else {
            let text =
                format!("the touch of {part} is left out: nothing was felt up to {BEYOND_M} m behind its surface");
            self.driver.log(LogLevel::Warn, &text)?;
        }
        self.driver.phase(Phase::Move)?;
        self.driver.withdraw(&way, reached_m)?;
        if !self.driver.settle()? {
            self.driver.log(LogLevel::Warn, &format!("the arm did not settle after the touch of {part}"))?;
        }
        Ok(())
    }

    fn record_touch(&mut self, settings: &TouchSettings, tip_radius_m: f64) -> Result<(), SessionError> {
        let stamp = self.driver.now();
        self.driver.hold(settings.dwell_s)?;
        let duration_s = self.driver.now().since_s(stamp);
        let touch = ToolTouch {
            stamp,
            duration_s,
            surface: settings.part.clone(),
            point_m: settings.point_m,
            normal: settings.normal,
            tip_radius_m,
            std_m: settings.std_m,
        };
        self.driver.record(&Message::Touch(touch))?;
        let poses = self.robot.chain.link_poses(&self.driver.believed_angles()?);
        let link = poses.link(self.robot.tool.mount.n_joints);
        self.touched.push(link.rotation.inverse() * Vector3::from(settings.normal));
        self.driver.log(LogLevel::Info, &format!("{} touched", settings.part))
    }

    /// Returns the way with the most information in addition to the touches before, among those on which the tip
    /// touches first.
    fn slow_way(&mut self, settings: &TouchSettings, radius_m: f64) -> Option<SlowWay> {
        let setup = self.setup;
        let clearances = ClearanceModel::for_touch(setup.robot, setup.vehicle, &setup.routine.scene, &settings.part)
            .map(|clearance| clearance.with_sag(&self.robot.chain));
        let told: Matrix3<f64> = self.touched.iter().map(|normal| normal * normal.transpose()).sum();
        let left = (told + Matrix3::identity() / UNTOLD).try_inverse()?;
        let here = self.driver.set_point();
        let mut best: Option<(f64, SlowWay)> = None;
        for attempt in 0..RANDOM_SEEDS + 2 {
            let seed = match attempt {
                0 => here,
                1 => self.robot.stowed,
                _ => self.random_configuration(),
            };
            let Some(way) = self.solved_way(settings, radius_m, &seed) else { continue };
            let poses = self.robot.chain.link_poses(&way.waypoints[0]);
            let link = poses.link(self.robot.tool.mount.n_joints);
            let normal = link.rotation.inverse() * Vector3::from(settings.normal);
            // Directions already determined count little; among equals, the nearer way wins.
            let worth = normal.dot(&(left * normal)) / (1.0 + 0.1 * way.waypoints[0].max_abs_difference(&here));
            if best.as_ref().is_none_or(|(most, _)| worth > *most) && self.is_clear(&way, settings, &clearances) {
                best = Some((worth, way));
            }
        }
        best.map(|(_, way)| way)
    }

    fn random_configuration(&mut self) -> JointAngles {
        let limits = self.bounds.safe_limits(&self.robot);
        let last = self.robot.tool.mount.n_joints - 1;
        let (stowed, rng) = (self.robot.stowed, &mut self.rng);
        JointAngles::from_fn(stowed.len(), |j| {
            let (low, high) = (limits[j].lower_rad, limits[j].upper_rad);
            if j >= last || high - low > std::f64::consts::TAU { stowed[j] } else { rng.random_range(low..=high) }
        })
    }

    fn solved_way(&self, settings: &TouchSettings, radius_m: f64, seed: &JointAngles) -> Option<SlowWay> {
        let robot = &self.robot;
        let ik = IkSettings {
            limits: self.bounds.safe_limits(robot),
            locked: (0..robot.n_joints()).map(|joint| joint + 1 >= robot.tool.mount.n_joints).collect(),
            tolerance_m: IK_TOLERANCE_M,
            max_iterations: 200,
        };
        let length_m = settings.approach_m + BEYOND_M;
        let n = (length_m / STRIDE_M).ceil() as usize;
        let mut waypoints: Vec<JointAngles> = Vec::with_capacity(n + 1);
        for k in 0..=n {
            let out_m = radius_m + settings.approach_m - length_m * k as f64 / n as f64;
            let goal = IkGoal { position_m: settings.point_at(out_m).coords };
            let from = waypoints.last().unwrap_or(seed);
            let angles = solve_position(&robot.chain, &robot.tool.mount, &goal, from, &ik).ok()?;
            if k > 0 && angles.max_abs_difference(from) > MAX_STRIDE_RAD {
                return None;
            }
            waypoints.push(angles);
        }
        Some(SlowWay { waypoints, length_m })
    }

    /// True if every arm within the bounds is clear at the start of the way, and the believed one from there to the
    /// surface.
    fn is_clear(&self, way: &SlowWay, settings: &TouchSettings, [rest, part]: &[ClearanceModel<'_>; 2]) -> bool {
        if self.clearance.find_violation_arriving(&way.waypoints[0], &self.bounds, self.margin_m()).is_some() {
            return false;
        }
        let n = (settings.approach_m / way.length_m * (way.waypoints.len() - 1) as f64).round() as usize;
        let nearest_of = |model: &ClearanceModel<'_>, edge: &Edge, margin_m: f64| {
            model.find_violation_exact(&edge.from, &edge.to, margin_m).is_some()
        };
        (0..n).all(|k| {
            let edge = Edge::at_full_speed(way.waypoints[k], way.waypoints[k + 1]);
            !nearest_of(rest, &edge, REST_CLEARANCE_M) && !nearest_of(part, &edge, PART_CLEARANCE_M)
        })
    }
}

impl Driver<'_> {
    /// Moves along the way until the tool is held up. Returns the travelled distance, m, and true if it was held up.
    /// The set-point is then at the readings.
    fn feel(&mut self, way: &SlowWay, normal: &Vector3<f64>, learnt_m: f64) -> Result<(f64, bool), SessionError> {
        let period_s = self.arm.period_s();
        let mut detector = TouchDetector::new(period_s);
        let n = (way.length_m / (SPEED_M_S * period_s)).ceil() as u64;
        for k in 1..=n {
            let way_m = way.length_m * k as f64 / n as f64;
            self.follow_point(&way.at(way_m))?;
            let behind_m = normal.dot(&(self.believed_tool_m()? - self.set_tool_m()));
            if way_m < learnt_m {
                detector.learn(behind_m);
            } else if let Some(held_up_m) = detector.felt_m(behind_m) {
                let reached_m = (way_m - held_up_m).max(0.0);
                self.follow_point(&way.at(reached_m))?;
                return Ok((reached_m, true));
            }
        }
        Ok((way.length_m, false))
    }

    /// Moves back along the way from `reached_m`.
    fn withdraw(&mut self, way: &SlowWay, reached_m: f64) -> Result<(), SessionError> {
        let n = (reached_m / (BACK_SPEED_M_S * self.arm.period_s())).ceil().max(1.0) as u64;
        for k in 1..=n {
            self.follow_point(&way.at(reached_m * (1.0 - k as f64 / n as f64)))?;
        }
        self.forget_contact();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_core::stats::stream_rng;
    use rand_distr::{Distribution, StandardNormal};

    /// Returns the distance beyond a wall at which the stop of a tool with lag and noise is detected, m; `None` if it
    /// is not.
    fn felt_at(seed: u64, wall_m: f64, noise_m: f64) -> Option<f64> {
        const PERIOD_S: f64 = 0.01;
        let mut rng = stream_rng(seed, "feel");
        let mut detector = TouchDetector::new(PERIOD_S);
        let mut tool_m: f64 = 0.0;
        for k in 1..=2500 {
            let set_m = SPEED_M_S * PERIOD_S * f64::from(k);
            tool_m = (tool_m + (set_m - tool_m) * PERIOD_S / 0.2).min(wall_m);
            let noise: f64 = StandardNormal.sample(&mut rng);
            let behind_m = set_m - tool_m + noise_m * noise;
            if set_m < 0.06 {
                detector.learn(behind_m);
            } else if detector.felt_m(behind_m).is_some() {
                return Some(set_m - wall_m);
            }
        }
        None
    }

    #[test]
    fn a_wall_is_felt_within_millimetres_and_free_water_is_not() {
        for seed in 0..200 {
            for noise_m in [0.0, 3e-4, 1.2e-3] {
                let at_m = felt_at(seed, 0.1, noise_m).expect("the wall is felt");
                assert!((0.001..0.008).contains(&at_m), "seed {seed}, noise {noise_m} m: {at_m} m");
                assert_eq!(felt_at(seed, 1.0, noise_m), None, "seed {seed}, noise {noise_m} m");
            }
        }
    }
}
