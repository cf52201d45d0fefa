//! Touches of surveyed planes by the tool: constraints on unobservable parameters, applied after the fit of the views.
//!
//! A touch states `n . (tool - p) = r` within its standard deviation. Its innovation, the tool's deviation from the
//! prediction, is
//!
//! ```text
//! y = r - n . (tool - p) = n . (J (x - x0) + t z + K w + E e) + noise
//! ```
//!
//! x is the views' estimate with its covariance C; z are elements of the nominal model (poses of joints, tool point)
//! under their priors. w are the sensors distal to the camera under their datasheets; e are the joints' own errors at
//! the touch. t includes the estimate's response to z (`reservations`).
//!
//! All touches together give the innovations' covariance S. `y^T S^-1 y` is chi-square if nominal model and surfaces
//! are right (Bar-Shalom, Li and Kirubarajan 2001, sec. 5.4). The update is Kalman's. The nominal model is not changed;
//! its apparent error stays in the predicted tool error.

pub(crate) use crate::checks::constants::touch_term::MIN_TOUCHES;
use crate::checks::constants::touch_term::{ALIKE_CHI2, ALIKE_SHARE, TOLD_SHARE, USUAL};
use crate::judge::constants::FALSE_ALARM;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix3, Vector3};

use crate::explain::score_test::{GeometryElement, Score, ToolJacobian, columns};
use crate::file::calibration::Calibration;
use crate::file::verdict_tables::Check;
use crate::say::finding::{Finding, FindingKind, FindingUnit};
use crate::say::geometry_error::ErrorKind;
use crate::say::refusal::Refusal;
use crate::solve::estimate::Estimate;
use crate::views::view::Touch;
use armcal_core::codes::Code;
use armcal_core::robot::Robot;
use armcal_core::stats::chi_square_quantile;

/// Causes of touch innovations beyond their limit.
pub(crate) const TOOL_POINT: &str = "tool point or links beyond the camera";
pub(crate) const MOUNT_TURN: &str = "the camera's turn about the last joint before it";
pub(crate) const SURVEY_TURN: &str = "a turn of the tag survey against the base";

/// Update of the views' estimate by touches.
pub(crate) struct TouchUpdate {
    names: Vec<String>,
    tools: Vec<ToolJacobian>,
    normals: Vec<Vector3<f64>>,
    score: Score,
    innovations: DVector<f64>,
    factor: Cholesky<f64, Dyn>,
    /// Mean of x less the views' estimate, then of the elements of the nominal model.
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
    /// Number of estimated parameters in `mean`.
    n: usize,
    pub(crate) chi2: f64,
    pub(crate) limit: f64,
}

/// Possible cause of touch innovations beyond their limit.
struct Cause {
    words: String,
    chi2_left: f64,
    size: DVector<f64>,
}

