//! Arms that several tests share: their views and estimates.

use std::sync::LazyLock;

use nalgebra::Vector3;

use crate::batch::tests::data::titan;
use crate::batch::tests::drawing::{Case, case_changed};
use crate::batch::tests::score_test::{input, with_link};
use crate::explain::drawing::Drawing;
use crate::shared::Shared;
use crate::solve::estimate::{Estimate, estimate};
use crate::solve::input::BundleInput;
use armcal_core::robot::Robot;

static TITAN: LazyLock<Robot> = LazyLock::new(titan);

/// Change of the arm from its nominal model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Built {
    AsDrawn,
    /// The link before this joint is 1 cm longer.
    Longer(usize),
    /// The link before this joint is 1 cm longer and turned.
    LongerAndTurned(usize),
}

impl Built {
    pub fn robot(self) -> Robot {
        match self {
            Self::AsDrawn => TITAN.clone(),
            Self::Longer(joint) => with_link(&TITAN, joint, 0.01, Vector3::zeros()),
            Self::LongerAndTurned(joint) => with_link(&TITAN, joint, 0.01, Vector3::new(0.006, -0.006, 0.003)),
        }
    }
}

/// An arm and its estimate by the nominal model.
pub(crate) struct Arm {
    pub case: &'static Case,
    pub found: Estimate<'static>,
}

impl Arm {
    pub fn input(&self) -> BundleInput<'static> {
        input(&TITAN, &self.case.views, &self.case.model)
    }
}

pub(crate) fn arm(built: Built, seed: u64) -> &'static Arm {
    static ARMS: Shared<(Built, u64), Arm> = Shared::new();
    ARMS.get((built, seed), || {
        let case: &Case = Box::leak(Box::new(case_changed(&TITAN, &built.robot(), seed, |_| {})));
        Arm { case, found: estimate(&input(&TITAN, &case.views, &case.model)).expect("solved") }
    })
}

/// The model that explains the arm's views better, and the estimate by it; `None` if there is none.
pub(crate) fn better(built: Built, seed: u64) -> Option<&'static (Drawing, Estimate<'static>)> {
    static BETTER: Shared<(Built, u64), Option<(Drawing, Estimate<'static>)>> = Shared::new();
    let arm = arm(built, seed);
    let revise = || {
        let drawing = Drawing::default().better(&arm.input(), &arm.found, 0.0)?;
        let mut wider = arm.input();
        drawing.apply(&mut wider);
        let found = estimate(&wider).expect("solved");
        Some((drawing, found))
    };
    BETTER.get((built, seed), revise).as_ref()
}
