//! One joint's actuator: piston, oil column, relief valve, friction and end stops.

use crate::dynamics::JointLoad;
use crate::hydraulics::actuator_input::ActuatorInput;
use crate::hydraulics::end_stop::EndStop;
use crate::hydraulics::friction::Friction;
use crate::hydraulics::valve::Valve;
use crate::spec::HydraulicsSpec;
use armcal_core::kinematics::JointLimits;

/// Drive of one joint.
#[derive(Clone, Copy, Debug)]
pub(super) struct Actuator {
    /// Ends of the piston's stroke; a joint with end stops stops there, too.
    limits: Option<JointLimits>,
    pub(super) torque_max_n_m: f64,
    /// Rate of a fully open valve without load.
    pub(super) rate_max_rad_s: f64,
    pub(super) stiffness_n_m_rad: f64,
    damping_n_m_s_rad: f64,
    pub(super) displacement_m3_rad: f64,
    /// Creep of the closed valve per torque, rad/s per N m.
    leakage_rad_s_n_m: f64,
    relief_n_m: f64,
    valve: Valve,
    friction: Friction,
    end_stop: EndStop,
    /// Position of the joint with incompressible oil.
    pub(super) piston_rad: f64,
    pub(super) piston_rate_rad_s: f64,
    /// Torque of the oil's pressure at the start of the last step.
    torque_before_n_m: f64,
    /// Torque of the oil's pressure in the middle of the step.
    middle_n_m: f64,
    /// Rate that the valve's oil gives the piston.
    pub(super) valve_rate_rad_s: f64,
    /// Share of the supply pressure that the joint's hose holds.
    pub(super) hose_ratio: f64,
    pub(super) is_locked: bool,
    /// Load of the oil column during the coming step; `load` is the sum with friction and end stop.
    pub(super) column: JointLoad,
    pub(super) load: JointLoad,
}

impl Actuator {
    pub(super) fn new(spec: &HydraulicsSpec, input: &ActuatorInput, step_s: f64) -> Self {
        let displacement_m3_rad = input.torque_max_n_m / spec.supply_pressure_pa;
        let range_rad = input.limits.map_or(std::f64::consts::TAU, |l| l.upper_rad - l.lower_rad);
        let volume_m3 = displacement_m3_rad * range_rad * (1.0 + spec.dead_volume_ratio);
        let stiffness_n_m_rad = 4.0 * spec.bulk_modulus_pa * displacement_m3_rad * displacement_m3_rad / volume_m3;
        let end_stop = EndStop::new(spec, input.limits);
        Self {
            limits: input.limits.filter(|_| !end_stop.is_on()),
            torque_max_n_m: input.torque_max_n_m,
            rate_max_rad_s: input.rate_limit_rad_s * spec.rate_margin,
            stiffness_n_m_rad,
            damping_n_m_s_rad: spec.damping_s * stiffness_n_m_rad,
            displacement_m3_rad,
            leakage_rad_s_n_m: spec.leakage_rad_s / input.torque_max_n_m,
            relief_n_m: spec.relief_ratio * input.torque_max_n_m,
            valve: Valve::new(spec, step_s),
            friction: Friction::new(spec, input.torque_max_n_m),
            end_stop,
            piston_rad: 0.0,
            piston_rate_rad_s: 0.0,
            torque_before_n_m: 0.0,
            middle_n_m: 0.0,
            valve_rate_rad_s: 0.0,
            hose_ratio: 1.0,
            is_locked: false,
            column: JointLoad::default(),
            load: JointLoad::default(),
        }
    }

    /// Starts at rest at `angle_rad` with the column carrying `-torque_n_m`.
    pub(super) fn balance(&mut self, angle_rad: f64, torque_n_m: f64) {
        self.piston_rad = angle_rad - torque_n_m / self.stiffness_n_m_rad;
        self.piston_rate_rad_s = 0.0;
        self.torque_before_n_m = -torque_n_m;
        self.friction.settle(angle_rad);
        self.column = JointLoad::spring(self.stiffness_n_m_rad, self.damping_n_m_s_rad, self.piston_rad, 0.0);
        self.load = self.column + self.friction.load();
    }

    /// Returns the torque of the oil's pressure only, N m.
    pub(super) fn torque_n_m(&self, angle_rad: f64) -> f64 {
        self.stiffness_n_m_rad * (self.piston_rad - angle_rad)
    }

