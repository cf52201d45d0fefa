//! Comparisons of the study, and the paper's own figures for them.

use crate::minimum_variance::Gauge;
use crate::position_method::PositionMethod;
use crate::search::SearchOptions;
use crate::study::contender::{MethodVariant, Solver};
use crate::study::scene::{Guess, PoseSampling, Readings, Setting};

/// Number of draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tier {
    /// Number as published: minutes.
    Full,
    /// The same experiments with few draws: seconds.
    Small,
}

/// Settings and contenders of one table.
#[derive(Clone, Debug)]
pub struct Experiment {
    pub name: &'static str,
    pub title: &'static str,
    pub settings: Vec<Setting>,
    pub contenders: Vec<MethodVariant>,
    pub draws: usize,
}

impl Experiment {
    /// The paper's own figure for the tool error, where it has one for this case; otherwise empty.
    #[must_use]
    pub fn paper_says(&self, setting: &Setting, contender: &MethodVariant) -> &'static str {
        let is_standard = setting.gain_error <= 0.05 && setting.guess == Guess::Datasheet;
        if self.name == "preconditioning" || !is_standard {
            return "";
        }
        match contender.solver {
            Solver::Position(PositionMethod::MinimumVariance) if setting.noise_m == 0.0 => "< 1 mm",
            Solver::Position(PositionMethod::MinimumVariance) if setting.noise_m == 0.01 => "50-150 mm",
            Solver::Position(PositionMethod::MinimumDistance) => "< 1 mm",
            Solver::Position(_) | Solver::Bundle => "",
        }
    }
}

const NOISES_M: [f64; 4] = [0.001, 0.003, 0.01, 0.03];
const SIZES: [(usize, usize); 7] = [(8, 1), (10, 6), (20, 6), (40, 3), (40, 6), (80, 8), (200, 10)];
/// Pairs of gain error, and offset error in deg.
const INITIAL_ERRORS: [(f64, f64); 4] = [(0.01, 1.0), (0.025, 2.5), (0.05, 5.0), (0.10, 10.0)];

/// All tables of the study.
#[must_use]
pub fn experiments(tier: Tier) -> Vec<Experiment> {
    let mut all = of_data(tier);
    all.extend(of_the_search(tier));
    all
}

fn n_draws(tier: Tier, full: usize, small: usize) -> usize {
    if tier == Tier::Full { full } else { small }
}

fn at_1_cm() -> Setting {
    Setting { noise_m: 0.01, ..Setting::default() }
}

fn minimum_variances() -> [MethodVariant; 2] {
    [Gauge::Free, Gauge::Fixed].map(MethodVariant::minimum_variance)
}

/// Every method; minimum variance with its gauge free and fixed.
fn all_methods() -> Vec<MethodVariant> {
    let [free, fixed] = minimum_variances();
    let (distance, squares) = (MethodVariant::minimum_distance(), MethodVariant::least_squares());
    vec![distance, free, fixed, squares, MethodVariant::bundle()]
}

/// Every method that uses the landmarks' surveyed positions.
fn fixed_gauge_methods() -> Vec<MethodVariant> {
    let [_, fixed] = minimum_variances();
    vec![MethodVariant::minimum_distance(), fixed, MethodVariant::least_squares(), MethodVariant::bundle()]
}

/// Tables of noise, numbers and poses.
fn of_data(tier: Tier) -> Vec<Experiment> {
    let standard = Setting::default();
    let sizes = SIZES.iter().filter(|(poses, _)| tier == Tier::Full || *poses < 200);
    vec![
        Experiment {
            name: "no noise",
            title: "Without noise",
            settings: vec![standard, Setting { readings: Readings::WholeCounts, ..standard }],
            contenders: all_methods(),
            draws: n_draws(tier, 100, 8),
        },
        Experiment {
            name: "noise",
            title: "Noise of the positions",
            settings: NOISES_M.iter().map(|&noise_m| Setting { noise_m, ..standard }).collect(),
            contenders: all_methods(),
            draws: n_draws(tier, 200, 12),
        },
        Experiment {
            name: "size",
            title: "Numbers of poses and landmarks, noise 1 cm",
            settings: sizes.map(|&(poses, tags)| Setting { poses, tags, ..at_1_cm() }).collect(),
            contenders: fixed_gauge_methods(),
            draws: n_draws(tier, 200, 8),
        },
        Experiment {
            name: "sight",
            title: "The same from poses that have every landmark in the image, noise 1 cm",
            settings: vec![Setting { sight: PoseSampling::InImage, ..at_1_cm() }],
            contenders: fixed_gauge_methods(),
            draws: n_draws(tier, 200, 8),
        },
    ]
}

/// Tables of the search: its start, its units and its settings.
fn of_the_search(tier: Tier) -> Vec<Experiment> {
    let standard = Setting::default();
    let initial = INITIAL_ERRORS.iter().flat_map(|(gain_error, deg)| {
        let of = Setting { gain_error: *gain_error, offset_error_rad: deg.to_radians(), ..standard };
        [of, Setting { noise_m: 0.01, ..of }]
    });
    let (distance, [free, fixed]) = (MethodVariant::minimum_distance(), minimum_variances());
    let paper = SearchOptions::of_the_paper();
    let starts = SearchOptions { n_starts: 4, ..SearchOptions::default() };
    vec![
        Experiment {
            name: "initial error",
            title: "Error of the first guess",
            settings: initial.collect(),
            contenders: fixed_gauge_methods(),
            draws: n_draws(tier, 60, 6),
        },
        Experiment {
            name: "preconditioning",
            title: "Preconditioning, settings and starts of the search",
            settings: vec![standard, at_1_cm()],
            contenders: vec![
                distance,
                distance.raw("minimum distance, raw units"),
                distance.named("minimum distance, the paper's settings", paper),
                fixed,
                fixed.raw("minimum variance, gauge fixed, raw units"),
                fixed.named("minimum variance, gauge fixed, the paper's settings", paper),
                free.named("minimum variance, gauge free, 4 starts", starts),
            ],
            draws: n_draws(tier, 24, 4),
        },
        Experiment {
            name: "from the truth",
            title: "The search begins at the true sensors (Figure 3, right), noise 1 cm",
            settings: vec![Setting { guess: Guess::Truth, ..at_1_cm() }],
            contenders: all_methods(),
            draws: n_draws(tier, 60, 6),
        },
    ]
}
