//! Test whether sag of the arm explains the views better, and initial scales of its compliances.
//!
//! The gain of evidence is predicted as for links, with a trial column for each joint's compliance and for each of the
//! base's three. A load at the tool bends nothing while nothing is compliant: its column comes with the others.

use nalgebra::SMatrix;

use crate::explain::drawing::{MULTIPLES, gain_nats};
use crate::model::parameters::Parameter;
use crate::solve::body_motion::SagPoint;
use crate::solve::body_twists::sag_twist;
use crate::solve::estimate::Estimate;
use crate::solve::input::BundleInput;
use crate::solve::schur::Group;
use armcal_core::joints::MAX_JOINTS;
use armcal_core::kinematics::Sag;

/// Trial columns: the joints' compliances, then the base's three.
type Trials = SMatrix<f64, 6, { MAX_JOINTS + 3 }>;

/// Initial scales of compliances.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SagStart {
    n_joints: usize,
    /// Ratio to robot.toml's: of the joints, of the base.
    multiples: [f64; 2],
}

impl SagStart {
    pub(crate) fn apply(&self, input: &mut BundleInput<'_>) {
        input.model.n_compliant = input.model.n_compliant.max(self.n_joints);
        let priors = &input.robot.geometry;
        input.scales.compliance_std = [
            self.multiples[0] * priors.joint_compliance_std_rad_per_nm,
            self.multiples[1] * priors.mount_compliance_std_rad_per_nm,
        ];
    }
}

impl Estimate<'_> {
    /// Initial scales of compliances, and their predicted evidence gain, nats.
    pub(crate) fn sag_start(&self) -> (SagStart, f64) {
        let robot = self.problem.robot;
        let n_joints = self.n_seen_joints();
        let mut best = (0.0, SagStart { n_joints, multiples: [1.0; 2] });
        // If the camera is fixed, poses are in the frame of the tags, in which gravity turns.
        if !robot.chain.loads().are_known() || robot.is_watched() {
            return (best.1, 0.0);
        }
        let score = self.score_of(|group| self.sag_trials(group));
        let priors = &robot.geometry;
        let of_joints = (0..n_joints).map(|joint| (joint, priors.joint_compliance_std_rad_per_nm));
        let of_base = (0..3).map(|axis| (MAX_JOINTS + axis, priors.mount_compliance_std_rad_per_nm));
        let (joints, base): (Vec<_>, Vec<_>) = (of_joints.collect(), of_base.collect());
        let both = [&joints[..], &base[..]].concat();
        for multiple in MULTIPLES {
            for (columns, multiples) in
                [(&joints, [multiple, 1.0]), (&base, [1.0, multiple]), (&both, [multiple, multiple])]
            {
                let gain = gain_nats(&score.score, &score.information, columns, multiple);
                if gain > best.0 {
                    best = (gain, SagStart { n_joints, multiples });
                }
            }
        }
        (best.1, best.0)
    }

    fn sag_trials(&self, group: &Group<'_>) -> Trials {
        let at = SagPoint::new(&self.problem.loads(group.view_idx), &Sag::default(), group.poses);
        let mut trials = Trials::zeros();
        let of_joints = group.joints.clone().map(|joint| (joint, Parameter::all_of_sag(joint + 1).nth(joint)));
        let of_base = (0..3).map(|axis| (MAX_JOINTS + axis, Parameter::all_of_sag(0).nth(axis)));
        for (column, parameter) in of_joints.chain(of_base) {
            if let Some(parameter) = parameter {
                trials.set_column(column, &sag_twist(group, &at.turns(parameter)));
            }
        }
        trials
    }
}