    /// Returns the torque of the whole column, N m.
    pub(super) fn column_torque_n_m(&self, angle_rad: f64, rate_rad_s: f64) -> f64 {
        if self.column.stiffness_n_m_rad == 0.0 {
            // The column yields.
            return self.column.constant_n_m;
        }
        self.torque_n_m(angle_rad) + self.damping_n_m_s_rad * (self.piston_rate_rad_s - rate_rad_s)
    }

    /// Moves the spool and returns the flow that it asks of the pump, m3/s. `head_ratio` is the pump's pressure over
    /// the nominal one. The load at the middle of the step is extrapolated from the last two starts.
    pub(super) fn ask(&mut self, command: f64, head_ratio: f64, angle_rad: f64) -> f64 {
        let opening = self.valve.step(if self.is_locked { 0.0 } else { command });
        let torque_n_m = self.torque_n_m(angle_rad);
        self.middle_n_m = torque_n_m + 0.5 * (torque_n_m - self.torque_before_n_m);
        self.torque_before_n_m = torque_n_m;
        // A load check valve: an open valve lets no oil back to a pump that is too weak for the load.
        let head = (head_ratio * self.hose_ratio - opening.signum() * self.middle_n_m / self.torque_max_n_m).max(0.0);
        self.valve_rate_rad_s = if self.is_locked { 0.0 } else { opening * self.rate_max_rad_s * head.sqrt() };
        self.displacement_m3_rad * self.valve_rate_rad_s.abs()
    }

    /// Returns the power that warmed the oil in the last step, W: that of the pump's oil less that of the piston.
    pub(super) fn heat_w(&self, pump_ratio: f64) -> f64 {
        let supply_w = self.torque_max_n_m * pump_ratio * self.valve_rate_rad_s.abs();
        supply_w - self.middle_n_m * self.piston_rate_rad_s
    }

    /// Moves the piston by a step with the `share` of the asked oil that the pump gives. Then sets the loads about the
    /// joint during the step.
    pub(super) fn advance(&mut self, share: f64, step_s: f64, angle_rad: f64, rate_rad_s: f64) {
        let before_rad = self.piston_rad;
        let leak_rad_s = if self.is_locked { 0.0 } else { self.leakage_rad_s_n_m * self.middle_n_m };
        let free_rad = before_rad + (self.valve_rate_rad_s * share - leak_rad_s) * step_s;
        let mut next_rad = self.limits.map_or(free_rad, |l| {
            // A piston that was balanced beyond its end stays there.
            free_rad.clamp(l.lower_rad.min(before_rad), l.upper_rad.max(before_rad))
        });
        self.valve_rate_rad_s *= if next_rad == free_rad { share } else { 0.0 };
        let slip_rad_s = rate_rad_s - (next_rad - before_rad) / step_s;
        let is_yielding = self.relieve(&mut next_rad, angle_rad + rate_rad_s * step_s, slip_rad_s);
        self.piston_rate_rad_s = (next_rad - before_rad) / step_s;
        self.piston_rad = next_rad;
        if !is_yielding {
            // Mean position of the piston during the step.
            let middle_rad = next_rad - 0.5 * step_s * self.piston_rate_rad_s;
            let (stiffness, damping) = (self.stiffness_n_m_rad, self.damping_n_m_s_rad);
            self.column = JointLoad::spring(stiffness, damping, middle_rad, self.piston_rate_rad_s);
        }
        self.friction.step(angle_rad, rate_rad_s);
        self.load = self.column + self.friction.load() + self.end_stop.load(angle_rad, rate_rad_s);
    }

    /// Lets the piston yield if the relief valve, or a damaged hose, cannot hold the torque at the step's end
    /// (`angle_rad`). While the joint drives the piston (`slip_rad_s`, joint against piston), the column gives only the
    /// torque that can be held.
    fn relieve(&mut self, next_rad: &mut f64, angle_rad: f64, slip_rad_s: f64) -> bool {
        if self.is_locked {
            return false;
        }
        let hold_n_m = self.relief_n_m * self.hose_ratio;
        let slack_rad = hold_n_m / self.stiffness_n_m_rad;
        let ahead_rad = *next_rad - angle_rad;
        *next_rad = angle_rad + ahead_rad.clamp(-slack_rad, slack_rad);
        let is_yielding = hold_n_m == 0.0 || ahead_rad.abs() > slack_rad && ahead_rad * slip_rad_s < 0.0;
        if is_yielding {
            self.column = JointLoad { constant_n_m: hold_n_m.copysign(ahead_rad), ..JointLoad::default() };
        }
        is_yielding
    }
}
