//! Dry friction of one joint's seals and bearings, with true sticking.
//!
//! An elasto-plastic element (Prandtl's; Dupont, Hayward, Armstrong, Altpeter, IEEE Trans. Autom. Control 47, 2002). A
//! bristle is a spring about its anchor until it breaks away at the stiction torque. After that it drags its anchor
//! along at the sliding torque. Below breakaway it is only a spring, so that nothing can creep, under a steady or a
//! shaking load.

use crate::dynamics::JointLoad;
use crate::spec::HydraulicsSpec;

#[derive(Clone, Copy, Debug)]
pub(super) struct Friction {
    /// Torque at breakaway.
    stiction_n_m: f64,
    /// Torque in fast sliding.
    coulomb_n_m: f64,
    stribeck_rate_rad_s: f64,
    stiffness_n_m_rad: f64,
    damping_n_m_s_rad: f64,
    /// Damping in the coming step while the joint sticks.
    stuck_damping_n_m_s_rad: f64,
    /// Anchor of the bristle: its position without torque.
    anchor_rad: f64,
    slide: Slide,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Slide {
    Stuck,
    /// Slides in `direction`, 1 or -1, against `torque_n_m`.
    Sliding {
        direction: f64,
        torque_n_m: f64,
    },
}

impl Friction {
    pub(super) fn new(spec: &HydraulicsSpec, torque_max_n_m: f64) -> Self {
        let coulomb_n_m = spec.coulomb_friction_ratio * torque_max_n_m;
        let stiction_n_m = coulomb_n_m.max(spec.stiction_ratio * torque_max_n_m);
        let stiffness_n_m_rad = stiction_n_m / spec.presliding_rad;
        Self {
            stiction_n_m,
            coulomb_n_m,
            stribeck_rate_rad_s: spec.stribeck_rate_rad_s,
            stiffness_n_m_rad,
            damping_n_m_s_rad: spec.presliding_damping_s * stiffness_n_m_rad,
            stuck_damping_n_m_s_rad: 0.0,
            anchor_rad: 0.0,
            slide: Slide::Stuck,
        }
    }

    /// Sets the bristle to stick at `angle_rad` without torque.
    pub(super) fn settle(&mut self, angle_rad: f64) {
        self.anchor_rad = angle_rad;
        self.slide = Slide::Stuck;
    }

    /// Sets the bristle's state during a step from the joint's state at its start.
    pub(super) fn step(&mut self, angle_rad: f64, rate_rad_s: f64) {
        if self.stiction_n_m <= 0.0 {
            return;
        }
        let bend_max_rad = self.stiction_n_m / self.stiffness_n_m_rad;
        let bend_rad = (angle_rad - self.anchor_rad).clamp(-bend_max_rad, bend_max_rad);
        let direction = match self.slide {
            Slide::Sliding { direction, .. } => direction,
            Slide::Stuck if (angle_rad - self.anchor_rad).abs() > bend_max_rad => bend_rad.signum(),
            Slide::Stuck => 0.0,
        };
        if rate_rad_s * direction > 0.0 {
            let torque_n_m = self.sliding_torque_n_m(rate_rad_s);
            self.slide = Slide::Sliding { direction, torque_n_m };
            self.anchor_rad = angle_rad - direction * torque_n_m / self.stiffness_n_m_rad;
        } else {
            self.slide = Slide::Stuck;
            self.anchor_rad = angle_rad - bend_rad;
            // Limited to the stiction torque, however fast the joint arrives.
            self.stuck_damping_n_m_s_rad = self.damping_n_m_s_rad.min(self.stiction_n_m / rate_rad_s.abs());
        }
    }

    /// Returns the sliding torque by Stribeck's curve, in the form of Armstrong-Helouvry, Dupont and Canudas de Wit,
    /// Automatica 30, 1994.
    fn sliding_torque_n_m(&self, rate_rad_s: f64) -> f64 {
        let share = (-(rate_rad_s / self.stribeck_rate_rad_s).powi(2)).exp();
        self.coulomb_n_m + (self.stiction_n_m - self.coulomb_n_m) * share
    }

    pub(super) fn load(&self) -> JointLoad {
        match self.slide {
            Slide::Stuck => {
                JointLoad::spring(self.stiffness_n_m_rad, self.stuck_damping_n_m_s_rad, self.anchor_rad, 0.0)
            }
            Slide::Sliding { direction, torque_n_m } => {
                JointLoad { constant_n_m: -direction * torque_n_m, ..JointLoad::default() }
            }
        }
    }
}
