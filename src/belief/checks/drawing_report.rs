//! Report of estimated departures from the nominal model: links, base, camera mount and lens.
//!
//! An element is reported if neither its stated covariance S nor its own posterior covariance C explains its estimate
//! z. If the departure is as large as stated, z has the covariance S + C, and `z^T (S + C)^-1 z` is that of three axes.
//! If the nominal model were kept, the sensors' parameters x would follow the posterior's covariance,
//! `dx = C_xz C_zz^-1 z`. The tool error would be the displacement by z and dx together.

use crate::checks::constants::consistency::WORTH_M;
use crate::checks::constants::drawing_report::{
    LEAST_LENGTH_M, MAX_REPAIR_SIGMAS, MAX_SIZE_FACTOR, MAX_UNSTATED_REPAIR_SIGMAS, NAMED_SIGMAS, REACH_M,
};
use nalgebra::{DVector, Matrix3, Vector3};

use crate::explain::drawing::{Drawing, LinkStart};
use crate::explain::score_test::ToolJacobian;
use crate::explain::tags::identity::TagFault;
use crate::explain::wrong_input::map::margin_hint;
use crate::file::calibration::Calibration;
use crate::model::blocks::Block;
use crate::say;
use crate::say::finding::{Finding, FindingKind, FindingUnit};
use crate::say::geometry_error::{BASE, ErrorKind, GeometryError};
use crate::say::refusal::Refusal;
use crate::solve::estimate::Estimate;
use armcal_core::codes::{Coded, Warning};
use armcal_core::joints::JointAngles;
use armcal_core::optics::CameraModel;
use armcal_core::robot::Robot;

mod sag_report;

/// Estimated departure of three numbers from the nominal model.
struct Departure {
    kind: FindingKind,
    name: String,
    unit: FindingUnit,
    size: Vector3<f64>,
    /// Posterior standard deviation along `size`.
    std: f64,
    /// Length of `size` in standard deviations, the stated one and the posterior's combined.
    weight: f64,
    /// Length of `size` over the stated standard deviation.
    sigmas: f64,
    tool_m: Option<f64>,
    /// Length of the link, m.
    length_m: Option<f64>,
    /// Largest allowed repair, in the unit of `sigmas`.
    most_sigmas: f64,
}

