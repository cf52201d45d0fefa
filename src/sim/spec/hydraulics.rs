//! `[world.hydraulics]`.

use std::ops::RangeInclusive;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::spec::table::{CheckedTable, DEG, table};
use armcal_core::robot::FileIssue;

table!(
    /// Valves, oil, pump, friction, end stops, and the arm's own controller. Torque limits come from the URDF's effort.
    #[derive(Copy)]
    HydraulicsSpec {
        /// Share of the spool's travel that passes no oil; the controller compensates it. Proportional valves have 2 to
        /// 5 %.
        deadband = 0.03, in 0.0..=0.5;
        /// Time constant of the spool; 20 to 80 ms for the valves of such arms.
        valve_lag_s = 0.05, in 1e-3..=1.0;
        /// Backlash of the spool over its travel, full width; 0 for none. A valve with twice the deadband or more never
        /// closes.
        spool_hysteresis = 0.0, in 0.0..=0.2;
        /// Flow of the pump, shared by all joints. Titan 4's datasheet: 5.7 to 19 L/min.
        pump_flow_l_min = 12.0, in 0.1..=1000.0;
        /// Supply pressure: 3000 psi, the datasheets' upper end.
        supply_pressure_pa = 2.07e7, in 1e5..=1e8;
        /// Effective bulk modulus of oil, hoses and entrained air. Assumed.
        bulk_modulus_pa = 1.0e9, in 1e7..=1e11;
        /// Volume of oil between valve and actuator over the actuator's own. Assumed.
        dead_volume_ratio = 2.0, in 0.0..=100.0;
        /// Damping of the oil column over its stiffness. Assumed.
        damping_s = 0.01, in 0.0..=1.0;
        /// Creep of a closed valve under the full torque. Locked valves have 5e-5, leaky ones 5e-3 rad/s.
        leakage_rad_s = 0.0, in 0.0..=1.0;
        /// Multiple of the full torque at which relief valves open. Assumed.
        relief_ratio = 1.2, in 1.0..=10.0;
        /// Rate of a fully open valve without load, over the controller's rate limit. Assumed.
        rate_margin = 1.3, in 1.0..=10.0;
        /// Dry friction of a fast joint over its full torque; 0 for none. Assumed: seals of cylinders have a few
        /// percent.
        coulomb_friction_ratio = COULOMB_FRICTION_RATIO, in 0.0..=0.5;
        /// Dry friction at breakaway over the full torque; at least `coulomb_friction_ratio` counts. Assumed.
        stiction_ratio = STICTION_RATIO, in 0.0..=0.5;
        /// Sliding rate at which the friction has fallen from breakaway by 63 % of the difference. Assumed.
        stribeck_rate_rad_s = 0.05, in 1e-4..=10.0;
        /// Displacement of a joint before it breaks away. Assumed: 0.1 mm of a seal's rubber on a lever of 0.1 m.
        presliding_rad = 1e-3, in 1e-5..=0.1;
        /// Damping of the seals before they break away, over their stiffness. Assumed equal to the oil's.
        presliding_damping_s = 0.01, in 0.0..=1.0;
        /// Stiffness of the stops at the ends of a joint's range; 0: none, the piston stops there in its oil. Assumed.
        end_stop_stiffness_n_m_rad = 1e6, in 0.0..=1e8;
        /// Commanded rate per error; 2 to 6 per second.
        controller_gain_per_s = 4.0, in 0.1..=50.0;
        /// Time constant of the low-pass filter on the controller's readings.
        controller_filter_s = 0.05, in 0.0..=1.0;
        /// Error below which the controller closes the valve; it opens it again at twice this error.
        rest_band_rad = 0.02 * DEG, in 1e-6..=0.1;
        /// Rate at which the controller learns to hold a joint that creeps, over its gain; 0: it does not.
        controller_creep_gain = 0.5, in 0.0..=1.0;
        /// Constant error of the controller: it drives each sensor to its set-point plus this, by the datasheet's
        /// scale.
        controller_bias_rad = 0.0, in -0.5..=0.5;
        /// Largest number of consecutive readings that the controller rejects because the joint cannot have reached
        /// them; 0: it accepts all.
        controller_jump_reject = 10.0, in 0.0..=1000.0;
    }
);

/// Dry friction of the standard world; zeros switch it off.
const COULOMB_FRICTION_RATIO: f64 = 0.015;
const STICTION_RATIO: f64 = 0.02;
