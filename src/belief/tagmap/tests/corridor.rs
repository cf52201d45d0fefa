//! A corridor of tags on two walls, seen piece by piece: error of its far end.

use crate::tagmap::tests::distances;
use crate::tagmap::tests::fixture::{Scene, body, fisheye, look, looking, normal, settings};
use crate::tagmap::{MapView, TagPrior, solve};
use armcal_core::stats::stream_rng;
use armcal_core::time::Stamp;
use nalgebra::{Isometry3, Vector3};

const N_TAGS: u32 = 40;
const N_VIEWS: usize = 200;
const PITCH_M: f64 = 0.25;
const SIZE_M: f64 = 0.2;
const NOISE_PX: f64 = 0.3;

fn corridor(seed: u64) -> Scene {
    let mut rng = stream_rng(seed, "corridor on two walls");
    let truth: Vec<Isometry3<f64>> = (0..N_TAGS)
        .map(|id| {
            let side = if id.is_multiple_of(2) { 1.0 } else { -1.0 };
            let place = Vector3::new(PITCH_M * f64::from(id), side, 0.2 * normal(&mut rng));
            let aim = Vector3::new(0.1 * normal(&mut rng), -side, 0.1 * normal(&mut rng));
            looking(place, place + aim, 0.1 * normal(&mut rng))
        })
        .collect();
    let tags: Vec<_> = truth.iter().enumerate().map(|(id, pose)| (id as u32, SIZE_M, *pose)).collect();
    let (mut views, mut cameras_at) = (Vec::new(), Vec::new());
    for k in 0..N_VIEWS {
        let x = PITCH_M * f64::from(N_TAGS) * k as f64 / N_VIEWS as f64 - 1.5;
        let at = Vector3::new(x, 0.1 * normal(&mut rng), 0.1 * normal(&mut rng));
        // The camera looks from wall to wall as it moves.
        let pose = looking(at, at + Vector3::new(1.0, 0.5 * (4.0 * x).sin(), 0.0), 0.1 * normal(&mut rng));
        let near: Vec<_> = tags.iter().filter(|tag| (0.0..2.5).contains(&(tag.2.translation.x - x))).copied().collect();
        let tags = look(&fisheye(), &pose, &near, NOISE_PX, &mut rng);
        views.push(MapView { camera: 0, stamp: Stamp { nanos: k as i64 }, tags, attitude: None });
        cameras_at.push(pose);
    }
    let prior = |(id, size_m, pose): &(u32, f64, Isometry3<f64>)| {
        let pose = (*id == 0).then_some(*pose);
        TagPrior { id: *id, size_m: *size_m, body: 0, pose, std: None }
    };
    let priors = tags.iter().map(prior).collect();
    Scene { cameras: vec![fisheye()], bodies: vec![body("base")], priors, truth, views, cameras_at }
}

/// Sum over seeds of the last tag's chi-square, three numbers each. Beyond the 99.9 % limits of both sides the model is
/// wrong.
#[test]
fn the_far_end_of_a_corridor_is_off_by_what_is_predicted() {
    let seeds = 0..10;
    let (mut sum, mut first_std_m, mut last_std_m) = (0.0, 0.0, 0.0);
    for seed in seeds.clone() {
        let scene = corridor(seed);
        let map = solve(&scene.input(), &settings()).unwrap();
        assert!(map.has_converged && map.groups.len() == 1, "seed {seed}: {:?}", map.warnings);
        assert_eq!(map.tags.len(), N_TAGS as usize, "seed {seed}");
        assert!(map.n_used * 1000 >= map.n_detections * 998, "seed {seed}: {} of {}", map.n_used, map.n_detections);
        sum += distances(&scene, &map).last().unwrap();
        first_std_m += map.tags[2].position_std_m()[1] / 10.0;
        last_std_m += map.tags[N_TAGS as usize - 1].position_std_m()[1] / 10.0;
    }
    println!("{sum:.1} of {}, {:.2} mm, {:.2} mm", 3 * seeds.count(), 1e3 * first_std_m, 1e3 * last_std_m);
    // Quantiles of chi-square with 30 degrees of freedom.
    assert!((11.6..59.7).contains(&sum), "{sum}");
    assert!(last_std_m > 5.0 * first_std_m);
}
