//! The time error of one image: it moves all joints of a view together, each by its rate.
//!
//! The joints' errors of a view have the covariance `D + j j^T`, D of what each is off by itself and j the rates times
//! one sigma of the time error. Its inverse is `D^-1 - u u^T / (1 + s)`, `u = D^-1 j`, `s = j^T u` (Sherman and
//! Morrison 1950).

use crate::solve::constants::time_error::LEAST_OWN_VAR;
use nalgebra::{SMatrix, SVector};

use crate::solve::problem::{BundleProblem, N_VIEW_PARAMETERS, ViewData};

/// Reduction of the information on a view's own parameters by the image's time error.
#[derive(Clone, Debug)]
pub(crate) struct TimeError {
    /// `D^-1 j`.
    by_sigma: SVector<f64, N_VIEW_PARAMETERS>,
    /// `j^T D^-1 j`.
    told: f64,
}

/// Estimate of the time error of one view's image, in its sigmas.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct TimeErrorOfView {
    pub sigmas: f64,
    /// Variance with all that the view told.
    pub var: f64,
}

impl TimeError {
    /// Returns the time error of a view in which no joint moves: none.
    pub(crate) fn none() -> Self {
        Self { by_sigma: SVector::zeros(), told: 0.0 }
    }

    /// Takes a joint in; the inverse of what it is off by itself, 1/rad^2.
    pub(crate) fn add(&mut self, problem: &BundleProblem<'_>, view: &ViewData, joint: usize) -> f64 {
        self.add_joint(joint, problem.joint_own_var(view, joint), problem.jitter_rad(view, joint))
    }

    fn add_joint(&mut self, joint: usize, own_var: f64, jitter_rad: f64) -> f64 {
        let info = if jitter_rad == 0.0 { 1.0 / own_var } else { 1.0 / own_var.max(LEAST_OWN_VAR) };
        self.by_sigma[joint] = info * jitter_rad;
        self.told += info * jitter_rad * jitter_rad;
        info
    }

    /// `u u^T own / (1 + s)`.
    pub(crate) fn pull(&self, own: &SVector<f64, N_VIEW_PARAMETERS>) -> SVector<f64, N_VIEW_PARAMETERS> {
        self.by_sigma * (self.by_sigma.dot(own) / (1.0 + self.told))
    }

    /// Takes `u u^T / (1 + s)` off the information on the first `N` own parameters.
    pub(crate) fn loosen<const N: usize>(&self, info: &mut SMatrix<f64, N, N>) {
        if self.told > 0.0 {
            let by_sigma = self.by_sigma.fixed_rows::<N>(0);
            info.ger(-1.0 / (1.0 + self.told), &by_sigma, &by_sigma, 1.0);
        }
    }

    /// `ln det (D + j j^T) - ln det D`.
    pub(crate) fn log_det(&self) -> f64 {
        self.told.ln_1p()
    }

    /// From the joints' errors and their covariance after the view.
    pub(crate) fn of_view(
        &self,
        own: &SVector<f64, N_VIEW_PARAMETERS>,
        covariance: &SMatrix<f64, N_VIEW_PARAMETERS, N_VIEW_PARAMETERS>,
    ) -> TimeErrorOfView {
        let by_error = self.by_sigma / (1.0 + self.told);
        let var = 1.0 / (1.0 + self.told) + by_error.dot(&(covariance * by_error));
        TimeErrorOfView { sigmas: by_error.dot(own), var }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Vector3};

    use crate::solve::problem::Own;

    use super::*;

    /// Joints of one view, rad: what each is off by itself, and how far it moves in one sigma of the time error.
    const OWN_STD: [f64; 3] = [2e-4, 3e-4, 1e-4];
    const JITTER: [f64; 3] = [1e-3, -4e-4, 2e-4];

    fn of_three() -> (TimeError, Own, Matrix3<f64>) {
        let (mut error, mut info) = (TimeError::none(), Own::identity());
        for joint in 0..3 {
            info[(joint, joint)] = error.add_joint(joint, OWN_STD[joint].powi(2), JITTER[joint]);
        }
        error.loosen(&mut info);
        let jitter = Vector3::from(JITTER);
        let covariance = Matrix3::from_diagonal(&Vector3::from(OWN_STD.map(|std| std * std)));
        (error, info, covariance + jitter * jitter.transpose())
    }

    #[test]
    fn the_information_is_the_inverse_of_the_joints_covariance() {
        let (error, info, covariance) = of_three();
        let product = info.fixed_view::<3, 3>(0, 0) * covariance;
        assert!((product - Matrix3::identity()).amax() < 1e-9, "{product}");
        let of_own: f64 = OWN_STD.iter().map(|std| 2.0 * std.ln()).sum();
        assert!((error.log_det() - (covariance.determinant().ln() - of_own)).abs() < 1e-9);
        let own = SVector::<f64, N_VIEW_PARAMETERS>::from_fn(|k, _| if k < 3 { 1e-4 * (1.0 + k as f64) } else { 0.0 });
        let pulled = Own::from_diagonal(&SVector::from_fn(|k, _| if k < 3 { OWN_STD[k].powi(-2) } else { 1.0 })) * own
            - error.pull(&own);
        assert!((pulled - info * own).amax() < 1e-6 * pulled.amax(), "{pulled}");
    }

    #[test]
    fn a_view_tells_its_time_by_all_joints_together() {
        let (error, ..) = of_three();
        // Errors that are two sigma of time, known exactly.
        let mut own = SVector::<f64, N_VIEW_PARAMETERS>::zeros();
        (0..3).for_each(|joint| own[joint] = 2.0 * JITTER[joint]);
        let told = error.of_view(&own, &Own::zeros());
        let by_joints: f64 = (0..3).map(|joint| (JITTER[joint] / OWN_STD[joint]).powi(2)).sum();
        assert!((told.var - 1.0 / (1.0 + by_joints)).abs() < 1e-12);
        assert!((told.sigmas - 2.0 * by_joints / (1.0 + by_joints)).abs() < 1e-9, "{told:?}");
    }
}
