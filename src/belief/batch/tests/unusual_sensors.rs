//! A gain that departs from its datasheet more than nearly all do: it is named. Parameters that views do not determine
//! get larger sigmas.

use crate::batch::tests::failures::{Case, case_with_range};
use crate::explain::failures::FailureAdjusted;
use crate::model::parameters::{JointParameters, ParameterKind};
use crate::say::finding::FindingKind;
use crate::say::refusal::Refusal;
use crate::solve::estimate::Estimate;
use crate::solve::input::HyperparameterMode;

const SEEDS: std::ops::Range<u64> = 60..64;

fn with_estimate<T>(case: &Case, then: impl FnOnce(&mut Estimate<'_>) -> T) -> T {
    let applied = FailureAdjusted::new(&case.robot, &case.views, &[], &JointParameters::default());
    then(&mut applied.estimate(HyperparameterMode::Given).expect("solved"))
}

/// An arm without faults, whose gains are stated with sigmas so small that the largest departs by `sigmas`; joint 3
/// hardly moves.
fn stated_closely(seed: u64, sigmas: f64) -> Case {
    let mut case = case_with_range(seed, Some((3, 0.05)));
    for _ in 0..3 {
        let largest = with_estimate(&case, |found| {
            let gains = found.apart_from_datasheet().into_iter().filter(|of| of.parameter.kind == ParameterKind::Gain);
            gains.map(|of| of.off.abs()).fold(0.0, f64::max)
        });
        case.robot.sensors.iter_mut().for_each(|spec| spec.gain_std = largest / sigmas);
    }
    case
}

#[test]
fn a_covariance_with_wider_priors_is_that_of_an_estimate_with_larger_sigmas() {
    for seed in SEEDS {
        let narrow = stated_closely(seed, 4.5);
        let mut wide = narrow.clone();
        wide.robot.sensors.iter_mut().for_each(|spec| spec.gain_std *= 4.5);
        let [narrow, widened] = with_estimate(&narrow, |found| {
            let narrow = found.joint_covariance();
            found.widen_unusual();
            [narrow, found.joint_covariance()]
        });
        let wide = with_estimate(&wide, |found| found.joint_covariance());
        let grown = (0..wide.nrows()).map(|row| widened[(row, row)] / narrow[(row, row)]).fold(0.0, f64::max);
        assert!(grown > 1.1, "seed {seed}: {grown}");
        for row in 0..wide.nrows() {
            let ratio = widened[(row, row)] / wide[(row, row)];
            assert!((ratio - 1.0).abs() < 0.1, "seed {seed}, row {row}: {ratio}");
        }
    }
}

#[test]
fn a_gain_four_sigmas_and_more_off_is_named_and_refused_beyond_five() {
    for seed in SEEDS {
        for (sigmas, is_named, is_refused) in [(3.0, false, false), (4.6, true, false), (6.0, false, true)] {
            let calibration = stated_closely(seed, sigmas).calibrated();
            let unusual = calibration.findings.iter().filter(|found| found.kind == FindingKind::SensorUnusual).count();
            let refused = |refusal: &Refusal| matches!(refusal, Refusal::BeyondDatasheet { .. });
            assert_eq!(unusual == 1, is_named, "seed {seed}, {sigmas} sigmas: {:?}", calibration.findings);
            assert_eq!(calibration.refusals.iter().any(refused), is_refused, "seed {seed}, {sigmas} sigmas");
        }
    }
}
