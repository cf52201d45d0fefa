//! The table of falsifications.

use std::f64::consts::PI;

use armcal_core::robot::Robot;

/// One row of the table: kind, element and size of the falsification.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Case {
    pub kind: CaseKind,
    pub element: Element,
    /// Size in rad, m, px, a ratio or a number of views, by [`CaseKind::unit`].
    pub size: f64,
    /// Number of touches of surveyed planes in the calibration: the first ones of the recording.
    pub n_touches: usize,
}

/// Kind of falsification.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum CaseKind {
    /// No falsification: the control.
    GoodArm,
    MountTurned,
    MountShifted,
    TagMoved,
    /// Neighbouring tags moved by the same vector.
    TagsMoved,
    TagSize,
    AllTagSizes,
    IdsSwapped,
    FocalLength,
    ImageCentre,
    LinkShifted,
    LinkTurned,
    ToolShifted,
    GripperAxisTurned,
    BaseShifted,
    BaseTurned,
    /// All tags turned about the base's origin.
    SurveyTurned,
    /// A sensor that keeps its reading from the middle of the capture on.
    SensorStuck,
    SensorDead,
    SensorReversed,
    SensorRescaled,
    /// A sensor that slips for good in the middle of the capture.
    SensorSlipped,
    FewViews,
    /// Twelve views from only this many configurations.
    AlikeViews,
}

/// Element that is falsified.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Element {
    Whole,
    Axis(usize),
    Joint(usize),
    /// An axis of the parent link at the joint's origin.
    JointAxis {
        joint: usize,
        axis: usize,
    },
    /// `n` tags from number `first` of the survey on; each seed begins one tag further on.
    Tags {
        first: usize,
        n: usize,
    },
}

/// Extent of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tier {
    /// About a dozen cases, one or two of a sort.
    Small,
    Full,
}

const DEG: f64 = PI / 180.0;
const MM: f64 = 1e-3;
/// Least number of touches that a calibration uses.
pub(super) const N_TOUCHES: usize = 3;
pub(super) const AXES: [&str; 3] = ["x", "y", "z"];

impl CaseKind {
    pub const ALL: [Self; 24] = [
        Self::GoodArm,
        Self::MountTurned,
        Self::MountShifted,
        Self::TagMoved,
        Self::TagsMoved,
        Self::TagSize,
        Self::AllTagSizes,
        Self::IdsSwapped,
        Self::FocalLength,
        Self::ImageCentre,
        Self::LinkShifted,
        Self::LinkTurned,
        Self::ToolShifted,
        Self::GripperAxisTurned,
        Self::BaseShifted,
        Self::BaseTurned,
        Self::SurveyTurned,
        Self::SensorStuck,
        Self::SensorDead,
        Self::SensorReversed,
        Self::SensorRescaled,
        Self::SensorSlipped,
        Self::FewViews,
        Self::AlikeViews,
    ];

    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::GoodArm => "good arm",
            Self::MountTurned => "mount turned",
            Self::MountShifted => "mount shifted",
            Self::TagMoved => "tag moved",
            Self::TagsMoved => "tags moved together",
            Self::TagSize => "tag size",
            Self::AllTagSizes => "all tag sizes",
            Self::IdsSwapped => "ids swapped",
            Self::FocalLength => "focal length",
            Self::ImageCentre => "image centre",
            Self::LinkShifted => "link shifted",
            Self::LinkTurned => "link turned",
            Self::ToolShifted => "tool point shifted",
            Self::GripperAxisTurned => "gripper axis turned",
            Self::BaseShifted => "base shifted",
            Self::BaseTurned => "base turned",
            Self::SurveyTurned => "survey turned",
            Self::SensorStuck => "sensor stuck",
            Self::SensorDead => "sensor dead",
            Self::SensorReversed => "sensor reversed",
            Self::SensorRescaled => "sensor rescaled",
            Self::SensorSlipped => "sensor slipped",
            Self::FewViews => "few views",
            Self::AlikeViews => "alike views",
        }
    }

    /// Factor from the case's size to the unit that people read, and that unit.
    #[must_use]
    pub fn unit(self) -> (f64, &'static str) {
        match self {
            Self::MountTurned
            | Self::LinkTurned
            | Self::GripperAxisTurned
            | Self::BaseTurned
            | Self::SurveyTurned
            | Self::SensorSlipped => (1.0 / DEG, "deg"),
            Self::MountShifted
            | Self::TagMoved
            | Self::TagsMoved
            | Self::LinkShifted
            | Self::ToolShifted
            | Self::BaseShifted => (1.0 / MM, "mm"),
            Self::TagSize | Self::AllTagSizes | Self::FocalLength => (100.0, "%"),
            Self::ImageCentre => (1.0, "px"),
            Self::FewViews | Self::AlikeViews => (1.0, "views"),
            Self::SensorRescaled => (1.0, "times"),
            Self::GoodArm | Self::IdsSwapped | Self::SensorStuck | Self::SensorDead | Self::SensorReversed => (1.0, ""),
        }
    }
}