impl Estimate<'_> {
    /// Writes departures from the nominal model to `calibration`, the most significant first. `task`: configurations at
    /// which the tool matters. `models`: cameras whose lens is of the other model, with that lens.
    pub(crate) fn report_drawing(
        &self,
        drawing: &Drawing,
        models: &[(usize, CameraModel)],
        task: &[JointAngles],
        calibration: &mut Calibration,
    ) {
        let all = self.link_departures(task).chain(self.mount_departures());
        let mut found: Vec<Departure> = all.collect();
        found.sort_by(|a, b| b.weight.total_cmp(&a.weight));
        let n = found.iter().filter(|departure| departure.weight > NAMED_SIGMAS).count();
        // Several links may share the departure of one, so that none is significant: the most likely is named.
        let is_beyond = drawing.links.as_ref().is_some_and(LinkStart::is_beyond_stated);
        found.truncate(n.max(usize::from(is_beyond)));
        let mut findings: Vec<Finding> = found.iter().map(Departure::finding).collect();
        let mut warnings: Vec<Warning> =
            found.iter().map(|departure| Warning::new(departure.kind.code(), departure.words())).collect();
        if let Some(base) = found.iter().find(|departure| departure.is_undecided()) {
            // The views do not distinguish base and tags, but the tool follows only the base.
            calibration.refuse_first_for([Refusal::Geometry(base.geometry_error(self.problem.robot))]);
        }
        calibration.refuse_for(found.iter().find_map(Departure::beyond_bound));
        calibration.refuse_first_for(self.lenses().filter_map(|(number, at)| self.lens_beyond_bound(number, at)));
        calibration.refuse_for(drawing.tags.iter().find_map(|fault| self.size_beyond_bound(fault)));
        let of_tags = drawing.tags.iter().filter_map(|fault| self.tag_finding(fault));
        let of_lenses = self.lenses().map(|(number, at)| {
            let other = models.iter().find(|(camera, _)| *camera == number);
            other.map_or_else(|| self.lens_finding(number, at), |(_, lens)| self.lens_model_finding(number, lens))
        });
        let left_out = self.left_out_tags().map(|(tag, n)| self.left_out_finding(tag, n));
        for (finding, words) in self.sag_findings(task).into_iter().chain(of_lenses).chain(of_tags).chain(left_out) {
            warnings.push(Warning::new(finding.code(), words));
            findings.push(finding);
        }
        calibration.findings.splice(0..0, findings);
        if let Some(verdict) = &mut calibration.verdict {
            verdict.warnings.extend(warnings);
        }
    }

    fn link_departures(&self, task: &[JointAngles]) -> impl Iterator<Item = Departure> {
        let robot = self.problem.robot;
        let tool = self.tool_jacobians(task);
        let links = self.problem.layout.links.clone();
        let priors = [robot.geometry.link_position_std_m, robot.geometry.link_rotation_std_rad];
        let is_stated = [robot.geometry.stated.link_position, robot.geometry.stated.link_rotation];
        (0..links.len() / 3).map(move |k| {
            let (joint, kind, first) = (k / 2, k % 2, links.start + 3 * k);
            let covariance = self.covariance3(first);
            let size = self.solved.state.joint.fixed_rows::<3>(first).into_owned();
            let name = match joint {
                0 => BASE.to_owned(),
                _ => robot.chain.joints()[joint - 1].child_link.clone(),
            };
            Departure {
                kind: if joint == 0 { FindingKind::Base } else { FindingKind::Link },
                name,
                unit: [FindingUnit::Metre, FindingUnit::Radian][kind],
                sigmas: size.norm() / priors[kind].max(1e-9),
                std: std_along(&covariance, &size),
                weight: sigmas(&covariance, priors[kind], &size),
                tool_m: Some(self.tool_moved_m(&tool, first, &size)),
                length_m: (joint > 0).then(|| self.link_length_m(joint)),
                most_sigmas: if is_stated[kind] { MAX_REPAIR_SIGMAS } else { MAX_UNSTATED_REPAIR_SIGMAS },
                size,
            }
        })
    }

    /// Distance of a joint from its predecessor, m.
    fn link_length_m(&self, joint: usize) -> f64 {
        self.problem.robot.chain.joints()[joint].parent_from_joint.translation.vector.norm()
    }

    fn mount_departures(&self) -> impl Iterator<Item = Departure> {
        let mounts = self.problem.layout.blocks().filter_map(|(block, at)| match block {
            Block::Mount(number) => Some((number, at)),
            _ => None,
        });
        mounts.flat_map(|(number, at)| self.departures_of_mount(number, at))
    }

    /// Shift and rotation of the mount of camera `number`, whose columns begin at `at`.
    fn departures_of_mount(&self, number: usize, at: usize) -> [Departure; 2] {
        let camera = self.problem.robot.camera_at(number);
        let name = match number {
            0 => "camera mount".to_owned(),
            _ => format!("mount of the camera {}", camera.name),
        };
        let priors = [camera.mount_std_m, camera.mount_std_rad];
        let block = Block::Mount(number);
        let off = self.solved.state.blocks[block].off(&self.problem.prior.mean[block]);
        [(at, 0), (at + 3, 1)].map(|(first, kind)| {
            let size = Vector3::from_fn(|axis, _| off[3 * kind + axis]);
            let covariance = self.covariance3(first);
            Departure {
                kind: FindingKind::CameraMount,
                name: name.clone(),
                unit: [FindingUnit::Metre, FindingUnit::Radian][kind],
                sigmas: size.norm() / priors[kind].max(1e-9),
                std: std_along(&covariance, &size),
                weight: sigmas(&covariance, priors[kind], &size),
                size,
                tool_m: None,
                length_m: None,
                most_sigmas: MAX_REPAIR_SIGMAS,
            }
        })
    }

    /// Estimated lenses: the camera's number and the first column.
    fn lenses(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let blocks = self.problem.layout.blocks();
        blocks.filter_map(|(block, at)| if let Block::Lens(number) = block { Some((number, at)) } else { None })
    }

    /// Refusal of a focal length that differs from robot.toml's by more than a repair may.
    fn lens_beyond_bound(&self, number: usize, at: usize) -> Option<Refusal> {
        let (lens, camera) = (self.lens(number), self.problem.robot.camera_at(number));
        let [found_px, stated_px] = [lens, &camera.lens].map(|lens| lens.focal_px()[0]);
        let stated_std = camera.lens_priors.focal_std;
        let ratio = found_px / stated_px;
        let std = self.posterior.covariance[(at, at)].max(0.0).sqrt() / stated_px;
        let most_sigmas = MAX_REPAIR_SIGMAS;
        ((ratio - 1.0).abs() > most_sigmas * stated_std).then(|| Refusal::Lens {
            camera: (number > 0).then(|| camera.name.clone()),
            ratio,
            std,
            stated_std,
            most_sigmas,
            focal_px: lens.focal_px(),
        })
    }

    /// Finding and text on an estimated lens.
    fn lens_finding(&self, number: usize, at: usize) -> (Finding, String) {
        let (lens, camera) = (self.lens(number), self.problem.robot.camera_at(number));
        let drawn = &camera.lens;
        let std = |k: usize| self.posterior.covariance[(at + k, at + k)].max(0.0).sqrt();
        let ratio = lens.focal_px()[0] / drawn.focal_px()[0] - 1.0;
        let shift = [0, 1].map(|k| lens.center_px()[k] - drawn.center_px()[k]);
        let name = if number == 0 { "camera".to_owned() } else { camera.name.clone() };
        let words = format!(
            "{name}: focal length {:+.2} % from robot.toml (sigma {:.2} %), centre {:.1}, {:.1} px; the estimate \
             includes it. Measure the intrinsics again",
            100.0 * ratio,
            100.0 * std(0) / drawn.focal_px()[0],
            shift[0],
            shift[1],
        );
        let (size, unit) = (Some(ratio), Some(FindingUnit::One));
        let kind = FindingKind::Lens;
        (Finding { kind, name, size, unit, tool_error_m: None, time_s: None, repaired: true }, words)
    }

    /// Finding and text on an estimated lens of the other model.
    fn lens_model_finding(&self, number: usize, lens: &CameraModel) -> (Finding, String) {
        let name = if number == 0 { "camera".to_owned() } else { self.problem.robot.camera_at(number).name.clone() };
        let words = say::other_lens_model(&name, lens);
        let (kind, size, unit) = (FindingKind::LensModel, None, None);
        (Finding { kind, name, size, unit, tool_error_m: None, time_s: None, repaired: true }, words)
    }

    /// Finding and text on a tag fault; module `tags::freed` reports moved tags.
    fn tag_finding(&self, fault: &TagFault) -> Option<(Finding, String)> {
        let tags = &self.problem.robot.tags;
        let (kind, name, size, words) = match *fault {
            TagFault::Swapped([a, b]) => {
                let (a, b) = (tags[a].id, tags[b].id);
                let words = format!("tags {a} and {b} are exchanged; the estimate includes it. Correct the survey");
                (FindingKind::TagSwapped, format!("{a} and {b}"), None, words)
            }
            TagFault::Size { tag_idx, ratio } => {
                let (id, size_mm) = (tags[tag_idx].id, 1e3 * tags[tag_idx].size_m);
                let percent = 100.0 * (ratio - 1.0);
                let words = format!(
                    "tag {id} is {size_mm:.1} mm wide, {percent:+.1} % from the survey; the estimate includes it. \
                     Measure it again"
                );
                (FindingKind::TagSize, id.to_string(), Some(ratio - 1.0), words)
            }
            TagFault::AllSizes { ratio } => {
                let percent = 100.0 * (ratio - 1.0);
                let family = self.problem.robot.tag_family;
                let hint = margin_hint(family, ratio).map_or(String::new(), |hint| format!(" ({hint})"));
                let words =
                    format!("all tags are {percent:+.1} % of the survey's size{hint}: taken so; measure one again");
                (FindingKind::TagSize, "all".to_owned(), Some(ratio - 1.0), words)
            }
            TagFault::Moved { .. } | TagFault::Alike { .. } => return None,
        };
        let unit = size.map(|_| FindingUnit::One);
        Some((Finding { kind, name, size, unit, tool_error_m: None, time_s: None, repaired: true }, words))
    }

    /// Refusal of a tag size that differs from the tag map's by more than a repair may.
    fn size_beyond_bound(&self, fault: &TagFault) -> Option<Refusal> {
        let tags = &self.problem.robot.tags;
        let (tag_idx, ratio, element) = match *fault {
            TagFault::Size { tag_idx, ratio } => (tag_idx, ratio, format!("tag {}", tags[tag_idx].id)),
            TagFault::AllSizes { ratio } => (0, ratio, "all tags".to_owned()),
            _ => return None,
        };
        let stated_m = tags[tag_idx].size_m / ratio;
        (ratio.max(ratio.recip()) > MAX_SIZE_FACTOR).then_some(Refusal::TagSizeRepair { element, ratio, stated_m })
    }

    fn left_out_finding(&self, tag_idx: usize, n: usize) -> (Finding, String) {
        let name = self.problem.robot.tags[tag_idx].id.to_string();
        let words = format!(
            "tag {name} is left out: none of its {n} observations fits the others. Check its id, its size and its \
             pose in the tag map"
        );
        let (size, unit) = (Some(n as f64), Some(FindingUnit::One));
        let kind = FindingKind::TagLeftOut;
        (Finding { kind, name, size, unit, tool_error_m: None, time_s: None, repaired: true }, words)
    }

    fn covariance3(&self, first: usize) -> Matrix3<f64> {
        self.posterior.covariance.fixed_view::<3, 3>(first, first).into_owned()
    }

    /// Tool error with the nominal model kept, root mean square over the task, m.
    fn tool_moved_m(&self, tool: &[ToolJacobian], first: usize, size: &Vector3<f64>) -> f64 {
        let n = self.problem.layout.n_joint();
        let Some(inverse) = self.covariance3(first).try_inverse() else { return 0.0 };
        let follow = self.posterior.covariance.view((0, first), (n, 3)) * (inverse * size);
        let square = |at: &ToolJacobian| at.moved_by(&DVector::from_column_slice(follow.as_slice())).norm_squared();
        (tool.iter().map(square).sum::<f64>() / tool.len().max(1) as f64).sqrt()
    }
}