impl Estimate<'_> {
    /// Returns the update by `touches`. `None` with too few touches, or if their covariance is not positive definite.
    pub(crate) fn touch_update(&self, touches: &[Touch]) -> Option<TouchUpdate> {
        if touches.len() < MIN_TOUCHES {
            return None;
        }
        let (score, at) = (self.score(), self.parameters());
        let robot = &at.with_links(self.problem.robot.clone());
        let estimated = &self.problem.layout.parameters;
        let tools: Vec<ToolJacobian> =
            touches.iter().map(|touch| ToolJacobian::of_view(robot, estimated, &at, &touch.view)).collect();
        let n = self.problem.layout.n;
        let places = places(robot, self.problem.layout.links.len());
        let mut rows = DMatrix::zeros(touches.len(), n + places.len() + 3);
        for (row, (touch, tool)) in touches.iter().zip(&tools).enumerate() {
            let along = sensitivities(robot, &score, tool, n, &touch.normal);
            rows.row_mut(row).copy_from(&along.transpose());
        }
        let mut prior = DMatrix::zeros(rows.ncols(), rows.ncols());
        prior.view_mut((0, 0), (n, n)).copy_from(&self.posterior.covariance);
        for (k, std) in places.iter().copied().chain([robot.geometry.tool_position_std_m; 3]).enumerate() {
            prior[(n + k, n + k)] = std * std;
        }
        let gain = &prior * rows.transpose();
        let spread = &rows * &gain + self.beyond_columns(touches, &tools);
        let innovation = |(touch, tool): (&Touch, &ToolJacobian)| {
            touch.tip_radius_m - touch.normal.dot(&(tool.tool_m - touch.point_m))
        };
        let innovations = DVector::from_iterator(touches.len(), touches.iter().zip(&tools).map(innovation));
        let factor = Cholesky::new(spread)?;
        let weighted = factor.solve(&innovations);
        let chi2 = innovations.dot(&weighted);
        let covariance = &prior - &gain * factor.solve(&gain.transpose());
        let usual = chi_square_quantile(USUAL, touches.len());
        let birge = if chi2 > usual { chi2 / touches.len() as f64 } else { 1.0 };
        Some(TouchUpdate {
            names: touches.iter().map(|touch| touch.surface.clone()).collect(),
            normals: touches.iter().map(|touch| touch.normal).collect(),
            mean: &gain * weighted,
            covariance: covariance * birge.max(1.0),
            limit: chi_square_quantile(1.0 - FALSE_ALARM, touches.len()),
            tools,
            score,
            innovations,
            factor,
            n,
            chi2,
        })
    }

    /// Covariance of the touches from effects without a column: noise, the joints' own errors at each touch, and gains
    /// and offsets of unobservable joints. All touches share the last.
    fn beyond_columns(&self, touches: &[Touch], tools: &[ToolJacobian]) -> DMatrix<f64> {
        let robot = self.problem.robot;
        let layout = &self.problem.layout;
        let mut out = DMatrix::zeros(touches.len(), touches.len());
        for joint in 0..robot.tool.mount.n_joints {
            let spec = &robot.sensors[joint];
            let is_estimated = !layout.of_joint[joint].is_empty();
            let own_std_rad = if is_estimated { self.scales().joint_std_rad[joint] } else { spec.linearity_std_rad };
            let reading_std_rad = spec.noise_std_counts / spec.counts_per_rad.abs();
            let by_angle = |k: usize| touches[k].normal.dot(&tools[k].poses.point_jacobian(joint, &tools[k].tool_m));
            for i in 0..touches.len() {
                let n_readings = touches[i].view.n_readings.max(1) as f64;
                let own_var = own_std_rad.powi(2) + reading_std_rad.powi(2) / n_readings;
                out[(i, i)] += own_var * by_angle(i).powi(2);
                for k in (0..touches.len()).filter(|_| !is_estimated) {
                    let travels = touches[i].view.travel_rad[joint] * touches[k].view.travel_rad[joint];
                    let common = spec.offset_std_rad.powi(2) + spec.gain_std.powi(2) * travels;
                    out[(i, k)] += common * by_angle(i) * by_angle(k);
                }
            }
        }
        for (i, touch) in touches.iter().enumerate() {
            out[(i, i)] += touch.std_m.powi(2);
        }
        out
    }

    /// Returns the estimate updated by the touches; the views' own parameters stay.
    pub(crate) fn with_touches(&self, update: &TouchUpdate) -> Self {
        let mut updated = self.clone();
        let n = update.n;
        updated.solved.state.step(&self.problem.layout, &update.mean.rows(0, n).into_owned());
        updated.posterior.covariance = update.covariance.view((0, 0), (n, n)).into_owned();
        updated
    }
}

fn tool_link(robot: &Robot) -> String {
    robot.bodies[robot.tool.mount.n_joints].name.clone()
}

/// Prior standard deviations of each joint's pose: three of shift, m, three of rotation, rad. The first `n_estimated`
/// are 0, because the estimate has them as parameters.
fn places(robot: &Robot, n_estimated: usize) -> Vec<f64> {
    let (m, rad) = (robot.geometry.link_position_std_m, robot.geometry.link_rotation_std_rad);
    let all = (0..robot.tool.mount.n_joints).flat_map(|_| [m, m, m, rad, rad, rad]);
    all.enumerate().map(|(k, std)| if k < n_estimated { 0.0 } else { std }).collect()
}