pub(super) fn kind_name(kind: CaseKind, n_touches: usize) -> String {
    if n_touches == 0 { kind.name().to_owned() } else { format!("{}, {n_touches} touches", kind.name()) }
}

impl Case {
    fn new(kind: CaseKind, element: Element, size: f64) -> Self {
        Self { kind, element, size, n_touches: 0 }
    }

    /// Name of the kind in words, with its touches.
    #[must_use]
    pub fn kind_name(&self) -> String {
        kind_name(self.kind, self.n_touches)
    }

    /// Survey indices of the tags that the case falsifies, of `n_tags` tags.
    #[must_use]
    pub fn tags(&self, n_tags: usize, seed: u64) -> Vec<usize> {
        let Element::Tags { first, n } = self.element else { return Vec::new() };
        let start = (seed % n_tags.max(1) as u64) as usize + first;
        (0..n).map(|k| (start + k) % n_tags.max(1)).collect()
    }

    /// The element in words.
    #[must_use]
    pub fn element_name(&self, robot: &Robot, seed: u64) -> String {
        let joint_name = |joint: usize| robot.chain.joints()[joint].name.clone();
        match self.element {
            Element::Whole => String::new(),
            Element::Axis(axis) => AXES[axis].to_owned(),
            Element::Joint(joint) => joint_name(joint),
            Element::JointAxis { joint, axis } => format!("{} {}", joint_name(joint), AXES[axis]),
            Element::Tags { .. } => {
                let ids = self.tags(robot.tags.len(), seed).into_iter().map(|idx| robot.tags[idx].id.to_string());
                ids.collect::<Vec<_>>().join("+")
            }
        }
    }
}

/// All cases of a tier for an arm like `robot`.
#[must_use]
pub fn falsified_cases(robot: &Robot, tier: Tier) -> Vec<Case> {
    match tier {
        Tier::Small => small(),
        Tier::Full => full(robot),
    }
}

/// Those of `cases` that touches can reveal, with three touches: falsifications that move the tool against the base at
/// the readings.
#[must_use]
pub fn touched_cases(cases: &[Case]) -> Vec<Case> {
    use CaseKind as K;
    let is_told = |case: &&Case| {
        matches!(
            case.kind,
            K::GoodArm
                | K::MountTurned
                | K::MountShifted
                | K::LinkShifted
                | K::LinkTurned
                | K::ToolShifted
                | K::GripperAxisTurned
                | K::BaseShifted
                | K::BaseTurned
                | K::SurveyTurned
        )
    };
    cases.iter().filter(is_told).map(|case| Case { n_touches: N_TOUCHES, ..*case }).collect()
}

fn tags(first: usize, n: usize) -> Element {
    Element::Tags { first, n }
}

fn small() -> Vec<Case> {
    use CaseKind as K;
    use Element::{Axis, Joint, JointAxis, Whole};
    vec![
        Case::new(K::GoodArm, Whole, 0.0),
        Case::new(K::MountTurned, Axis(1), 5.0 * DEG),
        Case::new(K::MountTurned, Axis(0), 5.0 * DEG),
        Case::new(K::TagMoved, tags(0, 1), 40.0 * MM),
        Case::new(K::AllTagSizes, Whole, 0.1),
        Case::new(K::FocalLength, Whole, 0.02),
        Case::new(K::LinkShifted, JointAxis { joint: 2, axis: 0 }, 10.0 * MM),
        Case::new(K::ToolShifted, Axis(0), 20.0 * MM),
        Case::new(K::SensorDead, Joint(3), 0.0),
        Case::new(K::SensorReversed, Joint(2), 0.0),
        Case::new(K::SensorSlipped, Joint(1), 1.0 * DEG),
        Case::new(K::FewViews, Whole, 10.0),
    ]
}