fn std_along(covariance: &Matrix3<f64>, size: &Vector3<f64>) -> f64 {
    let along = size.try_normalize(0.0).unwrap_or_else(Vector3::x);
    (covariance * along).dot(&along).max(0.0).sqrt()
}

/// Length of `size` in standard deviations: `stated_std` on each axis and `covariance` combined.
fn sigmas(covariance: &Matrix3<f64>, stated_std: f64, size: &Vector3<f64>) -> f64 {
    let whole = covariance + Matrix3::identity() * stated_std.powi(2);
    whole.try_inverse().map_or(0.0, |inverse| size.dot(&(inverse * size)).max(0.0).sqrt())
}

impl Departure {
    /// Returns true for a significant base error. The views cannot distinguish it from a common error of all tags, but
    /// the tool error differs.
    fn is_undecided(&self) -> bool {
        let size_m = self.size.norm() * if self.unit == FindingUnit::Radian { REACH_M } else { 1.0 };
        self.kind == FindingKind::Base && self.weight > NAMED_SIGMAS && size_m.max(self.tool_m.unwrap_or(0.0)) > WORTH_M
    }

    /// Refusal of a departure that is too large for a repair.
    fn beyond_bound(&self) -> Option<Refusal> {
        let is_longer = self.unit == FindingUnit::Metre
            && self.length_m.is_some_and(|length_m| self.size.norm() > length_m.max(LEAST_LENGTH_M));
        (self.sigmas > self.most_sigmas || is_longer).then(|| Refusal::RepairTooLarge {
            element: self.name.clone(),
            size: self.size.norm(),
            unit: self.unit,
            stated_std: self.size.norm() / self.sigmas,
            length_m: self.length_m.filter(|_| is_longer),
            most_sigmas: self.most_sigmas,
        })
    }

