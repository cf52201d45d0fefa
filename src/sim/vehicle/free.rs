//! Vehicle that floats free: its body for the equations of motion, and the thrusters for station keeping.

use armcal_core::codes::Code;
use nalgebra::{Isometry3, Matrix3, Vector3};

use crate::dynamics::{Body, Force, HullDrag, Inertia, Motion};
use crate::error::SimError;
use crate::fault::Impulse;
use crate::spec::{GroundSpec, MotionKind, VehicleMotionSpec, WaterSpec};
use crate::vehicle::base_state::BaseState;
use crate::vehicle::ground::Ground;
use crate::vehicle::sinusoids::{SinusoidSum, draw_sinusoids, evaluate};
use armcal_core::kinematics::LinkPoses;
use armcal_core::robot::{FileIssue, GRAVITY_M_S2, Vehicle, VehicleDynamics};

/// Duration of an impulse, s: short against the vehicle's motion, long against a step.
const IMPULSE_DURATION_S: f64 = 0.1;

/// Thrusters and external forces of the vehicle, except those of the water through which it moves.
#[derive(Clone, Debug)]
pub(crate) struct FreeVehicle {
    spec: VehicleMotionSpec,
    dynamics: VehicleDynamics,
    base_from_vehicle: Isometry3<f64>,
    /// Mass and inertia that the controller assumes, including added mass, vehicle axes: linear, then angular.
    reckoned: [f64; 6],
    integral: [f64; 6],
    /// Actual thrust and moment, after the thrusters' lag, vehicle axes.
    thrust: [f64; 6],
    /// Random forces and moments, in the band of the motion's periods.
    disturbance: [SinusoidSum; 6],
    impulse: Option<(f64, Impulse)>,
    ground: Option<Ground>,
}

impl FreeVehicle {
    /// Builds the vehicle.
    ///
    /// # Errors
    /// [`SimError::Spec`] for a vehicle without `[dynamics]`.
    pub(crate) fn new(vehicle: &Vehicle, spec: &VehicleMotionSpec, seed: u64) -> Result<Self, SimError> {
        let Some(dynamics) = vehicle.dynamics else {
            let problem = "is needed for a vehicle that floats free ([world.vehicle] motion = \"free\")";
            return Err(FileIssue::new(Code::KeyMissing, &vehicle.file, "dynamics", problem).into());
        };
        let linear = dynamics.added_mass_kg.map(|added| vehicle.mass_kg + added);
        let angular: [f64; 3] = std::array::from_fn(|i| dynamics.inertia_kg_m2[i] + dynamics.added_inertia_kg_m2[i]);
        Ok(Self {
            spec: spec.clone(),
            dynamics,
            base_from_vehicle: *vehicle.vehicle_from_base.inverse().isometry(),
            reckoned: std::array::from_fn(|i| if i < 3 { linear[i] } else { angular[i - 3] }),
            integral: [0.0; 6],
            thrust: [0.0; 6],
            disturbance: std::array::from_fn(|axis| {
                let rms = if axis < 3 { spec.disturbance_force_rms_n } else { spec.disturbance_moment_rms_n_m };
                draw_sinusoids(spec, rms, seed, &format!("wobble/{axis}"))
            }),
            impulse: None,
            ground: None,
        })
    }

    /// Returns the vehicle as body 0 of the system, ballasted so that it floats level with the arm in its present
    /// configuration. Its displacement carries vehicle and arm, and the centre of buoyancy is above the common centre
    /// of weight.
    pub(crate) fn body(&self, vehicle: &Vehicle, water: &WaterSpec, poses: &LinkPoses, links: &[Body]) -> Body {
        let d = &self.dynamics;
        let to_base = &self.base_from_vehicle;
        let diagonal = |v: &[f64; 3]| Matrix3::from_diagonal(&Vector3::from(*v));
        let rigid = Inertia::rigid(vehicle.mass_kg, &Vector3::zeros(), &diagonal(&d.inertia_kg_m2)).placed(to_base);
        let is_wet = water.density_kg_m3 > 0.0;
        let mut body = Body::dry(vehicle.mass_kg, to_base.translation.vector, &Matrix3::zeros());
        body.rigid = rigid;
        if !is_wet {
            return body;
        }
        let added = Inertia {
            rotational: diagonal(&d.added_inertia_kg_m2),
            coupling: Matrix3::zeros(),
            linear: diagonal(&d.added_mass_kg),
        };
        body.added = added.placed(to_base);
        body.hull = Some(HullDrag { base_from_hull: *to_base, linear: d.drag_linear, quadratic: d.drag_quadratic });
        let (weight, moment) = wet_weight(poses, links);
        let down = to_base.rotation * -Vector3::z();
        body.displaced_kg = vehicle.mass_kg + weight;
        // The vehicle is level if the moments of all weights (the vehicle's own at its origin) and of the buoyancy
        // balance about the base.
        let weights = moment + vehicle.mass_kg * body.com_m;
        let above = to_base.rotation * Vector3::new(0.0, 0.0, d.center_of_buoyancy_m[2]);
        let center = weights / body.displaced_kg;
        body.center_of_buoyancy_m = center - down * down.dot(&(center - body.com_m)) + above;
        body
    }