fn full(robot: &Robot) -> Vec<Case> {
    let mut all = vec![Case::new(CaseKind::GoodArm, Element::Whole, 0.0)];
    all.extend(of_camera());
    all.extend(of_tags());
    all.extend(of_links(robot));
    all.extend(of_sensors(robot));
    for views in [10.0, 12.0] {
        all.push(Case::new(CaseKind::FewViews, Element::Whole, views));
    }
    for configurations in [1.0, 3.0] {
        all.push(Case::new(CaseKind::AlikeViews, Element::Whole, configurations));
    }
    all
}

fn of_camera() -> Vec<Case> {
    let mut all = Vec::new();
    for axis in (0..3).map(Element::Axis) {
        all.extend([1.0, 2.0, 5.0, 8.0].map(|deg| Case::new(CaseKind::MountTurned, axis, deg * DEG)));
        all.push(Case::new(CaseKind::MountShifted, axis, 20.0 * MM));
    }
    all.push(Case::new(CaseKind::FocalLength, Element::Whole, 0.02));
    all.extend([0, 1].map(|axis| Case::new(CaseKind::ImageCentre, Element::Axis(axis), 5.0)));
    all
}

fn of_tags() -> Vec<Case> {
    let mut all = Vec::new();
    for mm in [5.0, 10.0, 40.0] {
        all.extend([0, 3].map(|first| Case::new(CaseKind::TagMoved, tags(first, 1), mm * MM)));
        all.extend([2, 3].map(|n| Case::new(CaseKind::TagsMoved, tags(5, n), mm * MM)));
    }
    for ratio in [0.03, 0.1] {
        all.push(Case::new(CaseKind::TagSize, tags(1, 1), ratio));
        all.push(Case::new(CaseKind::AllTagSizes, Element::Whole, ratio));
    }
    all.extend([0, 4].map(|first| Case::new(CaseKind::IdsSwapped, tags(first, 2), 0.0)));
    all.extend([0, 1, 2].map(|axis| Case::new(CaseKind::SurveyTurned, Element::Axis(axis), DEG)));
    all
}

fn of_links(robot: &Robot) -> Vec<Case> {
    let mut all = Vec::new();
    let n = robot.tool.mount.n_joints;
    for axis in 0..3 {
        for joint in 0..n {
            let element = Element::JointAxis { joint, axis };
            if joint == 0 {
                all.push(Case::new(CaseKind::BaseShifted, element, 10.0 * MM));
                all.push(Case::new(CaseKind::BaseTurned, element, DEG));
                continue;
            }
            all.extend([3.0, 5.0, 10.0].map(|mm| Case::new(CaseKind::LinkShifted, element, mm * MM)));
            all.push(Case::new(CaseKind::LinkTurned, element, DEG));
        }
        all.push(Case::new(CaseKind::ToolShifted, Element::Axis(axis), 20.0 * MM));
        let Some(last) = n.checked_sub(1) else { continue };
        // A turn about the joint's own axis is an offset.
        let joint = &robot.chain.joints()[last];
        if (joint.parent_from_joint.rotation * joint.axis)[axis].abs() < 0.5 {
            let element = Element::JointAxis { joint: last, axis };
            all.push(Case::new(CaseKind::GripperAxisTurned, element, 2.0 * DEG));
        }
    }
    all
}

fn of_sensors(robot: &Robot) -> Vec<Case> {
    let mut all = Vec::new();
    for joint in (0..robot.camera.mount.n_joints).map(Element::Joint) {
        let sudden = [CaseKind::SensorStuck, CaseKind::SensorDead, CaseKind::SensorReversed];
        all.extend(sudden.map(|kind| Case::new(kind, joint, 0.0)));
        all.extend([0.5, 1.5].map(|gain| Case::new(CaseKind::SensorRescaled, joint, gain)));
        all.extend([0.1, 0.3, 1.0, 2.0].map(|deg| Case::new(CaseKind::SensorSlipped, joint, deg * DEG)));
    }
    all
}
