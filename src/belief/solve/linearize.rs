//! Normal equations of one state, the views' own parameters eliminated (Schur complement).
//!
//! In a view all acts through the twist u of the camera (right, camera frame) that each observation i sees:
//! `u_i = S l + T y - Ad_i tau_i`: l the view's own parameters (joint errors, camera error) with prior `L^-1`, y the
//! common ones along the directions T (joints, links, mount, time offset), tau_i the tag's pose. With `H_i` of each
//! observation and `G = sum H_i`, elimination of l leaves, for the blocks a and b,
//! `sum A_a^T H_i A_b - (sum A_a^T H_i) M (sum H_i A_b)`, `M = S (S^T G S + L)^-1 S^T`: all of it 6x6 algebra, whatever
//! the number of corners.

use nalgebra::{DMatrix, DVector, Matrix6, SMatrix, SVector, Vector6};

use crate::measure::{LensInformation, PoseInformation, right_jacobian_inverse};
use crate::model::blocks::Block;
use crate::model::state::State;
use crate::solve::body_twists::{BodySums, body_twists, sag_twist};
use crate::solve::problem::{BundleProblem, N_VIEW_PARAMETERS};
use crate::solve::schur::{Columns, Directions, Group, MOUNT, N_DIRECTIONS, SchurBlock, TIME};
use crate::solve::time_error::TimeError;
use armcal_core::joints::MAX_JOINTS;
use armcal_core::kinematics::LinkCorrections;
use armcal_core::numeric::Loss;
use armcal_core::spatial::log;

/// Where to linearize, and under which loss.
struct Point<'a, 'b> {
    problem: &'a BundleProblem<'b>,
    state: &'a State,
    corrections: LinkCorrections,
    loss: Loss,
}

/// Over the observations of a group.
struct Sums {
    h: Matrix6<f64>,
    g: Vector6<f64>,
    by_lens: SMatrix<f64, 6, 8>,
}

impl Sums {
    fn of(infos: &[PoseInformation], lens_infos: &[LensInformation]) -> Self {
        let mut sums = Self { h: Matrix6::zeros(), g: Vector6::zeros(), by_lens: SMatrix::zeros() };
        for info in infos {
            sums.h += info.h;
            sums.g += info.g;
        }
        for lens in lens_infos {
            sums.by_lens += lens.cross;
        }
        sums
    }
}

/// The normal equations at one state.
#[derive(Clone, Debug)]
pub(crate) struct NormalEquations {
    /// Lower triangle.
    pub matrix: DMatrix<f64>,
    pub right: DVector<f64>,
    pub cost: f64,
    /// Marginalised blocks of the views, then those of the gripper's tag.
    pub eliminated: Vec<SchurBlock>,
    /// `H_i Ad_i` and column of the tag of each observation.
    pub by_tag: Vec<(Matrix6<f64>, Option<usize>)>,
    /// Sum of squares of each observation's whitened residuals.
    pub chi2: Vec<f64>,
    /// Sum of squares of each corner's whitened residuals, used or not.
    pub corner_chi2: Vec<[f64; 4]>,
    /// Information of the current group's observations; kept so that the loop does not allocate.
    infos: Vec<PoseInformation>,
    /// Lens information of the same observations; empty where the lens has no columns.
    lens_infos: Vec<LensInformation>,
}

impl NormalEquations {
    pub(crate) fn new(problem: &BundleProblem<'_>) -> Self {
        let n = problem.layout.n;
        let n_groups = problem.views.len() + problem.views.iter().filter(|view| view.gripper.is_some()).count();
        Self {
            matrix: DMatrix::zeros(n, n),
            right: DVector::zeros(n),
            cost: 0.0,
            eliminated: vec![SchurBlock::new(problem.layout.body().len()); n_groups],
            by_tag: vec![(Matrix6::zeros(), None); problem.observations.len()],
            chi2: vec![0.0; problem.observations.len()],
            corner_chi2: vec![[0.0; 4]; problem.observations.len()],
            infos: Vec::new(),
            lens_infos: Vec::new(),
        }
    }

    /// Linearizes `problem` at `state`.
    pub(crate) fn update(&mut self, problem: &BundleProblem<'_>, state: &State, loss: Loss) {
        // A prior of all columns is copied in the place of zeros.
        let is_full = problem.prior.is_full();
        if is_full {
            self.start_with_full_prior(problem, state);
        } else {
            self.matrix.fill(0.0);
            self.right.fill(0.0);
            self.cost = 0.0;
        }
        let at = Point { problem, state, corrections: problem.link_corrections(state), loss };
        // Lent, and filled in place: the blocks are large.
        let mut eliminated = std::mem::take(&mut self.eliminated);
        let mut blocks = eliminated.iter_mut();
        for view_idx in 0..problem.views.len() {
            let poses = problem.corrected_link_poses(view_idx, state, &at.corrections);
            for (group, own) in Group::of_view(problem, state, view_idx, &poses).zip(blocks.by_ref()) {
                self.add_group(&at, &group, own);
            }
        }
        self.eliminated = eliminated;
        if !is_full {
            self.add_priors(problem, state);
        }
        self.add_block_measurements(problem, state);
    }

