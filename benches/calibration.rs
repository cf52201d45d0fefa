//! Estimators on their own: `cargo bench --no-default-features --bench calibration`.
//!
//! Compare figures of one machine only. Comparison with other solvers: benches/peers/README.md.

mod problems;

use std::hint::black_box;

use armcal::calib::bundle::{HyperparameterMode, estimate, least_squares};
use armcal::calib::{PositionMethod, PositionProblem, SearchOptions, determined_by_variance};
use armcal::model::JointParameters;
use criterion::{Criterion, criterion_group, criterion_main};

fn bundle(c: &mut Criterion) {
    let exact = problems::corners(40, 0.0);
    c.bench_function("bundle: least squares, 40 views x 8 tags, 84 parameters", |b| {
        b.iter(|| least_squares(black_box(&exact.input(HyperparameterMode::Given)), 1e-10));
    });
    let all = problems::corners_of_all(40);
    c.bench_function("bundle: the same with links, sag and lens, 131 parameters", |b| {
        b.iter(|| least_squares(black_box(&all.input(HyperparameterMode::Given)), 1e-10));
    });
    let noisy = problems::corners(30, 2e-4);
    c.bench_function("bundle: estimate, sizes fitted, 30 views x 8 tags", |b| {
        b.iter(|| estimate(black_box(&noisy.input(HyperparameterMode::Fitted))));
    });
}

fn positions(c: &mut Criterion) {
    let problem = problems::positions(40, 6);
    let straight = problem.straight();
    let views = PositionProblem::new(&problem.robot, &problem.views);
    let guess = JointParameters::default();
    let options = SearchOptions { rho_end: 1e-6, ..SearchOptions::default() };
    c.bench_function("minimum distance: 40 x 6", |b| {
        b.iter(|| PositionMethod::MinimumDistance.solve(black_box(&views), &straight, &guess, &options));
    });
    let (determined, _) = determined_by_variance(&views, &straight, &guess);
    c.bench_function("minimum variance: 40 x 6", |b| {
        b.iter(|| PositionMethod::MinimumVariance.solve(black_box(&views), &determined, &guess, &options));
    });
}

criterion_group!(benches, bundle, positions);
criterion_main!(benches);
