//! Valves, pump and oil columns: from the controller's command to the piston's place.
//!
//! `rate = u qmax sqrt(max(0, 1 - sgn(u) tau / tau_max))` behind deadband and a first-order lag; the joints share the
//! pump's flow; the piston meets the joint through oil of stiffness `4 beta D^2 / V`, where D = tau_max / Ps is the
//! displacement (m3/rad) and V the oil between valve and piston. A relief valve lets the piston yield above its torque.

use super::physics::Column;
use super::spec::HydraulicsSpec;
use crate::kinematics::JointLimits;
use crate::streams::{JointAngles, MAX_JOINTS};

/// The drive of one joint.
#[derive(Clone, Copy, Debug)]
pub(super) struct Actuator {
    pub limits: Option<JointLimits>,
    pub torque_max_n_m: f64,
    /// Of a fully open valve without load.
    pub rate_max_rad_s: f64,
    pub stiffness_n_m_rad: f64,
    displacement_m3_rad: f64,
    /// Spool position, -1..1.
    spool: f64,
    /// Where the joint would be if oil were stiff.
    pub piston_rad: f64,
    pub piston_rate_rad_s: f64,
}

/// All drives and the pump.
#[derive(Clone, Debug)]
pub(super) struct Hydraulics {
    spec: HydraulicsSpec,
    pub actuators: Vec<Actuator>,
    /// Share of the lag that a spool covers in one step.
    lag_share: f64,
    step_s: f64,
}

/// What a drive is built from.
#[derive(Clone, Copy, Debug)]
pub(super) struct ActuatorInput {
    pub limits: Option<JointLimits>,
    pub torque_max_n_m: f64,
    /// The controller's rate limit.
    pub rate_limit_rad_s: f64,
}

impl Hydraulics {
    pub(super) fn new(spec: &HydraulicsSpec, inputs: &[ActuatorInput], step_s: f64) -> Self {
        let actuators = inputs.iter().map(|input| Actuator::new(spec, input)).collect();
        Self { spec: *spec, actuators, lag_share: 1.0 - (-step_s / spec.valve_lag_s).exp(), step_s }
    }

    /// Damping of each oil column, N m s/rad.
    pub(super) fn damping(&self) -> [f64; MAX_JOINTS] {
        let mut damping = [0.0; MAX_JOINTS];
        for (slot, actuator) in damping.iter_mut().zip(&self.actuators) {
            *slot = self.spec.damping_s * actuator.stiffness_n_m_rad;
        }
        damping
    }

    /// Places the pistons so that the columns carry `-torques` at `angles`.
    pub(super) fn balance(&mut self, angles: &JointAngles, torques: &JointAngles) {
        for (j, actuator) in self.actuators.iter_mut().enumerate() {
            actuator.piston_rad = angles[j] - torques[j] / actuator.stiffness_n_m_rad;
        }
    }

    /// The torque that each column puts on its joint, N m.
    pub(super) fn torques(&self, angles: &JointAngles) -> JointAngles {
        JointAngles::from_fn(self.actuators.len(), |j| self.actuators[j].torque_n_m(angles[j]))
    }

    /// Moves spools and pistons by one step; `commands` are -1..1.
    pub(super) fn step(&mut self, commands: &[f64; MAX_JOINTS], angles: &JointAngles) {
        let mut flow_m3_s = 0.0;
        for (j, actuator) in self.actuators.iter_mut().enumerate() {
            actuator.spool += (commands[j].clamp(-1.0, 1.0) - actuator.spool) * self.lag_share;
            let torque = actuator.torque_n_m(angles[j]);
            actuator.piston_rate_rad_s = actuator.valve_rate(self.spec.deadband, torque);
            flow_m3_s += actuator.displacement_m3_rad * actuator.piston_rate_rad_s.abs();
        }
        // One pump feeds all: when they ask for more, each gets its share.
        let pump_m3_s = self.spec.pump_flow_l_min / 60_000.0;
        let share = if flow_m3_s > pump_m3_s { pump_m3_s / flow_m3_s } else { 1.0 };
        for (j, actuator) in self.actuators.iter_mut().enumerate() {
            let torque = actuator.torque_n_m(angles[j]);
            let leak = self.spec.leakage_rad_s * torque / actuator.torque_max_n_m;
            actuator.piston_rate_rad_s = actuator.piston_rate_rad_s * share - leak;
            actuator.advance(self.step_s, angles[j], self.spec.relief_ratio);
        }
    }

    /// The spring that the physics sees. Its damping acts on the joint's rate alone, so that the rest place moves ahead
    /// by what the piston's rate would give: `k (x - q) + c (dx - dq)`.
    pub(super) fn column(&self, joint: usize) -> Column {
        let actuator = &self.actuators[joint];
        Column {
            stiffness_n_m_rad: actuator.stiffness_n_m_rad,
            rest_rad: actuator.piston_rad + self.spec.damping_s * actuator.piston_rate_rad_s,
        }
    }
}

