//! Work: a target of the task at intervals, tags that are passed on the way, and rest in between.

use crate::session::SessionError;
use crate::session::outcome::SkippedTarget;
use crate::session::reach::REACH_DWELL_S;
use crate::session::runner::ScriptRunner;
use armcal_core::routine::{WorkBelief, WorkSettings};
use armcal_core::streams::{ImageDemand, JointAngles, LogLevel, MarkKind, Phase};
use armcal_core::time::Stamp;

impl ScriptRunner<'_, '_> {
    /// Runs the tasks: each begins at its time, or as soon as the one before has ended. The step lasts as long as all
    /// of them.
    pub(crate) fn work(&mut self, step: usize, settings: &WorkSettings) -> Result<(), SessionError> {
        let wrong = |problem: String| SessionError::Step { step, problem };
        let rest = self.goal(&settings.rest).map_err(wrong)?;
        let start = self.driver.now();
        if settings.belief == WorkBelief::Online {
            self.begin_online()?;
        }
        self.driver.limit_rates(settings.rate_rad_s);
        self.leave_for(&rest)?;
        for number in 0..settings.tasks {
            self.progress_at(Phase::Reach, number as usize, settings.tasks as usize);
            self.idle_until(start.plus_s(f64::from(number) * settings.every_s))?;
            self.age();
            self.take_up_failures();
            self.driver.arm.request_images(ImageDemand::All);
            let is_known = match settings.belief {
                WorkBelief::Online => self.keep_up(settings, number, &rest)?,
                WorkBelief::Calibration => Ok(()),
            };
            match is_known {
                Ok(()) => self.task(step, settings, [number, settings.tasks], &rest)?,
                Err(reason) => self.skip(SkippedTarget { step, target: settings.target_of(number), reason })?,
            }
            self.leave_for(&rest)?;
            self.driver.arm.request_images(ImageDemand::Few);
        }
        self.idle_until(start.plus_s(settings.duration_s()))?;
        self.driver.limit_rates(None);
        Ok(())
    }

    /// Moves to a target, by tags if it is this task's turn, and rests there for a moment. Of all configurations at the
    /// target it takes one near that between tasks.
    fn task(
        &mut self,
        step: usize,
        settings: &WorkSettings,
        [number, of]: [u32; 2],
        rest: &JointAngles,
    ) -> Result<(), SessionError> {
        let target = settings.target_of(number);
        let look = settings.look_of(number);
        let by = look.map_or(String::new(), |look| format!(" by look {}", look + 1));
        self.driver.log(LogLevel::Info, &format!("work: task {} of {of}, target {}{by}", number + 1, target + 1))?;
        self.driver.phase(Phase::Reach)?;
        if let Some(look) = look {
            self.look(&JointAngles::from_slice(&settings.looks_rad[look]), settings.look_s)?;
            self.take_up_news()?;
        }
        let attempt = self.attempt();
        let postures = self.postures_near(&[target], &[*rest])?;
        self.warn_beyond(&postures)?;
        match self.arrive(&postures[0])? {
            Ok(()) => {
                let kind = MarkKind::Reach { attempt, target_idx: target as u32 };
                self.driver.dwell(REACH_DWELL_S, kind)?;
                self.driver.arm.request_images(ImageDemand::All);
                Ok(())
            }
            Err(reason) => self.skip(SkippedTarget { step, target, reason }),
        }
    }

    /// Passes a configuration with tags in view, or stays there for `seconds`.
    fn look(&mut self, at: &JointAngles, seconds: f64) -> Result<(), SessionError> {
        if seconds > 0.0 {
            return match self.arrive(&Ok(*at))? {
                Ok(()) => self.driver.hold(seconds),
                Err(reason) => self.driver.log(LogLevel::Warn, &format!("a look is left out: {reason}")),
            };
        }
        // The log names the obstacle.
        self.go(at).map(drop)
    }

    /// Moves to the rest configuration; if no path leads there, the arm stays.
    fn leave_for(&mut self, rest: &JointAngles) -> Result<(), SessionError> {
        self.driver.phase(Phase::Move)?;
        match self.arrive(&Ok(*rest))? {
            Ok(()) => Ok(()),
            Err(reason) => self.driver.log(LogLevel::Warn, &format!("the arm rests where it is: {reason}")),
        }
    }

    fn idle_until(&mut self, then: Stamp) -> Result<(), SessionError> {
        let seconds = then.since_s(self.driver.now());
        if seconds <= 0.0 {
            return Ok(());
        }
        self.driver.phase(Phase::Wait)?;
        self.driver.wait(seconds)
    }
}