    /// Reduces the buoyancy of `body`, the vehicle's, and puts ground below it. A parked vehicle has sunk into the
    /// ground; otherwise the ground is the seafloor, if there is one.
    ///
    /// # Errors
    /// [`SimError::Spec`] where a parked vehicle's weight is not above its lowest corners.
    pub(crate) fn put_on_ground(
        &mut self,
        spec: &GroundSpec,
        vehicle: &Vehicle,
        seafloor_z_m: Option<f64>,
        body: &mut Body,
    ) -> Result<(), SimError> {
        body.displaced_kg -= spec.vehicle_weight_n / GRAVITY_M_S2;
        if self.spec.motion != MotionKind::Parked {
            self.ground = seafloor_z_m.map(|z_m| Ground::plane(spec, vehicle, z_m));
            return Ok(());
        }
        self.spec.station_keeping_rad_s = 0.0;
        let center_m = self.base_from_vehicle.inverse_transform_point(&body.center_of_buoyancy_m.into()).coords;
        self.ground = Ground::parked(spec, vehicle, &center_m);
        if self.ground.is_none() {
            let problem = "its weight is not above the lowest corners of its parts: it cannot be parked on them";
            return Err(FileIssue::new(Code::ValueInvalid, &vehicle.file, "part", problem).into());
        }
        Ok(())
    }

    /// Returns the load that the ground carries, N.
    #[cfg(test)]
    pub(crate) fn ground_load_n(&self) -> f64 {
        self.ground.as_ref().map_or(0.0, |ground| ground.load_n)
    }

    /// Starts an impulse on the vehicle.
    pub(crate) fn impulse(&mut self, t_s: f64, impulse: &Impulse) {
        self.impulse = Some((t_s, *impulse));
    }

    /// Returns the force on the vehicle in the step from `t_s`, about the base's origin in base axes.
    pub(crate) fn force(&mut self, t_s: f64, step_s: f64, base: &BaseState) -> Force {
        self.keep_station(step_s, base);
        let mut total = self.thrust;
        for (slot, axis) in total.iter_mut().zip(&self.disturbance) {
            *slot += evaluate(axis, t_s)[0];
        }
        if let Some((start_s, impulse)) = &self.impulse {
            let since = t_s - start_s;
            if (0.0..IMPULSE_DURATION_S).contains(&since) {
                // Half a sine, whose mean is 2/pi of its height.
                let shape = (std::f64::consts::PI * since / IMPULSE_DURATION_S).sin() * std::f64::consts::FRAC_PI_2
                    / IMPULSE_DURATION_S;
                for i in 0..3 {
                    total[i] += shape * impulse.impulse_n_s[i];
                    total[3 + i] += shape * impulse.angular_impulse_n_m_s[i];
                }
            }
        }
        let to_base = &self.base_from_vehicle;
        let force = to_base.rotation * Vector3::from_column_slice(&total[..3]);
        let moment = to_base.rotation * Vector3::from_column_slice(&total[3..]);
        let on_ground = self.ground.as_mut().map_or_else(Force::zero, |ground| ground.force(base));
        Force::new(moment + to_base.translation.vector.cross(&force), force) + on_ground
    }

    /// Controls position and attitude by a PID, as dynamic positioning does, with the thrusters' lag and limits. It
    /// knows the true pose.
    fn keep_station(&mut self, step_s: f64, base: &BaseState) {
        let w = self.spec.station_keeping_rad_s;
        if w == 0.0 {
            return;
        }
        let pose = &base.world_from_vehicle;
        let to_vehicle = pose.rotation().inverse();
        // Velocity of the vehicle's origin, in its own axes.
        let at_base = Motion::new(base.angular_velocity, base.velocity).at(&self.base_from_vehicle.translation.vector);
        let velocity = self.base_from_vehicle.rotation.inverse() * at_base;
        let away = to_vehicle * pose.origin().vector();
        let turned = pose.rotation().scaled_axis();
        let lag = 1.0 - (-step_s / self.spec.thruster_lag_s.max(step_s)).exp();
        for i in 0..6 {
            let (error, rate, limit) = if i < 3 {
                (-away[i], velocity[i], self.dynamics.thrust_max_n[i])
            } else {
                (-turned[i - 3], base.vehicle_rate[i - 3], self.dynamics.moment_max_n_m[i - 3])
            };
            let m = self.reckoned[i];
            // About an axis without thrusters, the buoyancy alone rights the vehicle.
            let wanted = m * (w * w * error - 2.0 * self.spec.station_damping_ratio * w * rate + self.integral[i]);
            let given = wanted.clamp(-limit, limit);
            if given == wanted {
                self.integral[i] += 0.1 * w * w * w * error * step_s;
            }
            self.thrust[i] += (given - self.thrust[i]) * lag;
        }
    }
}

/// Returns the wet mass of the arm, kg, and its first moment about the base's origin, kg m.
fn wet_weight(poses: &LinkPoses, links: &[Body]) -> (f64, Vector3<f64>) {
    let (mut mass, mut moment) = (0.0, Vector3::zeros());
    for (i, body) in links.iter().enumerate().skip(1) {
        let place = poses.link(i);
        let at = |p: &Vector3<f64>| place.rotation * p + place.translation.vector;
        mass += body.mass_kg - body.displaced_kg;
        moment += body.mass_kg * at(&body.com_m) - body.displaced_kg * at(&body.center_of_buoyancy_m);
    }
    (mass, moment)
}
