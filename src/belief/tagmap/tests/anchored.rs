//! Sigmas of a map in a file include those of its anchor.

use std::path::Path;

use nalgebra::{Vector3, Vector6};

use crate::tagmap::files::map_to_text;
use crate::tagmap::tests::fixture::{fisheye, normal, settings, wall};
use crate::tagmap::{MapMode, MapSettings, solve};
use armcal_core::spatial::exp;
use armcal_core::stats::stream_rng;

/// One sigma of the place of tag 0: m, rad.
const STATED: [f64; 2] = [1e-3, 3e-3];

/// Errors of the positions over their standard deviations, axis by axis, of tag 0 and of the others.
fn errors_in_sigmas(seed: u64, mode: MapMode) -> [Vec<f64>; 2] {
    let mut scene = wall(fisheye(), 8, 30, 0.3, seed);
    let mut rng = stream_rng(seed, "survey");
    let [m, rad] = STATED;
    let std = [m, m, m, rad, rad, rad];
    let error = exp(&Vector6::from(std).map(|std| std * normal(&mut rng)));
    scene.priors[0].pose = Some(scene.truth[0] * error);
    scene.priors[0].std = Some(std);
    let map = solve(&scene.input(), &MapSettings { mode, ..settings() }).unwrap();
    let text = map_to_text(Path::new("map.toml"), &map, &scene.input()).unwrap();
    let file: toml::Table = toml::from_str(&text).unwrap();
    assert_eq!(file["anchor_tag"].as_integer(), Some(0), "{text}");
    let mut sigmas = [Vec::new(), Vec::new()];
    for tag in file["tag"].as_array().unwrap() {
        let three = |key: &str| Vector3::from_fn(|k, _| tag[key][k].as_float().unwrap());
        let id = tag["id"].as_integer().unwrap() as usize;
        let off = three("position_m") - scene.truth[id].translation.vector;
        sigmas[usize::from(id > 0)].extend(off.component_div(&three("position_std_m")).iter());
    }
    sigmas
}

#[test]
fn the_error_of_the_anchor_is_in_the_file_for_every_tag() {
    for mode in [MapMode::PartlyKnown, MapMode::Unknown] {
        let mut all = [Vec::new(), Vec::new()];
        for seed in 0..30 {
            let found = errors_in_sigmas(seed, mode);
            all.iter_mut().zip(found).for_each(|(all, found)| all.extend(found));
        }
        // The anchor's errors are 90 independent numbers; those of the other tags of a scene are correlated.
        for (sigmas, bounds) in all.iter().zip([0.75..1.3, 0.65..1.4]) {
            let rms = (sigmas.iter().map(|sigma| sigma * sigma).sum::<f64>() / sigmas.len() as f64).sqrt();
            assert!(bounds.contains(&rms), "{mode:?}: {rms}");
        }
    }
}