    fn add_group(&mut self, at: &Point<'_, '_>, group: &Group<'_>, own: &mut SchurBlock) {
        let problem = at.problem;
        let directions = directions(at, group);
        self.linearize_sightings(at, group);
        let infos = std::mem::take(&mut self.infos);
        let lens_infos = std::mem::take(&mut self.lens_infos);
        let sums = Sums::of(&infos, &lens_infos);
        let (h_sum, g_sum) = (sums.h, sums.g);
        self.cost += eliminate(at, group, &directions, &sums, own);
        let (m, shift) = own.reach();
        let m_h_sum = m * h_sum;
        let q = h_sum - h_sum * m_h_sum;
        let columns = Columns::new(problem, group);
        let along = directions.transpose();
        self.add_common(&columns, &(along * (q * directions)));
        self.add_common_right(&columns, &(along * (g_sum - h_sum * shift)));
        self.add_tags(&columns, &infos, &directions, &Eliminated { block: own, m, shift, m_h_sum });
        if let Some(at) = columns.lens {
            let lens = LensSums {
                at,
                infos: &infos,
                lens_infos: &lens_infos,
                first: group.observations.start,
                directions: &directions,
                m,
                shift,
                h_sum,
                by_lens: sums.by_lens,
            };
            self.add_lens(&columns, &lens);
        }
        if !problem.layout.body().is_empty() {
            let twists = body_twists(problem, group, &at.corrections);
            for (mut pulled, twist) in own.by_body.column_iter_mut().zip(twists.column_iter()) {
                pulled.copy_from(&(h_sum * twist));
            }
            let link = BodySums { twists, q, m, g: g_sum - h_sum * shift, m_h_sum, by_lens: sums.by_lens, h_sum };
            self.add_body(&columns, &link, own, &directions);
        }
        self.infos = infos;
        self.lens_infos = lens_infos;
        own.by_common = h_sum * directions;
        own.by_lens = sums.by_lens;
    }

    /// The tags' own blocks, and what ties them to the common parameters and to one another.
    fn add_tags(
        &mut self,
        columns: &Columns<'_>,
        infos: &[PoseInformation],
        directions: &Directions,
        own: &Eliminated<'_>,
    ) {
        let Eliminated { block, m, shift, m_h_sum } = own;
        let first = block.range.start;
        let h_sum_m = m_h_sum.transpose();
        for (k, info) in infos.iter().enumerate() {
            let u = info.h * info.adjoint;
            self.by_tag[first + k].0 = u;
            let Some(column) = self.by_tag[first + k].1 else { continue };
            let mut own_right = self.right.fixed_rows_mut::<6>(column);
            own_right -= info.adjoint.tr_mul(&(info.g - info.h * *shift));
            self.add_block(column, column, &(info.adjoint.transpose() * u));
            // Common by tag: T^T (H_i - G M H_i)(-Ad_i).
            let cross = if block.has_any { u - h_sum_m * u } else { u };
            self.subtract_cross(columns, column, &cross.transpose(), directions);
            // Only what is eliminated ties a view's tags to one another.
            if !block.has_any {
                continue;
            }
            let m_u_transposed = (*m * u).transpose();
            for other in 0..=k {
                let (before, Some(at)) = &self.by_tag[first + other] else { continue };
                let (before, at) = (*before, *at);
                // Rows: this tag; columns: the other's.
                let block = -(m_u_transposed * before);
                if at < column {
                    self.add_block(column, at, &block);
                } else {
                    self.add_block(at, column, &block.transpose());
                }
            }
        }
    }