impl Actuator {
    fn new(spec: &HydraulicsSpec, input: &ActuatorInput) -> Self {
        let displacement_m3_rad = input.torque_max_n_m / spec.supply_pressure_pa;
        let range_rad = input.limits.map_or(std::f64::consts::TAU, |l| l.upper_rad - l.lower_rad);
        let volume_m3 = displacement_m3_rad * range_rad * (1.0 + spec.dead_volume_ratio);
        Self {
            limits: input.limits,
            torque_max_n_m: input.torque_max_n_m,
            rate_max_rad_s: input.rate_limit_rad_s * spec.rate_margin,
            stiffness_n_m_rad: 4.0 * spec.bulk_modulus_pa * displacement_m3_rad * displacement_m3_rad / volume_m3,
            displacement_m3_rad,
            spool: 0.0,
            piston_rad: 0.0,
            piston_rate_rad_s: 0.0,
        }
    }

    fn torque_n_m(&self, angle_rad: f64) -> f64 {
        self.stiffness_n_m_rad * (self.piston_rad - angle_rad)
    }

    /// Rate of the piston for the spool's place under `torque_n_m`, before the pump's limit.
    fn valve_rate(&self, deadband: f64, torque_n_m: f64) -> f64 {
        let open = (self.spool.abs() - deadband).max(0.0) / (1.0 - deadband);
        let sign = self.spool.signum();
        let head = (1.0 - sign * torque_n_m / self.torque_max_n_m).max(0.0);
        sign * open * self.rate_max_rad_s * head.sqrt()
    }

    /// Moves the piston, within the end stops and the relief valve's torque.
    fn advance(&mut self, step_s: f64, angle_rad: f64, relief_ratio: f64) {
        let slack = relief_ratio * self.torque_max_n_m / self.stiffness_n_m_rad;
        let mut next = self.piston_rad + self.piston_rate_rad_s * step_s;
        if let Some(limits) = self.limits {
            next = next.clamp(limits.lower_rad, limits.upper_rad);
        }
        next = next.clamp(angle_rad - slack, angle_rad + slack);
        self.piston_rate_rad_s = (next - self.piston_rad) / step_s;
        self.piston_rad = next;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drive() -> Hydraulics {
        let limits = Some(JointLimits { lower_rad: -1.0, upper_rad: 1.0 });
        let input = ActuatorInput { limits, torque_max_n_m: 2000.0, rate_limit_rad_s: 0.5 };
        Hydraulics::new(&HydraulicsSpec::default(), &[input], 0.001)
    }

    fn command(u: f64) -> [f64; MAX_JOINTS] {
        [u; MAX_JOINTS]
    }

    /// Runs without inertia: the joint follows its piston under a constant torque.
    fn rate_under(u: f64, torque: f64) -> f64 {
        let mut drive = drive();
        for _ in 0..1000 {
            let angle = drive.actuators[0].piston_rad - torque / drive.actuators[0].stiffness_n_m_rad;
            drive.step(&command(u), &JointAngles::from_slice(&[angle]));
        }
        drive.actuators[0].piston_rate_rad_s
    }

    #[test]
    fn the_valve_follows_its_equation() {
        let open = (0.5 - 0.03) / 0.97 * 0.5 * 1.3;
        assert!((rate_under(0.5, 0.0) - open).abs() < 1e-6);
        assert!((rate_under(0.5, 1000.0) - open * 0.5_f64.sqrt()).abs() < 1e-6);
        assert!((rate_under(-0.5, 1000.0) + open * 1.5_f64.sqrt()).abs() < 1e-6);
        assert_eq!(rate_under(0.5, 2200.0), 0.0, "it stalls");
        assert_eq!(rate_under(0.029, 0.0), 0.0, "the deadband passes nothing");
    }

    #[test]
    fn the_piston_stops_at_the_end_and_yields_above_relief() {
        let mut drive = drive();
        for _ in 0..20_000 {
            drive.step(&command(1.0), &JointAngles::from_slice(&[drive.actuators[0].piston_rad]));
        }
        assert_eq!(drive.actuators[0].piston_rad, 1.0);
        drive.step(&command(0.0), &JointAngles::from_slice(&[0.5]));
        let torque = drive.torques(&JointAngles::from_slice(&[0.5]))[0];
        assert!((torque - 2400.0).abs() < 1e-6, "{torque}");
    }

    #[test]
    fn oil_is_about_as_stiff_as_published() {
        // 8e4 N m/rad for a shoulder of 2 to 3 kN m.
        let stiffness = drive().actuators[0].stiffness_n_m_rad;
        assert!((4e4..1.6e5).contains(&stiffness), "{stiffness}");
    }
}