/// Tool displacement along `normal` per unit of the estimated parameters, the joints' poses and the tool point.
fn sensitivities(robot: &Robot, score: &Score, tool: &ToolJacobian, n: usize, normal: &Vector3<f64>) -> DVector<f64> {
    let n_places = 6 * robot.tool.mount.n_joints;
    let mut along = DVector::zeros(n + n_places + 3);
    for (column, by) in tool.by_parameters.iter().enumerate() {
        along[column] = normal.dot(by);
    }
    for k in 0..n_places {
        along[n + k] = normal.dot(&tool.shift(score, k - k % 3, &Vector3::ith(k % 3, 1.0)));
    }
    let axes = tool.poses.frame(&robot.tool.mount).rotation;
    for axis in 0..3 {
        along[n + n_places + axis] = normal.dot(&(axes * Vector3::ith(axis, 1.0)));
    }
    along
}

impl TouchUpdate {
    /// Covariance of the tool at one configuration after the touches, without the part of the estimated parameters,
    /// m^2. It includes the apparent error of the nominal model.
    pub(crate) fn beside_parameters_m2(&self, robot: &Robot, at: &ToolJacobian) -> Matrix3<f64> {
        let rows: Vec<DVector<f64>> =
            (0..3).map(|axis| sensitivities(robot, &self.score, at, self.n, &Vector3::ith(axis, 1.0))).collect();
        let rest = self.mean.len() - self.n;
        let drawing_m = Vector3::from_fn(|axis, _| rows[axis].rows(self.n, rest).dot(&self.mean.rows(self.n, rest)));
        let by_parameters = self.covariance.view((0, 0), (self.n, self.n));
        Matrix3::from_fn(|i, k| {
            let all = rows[i].dot(&(&self.covariance * &rows[k]));
            let told = rows[i].rows(0, self.n).dot(&(by_parameters * rows[k].rows(0, self.n)));
            all - told + drawing_m[i] * drawing_m[k]
        })
    }

    /// Standard deviation to which the touches determine an element, without its own prior; infinite if they do not.
    /// `along`: displacement of the tool along each touch's normal by one unit of the element, m.
    fn std_of(&self, along: &DVector<f64>, own_prior_std: f64) -> f64 {
        let told = along.dot(&self.factor.solve(along));
        // The factor includes the element's prior (matrix inversion lemma).
        let told = told / (1.0 - told * own_prior_std.powi(2)).max(1e-12);
        if told > 0.0 { told.sqrt().recip() } else { f64::INFINITY }
    }

    /// Standard deviation from the touches of the score test's trial at `first + axis`.
    pub(crate) fn std_of_trial(&self, first: usize, axis: usize, own_prior_std: f64) -> f64 {
        let shift = |tool: &ToolJacobian| tool.shift(&self.score, first, &Vector3::ith(axis, 1.0));
        self.std_of(&self.along(shift), own_prior_std)
    }

    /// Standard deviation from the touches of the tag survey's frame, against the joint whose trial is at
    /// `first + axis`.
    pub(crate) fn std_of_survey(&self, first: usize, axis: usize) -> f64 {
        let shift = |tool: &ToolJacobian| -tool.followed(&self.score, first, &Vector3::ith(axis, 1.0));
        self.std_of(&self.along(shift), 0.0)
    }

    /// Standard deviation from the touches of the tool point along an axis of its link, m.
    pub(crate) fn std_of_tool_point(&self, robot: &Robot, axis: usize) -> f64 {
        let shift = |tool: &ToolJacobian| tool.poses.frame(&robot.tool.mount).rotation * Vector3::ith(axis, 1.0);
        self.std_of(&self.along(shift), robot.geometry.tool_position_std_m)
    }

    fn along(&self, shift: impl Fn(&ToolJacobian) -> Vector3<f64>) -> DVector<f64> {
        let each = self.tools.iter().zip(&self.normals).map(|(tool, normal)| normal.dot(&shift(tool)));
        DVector::from_iterator(self.tools.len(), each)
    }

