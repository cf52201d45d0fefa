//! Checks of the fitted noise and scales against their stated values.

use crate::checks::consistency::{MAX_OUTLIERS, MAX_SIGMAS_OFF, VerdictInput};
use crate::checks::constants::noise_checks::{
    LARGER_NOISE, MAX_OVER_CORNER_NOISE, MAX_ROTATION_NOISE_RAD, MAX_USUAL_CORNER_PX, NEAR, NOISY,
};
use crate::explain::model_selection::CAMERA_ERROR_STD;
use crate::file::verdict_tables::{Check, VerdictTable};
use crate::model::scales::Hyperparameters;
use crate::say::refusal::Refusal;
use crate::solve::estimate::estimate;
use crate::solve::evidence::{NOISE_BOUNDS, POSITION_BOUNDS, SCALE_BOUNDS};
use crate::solve::input::{BundleInput, HyperparameterMode};
use armcal_core::codes::{Code, Warning};

impl VerdictInput<'_> {
    /// Returns a refusal if the corner noise is far above robot.toml's: a large fitted noise hides other errors.
    pub(crate) fn corner_noise(&self, table: &mut VerdictTable) -> Option<Refusal> {
        let stated_px = self.input.robot.camera.corner_std_px;
        let mean_px = self.found.mean_corner_std_px()?;
        let noise = self.found.scales().noise;
        let check = Check::at_most("corners: noise over what frames and robot.toml say", noise, NOISY);
        if !check.holds {
            table.warnings.push(Warning::new(
                Code::CornersNoisy,
                format!(
                    "corner noise is {noise:.1} times the stated {stated_px:.2} px: check lens, tag sizes, map and \
                 corner_std_px"
                ),
            ));
        }
        table.checks.push(check);
        let limit_px = MAX_OVER_CORNER_NOISE * stated_px;
        let check = Check::at_most("corners averaged over a view: residual, px", noise * mean_px, limit_px);
        let residual_px = check.value;
        let refusal = (!check.holds).then_some(Refusal::CornerNoise { residual_px, stated_px, limit_px });
        table.checks.push(check);
        refusal
    }

    /// Returns a refusal if the stated corner noise is far too small: most observations are outliers, but nearly all
    /// fit under a larger noise that is usual for detectors.
    pub(crate) fn understated_corner_noise(&self, n_observations: usize) -> Option<Refusal> {
        let n_outliers = self.found.outliers.len();
        if 2 * n_outliers <= n_observations || self.found.has_positions() {
            return None;
        }
        let stated_px = self.input.robot.camera.corner_std_px;
        let with_noise = |multiple: f64| {
            let scales = Hyperparameters { noise: multiple * self.input.scales.noise, ..self.input.scales.clone() };
            let input = BundleInput { scales, evidence: HyperparameterMode::Fitted, ..self.input.clone() };
            let found = estimate(&input)?;
            let residual_px = found.scales().noise * found.mean_corner_std_px()?;
            let fits = found.outliers.len() as f64 <= MAX_OUTLIERS * n_observations as f64;
            let is_usual = residual_px > NOISY * stated_px && residual_px < MAX_USUAL_CORNER_PX;
            (fits && is_usual).then_some(residual_px)
        };
        let residual_px = LARGER_NOISE.into_iter().find_map(with_noise)?;
        let (outliers, observations) = (n_outliers, n_observations);
        Some(Refusal::CornerNoiseUnderstated { residual_px, stated_px, outliers, observations })
    }

    /// Returns a refusal if rotations contradict positions: rotations in a wrong format or direction fit with a large
    /// noise.
    pub(crate) fn rotation_noise(&self, table: &mut VerdictTable) -> Option<Refusal> {
        if !self.found.has_poses() {
            return None;
        }
        let stated_rad = self.tag_noise.and_then(|noise| noise.rotation_std_rad);
        let limit_rad = stated_rad.map_or(MAX_ROTATION_NOISE_RAD, |stated_rad| MAX_SIGMAS_OFF * stated_rad);
        let rotation_rad = self.found.scales().rotation_std_rad;
        let check = Check::at_most("noise of rotations, rad", rotation_rad, limit_rad);
        let refusal = (!check.holds).then_some(Refusal::RotationNoise { rotation_rad, limit_rad, stated_rad });
        table.checks.push(check);
        refusal
    }

    /// Returns a warning for each fitted scale that is at its bound.
    pub(crate) fn scales_at_bounds(&self) -> Vec<Warning> {
        let (robot, now, first) = (self.input.robot, self.found.scales(), &self.input.scales);
        let mut all = vec![("noise of corners".to_owned(), now.noise, 1.0, NOISE_BOUNDS)];
        if self.found.has_positions() {
            all[0] = ("noise of positions, m".to_owned(), now.position_std_m, first.position_std_m, POSITION_BOUNDS);
        }
        if self.found.has_poses() {
            let (now, first) = (now.rotation_std_rad, first.rotation_std_rad);
            all.push(("noise of rotations, rad".to_owned(), now, first, POSITION_BOUNDS));
        }
        // No lower bound: the scale of an absent effect is near zero.
        let above = [0.0, SCALE_BOUNDS[1]];
        for (joint, spec) in robot.sensors.iter().enumerate().take(robot.n_seen_joints()) {
            let (now_rad, first_rad) = (now.joint_std_rad[joint], first.joint_std_rad[joint]);
            all.push((
                format!("{}: error from view to view, {}", spec.joint, spec.moves.si()),
                now_rad,
                first_rad,
                above,
            ));
            let (now_rad, first_rad) = (now.shape_std_rad[joint], first.shape_std_rad[joint]);
            all.push((format!("{}: nonlinearity, rad", spec.joint), now_rad, first_rad, above));
        }
        for (k, name) in ["m", "rad"].into_iter().enumerate() {
            if let Some(now) = now.camera_error_std {
                let first = first.camera_error_std.unwrap_or(CAMERA_ERROR_STD);
                all.push((format!("camera error shared by a view, {name}"), now[k], first[k], above));
            }
        }
        let is_at_bound = |(_, now, first, [low, high]): &(String, f64, f64, [f64; 2])| {
            *now <= first * low * (1.0 + NEAR) || *now >= first * high * (1.0 - NEAR)
        };
        let beyond = all.into_iter().filter(is_at_bound);
        let text = |what, now| format!("{what}: the fitted {now:.2e} is at its bound");
        beyond.map(|(what, now, ..)| Warning::new(Code::ScaleAtBound, text(what, now))).collect()
    }
}
