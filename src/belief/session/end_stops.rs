//! Presses joints against their nominal end stops, one after the other, to measure joint limits (Williams 1991).
//!
//! Each joint moves alone from the stowed pose, past its nominal stop by its error bound. So every arm within the
//! bounds reaches its stop. If the vehicle, the arm itself or the seafloor may be in the way of any of them, the stop
//! is refused with the reason. For that reason the method is useless on many vehicles.

use crate::plan::{Edge, Path};
use crate::session::SessionError;
use crate::session::runner::ScriptRunner;
use armcal_core::routine::StopsSettings;
use armcal_core::streams::{JointAngles, LogLevel, MarkKind, Phase};

impl ScriptRunner<'_, '_> {
    pub(crate) fn stops(&mut self, step: usize, settings: &StopsSettings) -> Result<(), SessionError> {
        let joints = self.robot.joint_names();
        let wrong = |problem: &str| SessionError::Step { step, problem: problem.to_owned() };
        self.driver.phase(Phase::Move)?;
        let stowed = self.robot.stowed;
        if !self.go(&stowed)? {
            return Err(wrong("no path leads to the stowed pose, from where the stops are driven to"));
        }
        let wanted = |name: &String| settings.joints.is_empty() || settings.joints.contains(name);
        let all: Vec<usize> = (0..joints.len()).filter(|&joint| wanted(&joints[joint])).collect();
        for (n, &joint) in all.iter().enumerate() {
            self.progress_at(Phase::Move, n, all.len());
            let Some(limits) = self.robot.chain.joints()[joint].limits else {
                let text = format!("{} turns without end and has no stops", joints[joint]);
                self.driver.log(LogLevel::Info, &text)?;
                continue;
            };
            for (angle_rad, way) in [(limits.lower_rad, -1.0), (limits.upper_rad, 1.0)] {
                self.stop(joint, angle_rad, way, settings.dwell_s)?;
            }
        }
        Ok(())
    }

    /// Drives to one stop and back, or logs why not.
    fn stop(&mut self, joint: usize, angle_rad: f64, way: f64, dwell_s: f64) -> Result<(), SessionError> {
        let from = self.driver.set_point();
        let beyond_rad = angle_rad + way * self.bounds.error_rad(joint, angle_rad);
        let to = JointAngles::from_fn(from.len(), |j| if j == joint { beyond_rad } else { from[j] });
        let stop = format!("the stop of {} at {angle_rad:.4} rad", self.robot.sensors[joint].joint);
        if let Some(nearest) =
            self.clearance.find_violation_along(&Edge::at_full_speed(from, to), &self.bounds, self.margin_m())
        {
            return self.driver.log(LogLevel::Warn, &format!("{stop} is not driven to: {nearest} may come too near"));
        }
        self.driver.phase(Phase::Move)?;
        self.driver.follow_unmonitored(&Path::at_full_speed(vec![from, to]))?;
        self.driver.phase(Phase::Settle)?;
        if self.driver.press(joint)? {
            self.driver.phase(Phase::Capture)?;
            self.driver.dwell(dwell_s, MarkKind::Stop { joint_idx: joint as u32, angle_rad })?;
        } else {
            self.driver.log(LogLevel::Warn, &format!("{stop} is left out: the arm did not come to rest"))?;
        }
        self.driver.phase(Phase::Move)?;
        self.driver.follow_unmonitored(&Path::at_full_speed(vec![to, from]))?;
        if !self.driver.settle()? {
            self.driver.log(LogLevel::Warn, &format!("the arm did not settle after {stop}"))?;
        }
        Ok(())
    }
}