    /// Linearized observations, weighted by the loss, their cost added.
    fn linearize_sightings(&mut self, point: &Point<'_, '_>, group: &Group<'_>) {
        let Point { problem, state, loss, .. } = point;
        self.infos.clear();
        self.lens_infos.clear();
        for at in group.observations.clone() {
            let observation = &problem.observations[at];
            let camera_from_tag = group.camera_from_tag(state, observation.block);
            if problem.layout.at(Block::Lens(group.camera)).is_some() {
                self.lens_infos.push(LensInformation::zeros());
            }
            let (by_lens, lens) = (self.lens_infos.last_mut(), state.blocks.lens(Block::Lens(group.camera)));
            let of = observation.data.information(&camera_from_tag, lens, problem.scales.noise, by_lens);
            self.infos.push(of.unwrap_or_else(|| observation.data.unseen()));
            let Some(info) = self.infos.last_mut() else { continue };
            (self.chi2[at], self.corner_chi2[at]) = (info.chi2, info.corner_chi2);
            self.by_tag[at].1 = problem.layout.at(observation.block);
            let (cost, weight) = if observation.is_used {
                loss.of_coordinates(info.chi2, observation.data.n_coordinates())
            } else {
                (0.0, 0.0)
            };
            self.cost += cost;
            if weight != 1.0 {
                info.weighted(weight);
                if let Some(lens) = self.lens_infos.last_mut() {
                    lens.weighted(weight);
                }
            }
        }
    }

    /// Adds at rows `row`, columns `column`, row >= column; on the diagonal the lower triangle matters.
    pub(crate) fn add_block(&mut self, row: usize, column: usize, block: &Matrix6<f64>) {
        let mut view = self.matrix.fixed_view_mut::<6, 6>(row, column);
        view += block;
    }

    fn add_common(&mut self, columns: &Columns<'_>, block: &SMatrix<f64, N_DIRECTIONS, N_DIRECTIONS>) {
        for b in columns.directions() {
            let (first, by_columns) = columns.of(b);
            // Directions come in the order of their columns; what falls above the diagonal is not read.
            for a in columns.directions().skip_while(|a| *a < b) {
                let (first_row, by_rows) = columns.of(a);
                for (k, by_column) in by_columns.iter().enumerate() {
                    let value = block[(a, b)] * by_column;
                    let cells = self.cells(first + k, first_row, by_rows.len());
                    cells.iter_mut().zip(by_rows).for_each(|(cell, by_row)| *cell += value * by_row);
                }
            }
        }
    }

    /// Cells of a column, from a row on.
    #[inline]
    pub(crate) fn cells(&mut self, column: usize, first_row: usize, n: usize) -> &mut [f64] {
        let start = column * self.matrix.nrows() + first_row;
        &mut self.matrix.as_mut_slice()[start..start + n]
    }

    /// As many as there are in a pose, or a lens.
    #[inline]
    pub(crate) fn few_cells<const N: usize>(&mut self, column: usize, first_row: usize) -> &mut [f64; N] {
        let cells = self.cells(column, first_row, N).first_chunk_mut();
        cells.expect("as many as asked for")
    }

    fn add_common_right(&mut self, columns: &Columns<'_>, right: &SVector<f64, N_DIRECTIONS>) {
        for a in columns.directions() {
            columns.each(a, |row, by_row| self.right[row] += right[a] * by_row);
        }
    }

    /// `by_twist`: tag by twist of the camera. Common parameters come before the tags, so that these are the rows.
    fn subtract_cross(&mut self, columns: &Columns<'_>, tag: usize, by_twist: &Matrix6<f64>, directions: &Directions) {
        for a in columns.directions() {
            let by_direction = by_twist * directions.column(a);
            let (first, by_columns) = columns.of(a);
            for (k, by_column) in by_columns.iter().enumerate() {
                let cells = self.few_cells::<6>(first + k, tag);
                cells.iter_mut().zip(&by_direction.data.0[0]).for_each(|(cell, by)| *cell -= by * by_column);
            }
        }
    }

    fn add_lens(&mut self, columns: &Columns<'_>, sums: &LensSums<'_>) {
        let at = sums.at;
        let mut h = -(sums.by_lens.transpose() * sums.m * sums.by_lens);
        let mut g = -(sums.by_lens.transpose() * sums.shift);
        let m_lens = sums.m * sums.by_lens;
        for (k, (info, lens)) in sums.infos.iter().zip(sums.lens_infos).enumerate() {
            h += lens.h;
            g += lens.g;
            let Some(column) = self.by_tag[sums.first + k].1 else { continue };
            // Rows: the tag; columns: the lens, which comes before.
            let block: SMatrix<f64, 6, 8> = -(info.adjoint.transpose() * (lens.cross - info.h * m_lens));
            let mut view = self.matrix.fixed_view_mut::<6, 8>(column, at);
            view += block;
        }
        let mut view = self.matrix.fixed_view_mut::<8, 8>(at, at);
        view += h;
        let mut right = self.right.fixed_rows_mut::<8>(at);
        right += g;
        let cross: SMatrix<f64, N_DIRECTIONS, 8> = sums.directions.transpose() * (sums.by_lens - sums.h_sum * m_lens);
        for a in columns.directions() {
            columns.each(a, |column, by_column| {
                for k in 0..8 {
                    self.matrix[(at + k, column)] += cross[(a, k)] * by_column;
                }
            });
        }
    }
}