    fn geometry_error(&self, robot: &Robot) -> GeometryError {
        GeometryError {
            element: self.name.clone(),
            joint: Some(robot.chain.joints()[0].name.clone()),
            error: if self.unit == FindingUnit::Radian { ErrorKind::Turn } else { ErrorKind::Shift },
            size: self.size.into(),
            chi2: self.weight.powi(2),
            limit: NAMED_SIGMAS.powi(2),
            tool_error_m: self.tool_m.unwrap_or(0.0),
        }
    }

    fn finding(&self) -> Finding {
        Finding {
            kind: self.kind,
            name: self.name.clone(),
            size: Some(self.size.norm()),
            unit: Some(self.unit),
            tool_error_m: self.tool_m,
            time_s: None,
            repaired: !self.is_undecided(),
        }
    }

    fn words(&self) -> String {
        let (factor, unit, what) = match self.unit {
            FindingUnit::Radian => (1f64.to_degrees(), "deg", "turned about"),
            _ => (1e3, "mm", "shifted along"),
        };
        let [x, y, z] = <[f64; 3]>::from(self.size * factor);
        let at_tool = self.tool_m.map_or(String::new(), |m| format!(", {:.1} mm at the tool", 1e3 * m));
        format!(
            "{}: {what} its axes by [{x:.2}, {y:.2}, {z:.2}] {unit} (sigma {:.2}) from the nominal model{at_tool}; the \
             estimate includes it. Correct the URDF",
            self.name,
            factor * self.std,
        )
    }
}
