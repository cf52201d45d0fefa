//! All actuators and their pump.

use crate::dynamics::JointLoad;
use crate::hydraulics::actuator::Actuator;
use crate::hydraulics::actuator_input::ActuatorInput;
use crate::spec::HydraulicsSpec;
use armcal_core::streams::{JointAngles, MAX_JOINTS};

/// All drives and the pump.
#[derive(Clone, Debug)]
pub(crate) struct Hydraulics {
    pump_flow_m3_s: f64,
    /// Pressure and flow of the pump over the nominal ones.
    pump_ratio: f64,
    pub(super) actuators: Vec<Actuator>,
    heat_w: f64,
    pub(super) step_s: f64,
}

impl Hydraulics {
    pub(crate) fn new(spec: &HydraulicsSpec, inputs: &[ActuatorInput], step_s: f64) -> Self {
        Self {
            pump_flow_m3_s: spec.pump_flow_l_min / 60_000.0,
            pump_ratio: 1.0,
            actuators: inputs.iter().map(|input| Actuator::new(spec, input, step_s)).collect(),
            heat_w: 0.0,
            step_s,
        }
    }

    /// Returns the longest step in which the valves' flow can follow the torque that it causes. The load changes the
    /// rate of a fully open valve by `rate_max/(2 tau_max)` per N m. The piston's motion changes the load by K per rad.
    /// This coupling is not implicit.
    pub(crate) fn longest_step_s(&self) -> f64 {
        let relaxation = |a: &Actuator| 2.0 * a.torque_max_n_m / (a.stiffness_n_m_rad * a.rate_max_rad_s);
        0.5 * self.actuators.iter().map(relaxation).fold(f64::INFINITY, f64::min)
    }

    /// Places the pistons so that the columns carry `-torques` at `angles`, at rest and without friction's help.
    pub(crate) fn balance(&mut self, angles: &JointAngles, torques: &JointAngles) {
        for (j, actuator) in self.actuators.iter_mut().enumerate() {
            actuator.balance(angles[j], torques[j]);
        }
    }

    /// Moves spools, pistons and friction by one step from the joints' state at its start; `commands` are -1..1.
    pub(crate) fn step(&mut self, commands: &[f64; MAX_JOINTS], angles: &JointAngles, rates: &JointAngles) {
        let mut flow_m3_s = 0.0;
        for (j, actuator) in self.actuators.iter_mut().enumerate() {
            flow_m3_s += actuator.ask(commands[j], self.pump_ratio, angles[j]);
        }
        // One pump feeds all valves: if they ask for more than it gives, each gets its share.
        let pump_m3_s = self.pump_flow_m3_s * self.pump_ratio;
        let share = if flow_m3_s > pump_m3_s { pump_m3_s / flow_m3_s } else { 1.0 };
        self.heat_w = 0.0;
        for (j, actuator) in self.actuators.iter_mut().enumerate() {
            actuator.advance(share, self.step_s, angles[j], rates[j]);
            self.heat_w += actuator.heat_w(self.pump_ratio);
        }
    }

    /// Returns the load about joint `joint` during the coming step: oil column, friction and end stop.
    pub(crate) fn load(&self, joint: usize) -> JointLoad {
        self.actuators[joint].load
    }

    /// Returns the torque that each oil column puts on its joint, N m.
    pub(crate) fn torques(&self, angles: &JointAngles, rates: &JointAngles) -> JointAngles {
        JointAngles::from_fn(self.actuators.len(), |j| self.actuators[j].column_torque_n_m(angles[j], rates[j]))
    }

    /// Returns the power that warmed the oil during the last step, W. It is that of the pump's oil, supply pressure
    /// times the flow over the valves, less that of the pistons. It is lost in the valves, in leaks and over the relief
    /// valves; a sinking load adds its own. The pump is assumed to give no more oil than is asked.
    pub(crate) fn power_w(&self) -> f64 {
        self.heat_w
    }

    /// Locks joint `joint`: its valve shuts for good and its piston stops.
    pub(crate) fn lock(&mut self, joint: usize) {
        self.actuators[joint].is_locked = true;
    }

    /// Limits the hose of joint `joint` to `ratio` (0..1) of its pressure. The valve's head falls, and so does the load
    /// that the closed column can carry. At 0 both ports are open: only friction and end stops act about the joint.
    pub(crate) fn lose_pressure(&mut self, joint: usize, ratio: f64) {
        self.actuators[joint].hose_ratio = ratio.clamp(0.0, 1.0);
    }

    /// Limits the pump to `ratio` (0..1) of its pressure and flow. Closed columns continue to carry their loads.
    pub(crate) fn lose_pump(&mut self, ratio: f64) {
        self.pump_ratio = ratio.clamp(0.0, 1.0);
    }
}