/// Takes the group's own parameters out; `block` becomes what is left of them. What they cost by their priors.
fn eliminate(
    at: &Point<'_, '_>,
    group: &Group<'_>,
    directions: &Directions,
    sums: &Sums,
    block: &mut SchurBlock,
) -> f64 {
    let Point { problem, state, .. } = at;
    let view = &problem.views[group.view_idx];
    block.range = group.observations.clone();
    block.set_none();
    let mut info = SVector::<f64, N_VIEW_PARAMETERS>::repeat(1.0);
    let mut own = SVector::<f64, N_VIEW_PARAMETERS>::zeros();
    for joint in group.joints.clone() {
        // An exact sensor has no error to eliminate.
        if problem.joint_error_var(view, joint) <= 0.0 {
            continue;
        }
        block.twists.set_column(joint, &directions.column(joint));
        info[joint] = block.time_error.add(problem, view, joint);
        own[joint] = state.joint_error[group.view_idx][joint];
    }
    if group.camera_error.is_none() && block.twists.iter().all(|v| *v == 0.0) {
        block.time_error = TimeError::none();
        return 0.0;
    }
    block.has_any = true;
    let mut prior_gradient = -own.component_mul(&info) + block.time_error.pull(&own);
    if let (Some(error), Some([std_m, std_rad])) = (group.camera_error, problem.scales.camera_error_std) {
        block.twists.fixed_view_mut::<6, 6>(0, MAX_JOINTS).fill_diagonal(1.0);
        let d = log(error);
        let weight = Vector6::from_fn(|k, _| if k < 3 { std_m } else { std_rad }.max(1e-9).powi(-2));
        info.fixed_rows_mut::<6>(MAX_JOINTS).copy_from(&weight);
        own.fixed_rows_mut::<6>(MAX_JOINTS).copy_from(&d);
        let gradient = right_jacobian_inverse(&d).tr_mul(&d.component_mul(&weight));
        prior_gradient.fixed_rows_mut::<6>(MAX_JOINTS).copy_from(&-gradient);
    }
    let cost = own.component_mul(&own).dot(&info) - block.time_error.pull(&own).dot(&own);
    block.gradient = block.twists.tr_mul(&sums.g) + prior_gradient;
    // Most views have no error of the camera: the rest of their matrix is one.
    let log_det = if block.moves_camera() {
        block.invert::<N_VIEW_PARAMETERS>(&sums.h, &info)
    } else {
        block.invert::<MAX_JOINTS>(&sums.h, &info)
    };
    block.log_ratio = info.map(f64::ln).sum() - block.time_error.log_det() - log_det;
    cost
}

/// A group whose own parameters are eliminated, with `M`, their own motion, and `M sum H_i`.
struct Eliminated<'a> {
    block: &'a SchurBlock,
    m: Matrix6<f64>,
    shift: Vector6<f64>,
    m_h_sum: Matrix6<f64>,
}

struct LensSums<'a> {
    at: usize,
    infos: &'a [PoseInformation],
    lens_infos: &'a [LensInformation],
    /// Place of the group's first observation.
    first: usize,
    directions: &'a Directions,
    m: Matrix6<f64>,
    shift: Vector6<f64>,
    h_sum: Matrix6<f64>,
    by_lens: SMatrix<f64, 6, 8>,
}

/// Twists of the camera (right, camera frame) by each common direction.
fn directions(Point { problem, corrections, .. }: &Point<'_, '_>, group: &Group<'_>) -> Directions {
    let Group { poses, base_from_camera, .. } = group;
    let sag = &corrections.sag;
    let view = &problem.views[group.view_idx];
    let mut directions = Directions::zeros();
    let center = base_from_camera.translation.vector;
    let torque_changes =
        (!sag.is_rigid()).then(|| problem.loads(group.view_idx).torque_derivatives(poses, sag.tool_load_n));
    let mut by_time = Vector6::zeros();
    for joint in group.joints.clone() {
        let rotation = base_from_camera.rotation.inverse();
        let moved = rotation * poses.point_jacobian(joint, &center) * group.sign;
        let turned = rotation * poses.turn_jacobian(joint) * group.sign;
        let mut twist = Vector6::new(moved.x, moved.y, moved.z, turned.x, turned.y, turned.z);
        if let Some(changes) = &torque_changes {
            twist += sag_twist(group, &sag.bend(&changes[joint]));
        }
        directions.set_column(joint, &twist);
        by_time += twist * view.rate_rad_s[joint];
    }
    directions.fixed_view_mut::<6, 6>(0, MOUNT).copy_from(&group.by_mount);
    directions.set_column(TIME, &by_time);
    directions
}