    /// Writes the check into `calibration`, and refuses it if the touches contradict the tool's position.
    pub(crate) fn judge(&self, robot: &Robot, calibration: &mut Calibration) {
        let check = Check::at_most("touches: chi-square of the tool's place", self.chi2, self.limit);
        let holds = check.holds;
        if let Some(verdict) = &mut calibration.verdict {
            verdict.checks.push(check);
            verdict.warnings.retain(|warning| warning.code != Code::LinksUnobservable);
        }
        if holds {
            return;
        }
        let shift_m = self.tool_point_m(robot);
        calibration.findings.insert(
            0,
            Finding {
                kind: FindingKind::Tool,
                name: tool_link(robot),
                size: Some(shift_m.norm()),
                unit: Some(FindingUnit::Metre),
                tool_error_m: Some(shift_m.norm()),
                time_s: None,
                repaired: false,
            },
        );
        calibration.refuse_for([self.refusal(robot)]);
    }

    pub(crate) fn refusal(&self, robot: &Robot) -> Refusal {
        let worst = self.innovations.iamax();
        let mut causes = vec![self.tool_point(robot), self.mount_turn()];
        causes.extend(self.survey_turn(robot));
        causes.extend((0..self.names.len()).map(|k| self.surface(k)));
        let best = causes.iter().map(|cause| cause.chi2_left).fold(f64::INFINITY, f64::min);
        let alike = best + ALIKE_CHI2.max(ALIKE_SHARE * self.chi2);
        let class: Vec<String> =
            causes.into_iter().filter(|cause| cause.chi2_left <= alike).map(|cause| cause.words).collect();
        Refusal::Touch {
            off_m: self.innovations[worst],
            surface: self.names[worst].clone(),
            chi2: self.chi2,
            limit: self.limit,
            causes: class,
            link: tool_link(robot),
            tool_point_m: self.tool_point_m(robot).into(),
        }
    }

    /// Tool point error that explains the touches best without another cause, m, axes of its link.
    pub(crate) fn tool_point_m(&self, robot: &Robot) -> Vector3<f64> {
        self.tool_point(robot).size.fixed_rows::<3>(0).into_owned()
    }

    fn tool_point(&self, robot: &Robot) -> Cause {
        let columns: Vec<DVector<f64>> = (0..3)
            .map(|axis| self.along(|tool| tool.poses.frame(&robot.tool.mount).rotation * Vector3::ith(axis, 1.0)))
            .collect();
        self.cause(TOOL_POINT.to_owned(), &columns)
    }

    fn mount_turn(&self) -> Cause {
        let (first, _) = columns(GeometryElement::Mount, ErrorKind::Turn);
        let columns: Vec<DVector<f64>> =
            (0..3).map(|axis| self.along(|tool| tool.shift(&self.score, first, &Vector3::ith(axis, 1.0)))).collect();
        self.cause(MOUNT_TURN.to_owned(), &columns)
    }

    /// Rotation of the whole tag survey against the base, about the axes that no view determines.
    fn survey_turn(&self, robot: &Robot) -> Option<Cause> {
        let (first, _) = columns(GeometryElement::Joint(0), ErrorKind::Turn);
        let std = robot.geometry.link_rotation_std_rad;
        let unseen = (0..3).filter(|axis| self.score.information[(first + axis, first + axis)] * std * std < 1.0);
        let columns: Vec<DVector<f64>> = unseen
            .map(|axis| self.along(|tool| -tool.followed(&self.score, first, &Vector3::ith(axis, 1.0))))
            .collect();
        (!columns.is_empty()).then(|| self.cause(SURVEY_TURN.to_owned(), &columns))
    }

    fn surface(&self, k: usize) -> Cause {
        let column = DVector::from_fn(self.names.len(), |row, _| f64::from(u8::from(row == k)));
        self.cause(format!("the survey of {}", self.names[k]), &[column])
    }

    /// Estimates the parameters of `columns` from the touches, and the chi-square that then remains.
    fn cause(&self, words: String, columns: &[DVector<f64>]) -> Cause {
        let by = DMatrix::from_columns(columns);
        let weighted = self.factor.solve(&by);
        let eigen = by.tr_mul(&weighted).symmetric_eigen();
        let pull = weighted.tr_mul(&self.innovations);
        let least = TOLD_SHARE * eigen.eigenvalues.amax();
        let (mut chi2_left, mut size) = (self.chi2, DVector::zeros(columns.len()));
        for (value, direction) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            if *value > least {
                let along = direction.dot(&pull);
                chi2_left -= along * along / value;
                size += direction * (along / value);
            }
        }
        Cause { words, chi2_left, size }
    }
}
