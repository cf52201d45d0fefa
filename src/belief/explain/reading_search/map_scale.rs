//! Sizes and distances of all tags wrong by one factor, as of a map that was made with a wrong size of the tags.
//!
//! The images alone do not show it: tags that are smaller and nearer look the same. The arm does: its camera moves
//! farther than the map says. A line through the camera's positions, by the nominal arm over those by the map, has the
//! factor as its slope; estimates with factors next to it find the last digits.

use nalgebra::Vector3;

use crate::explain::constants::reading_search_map_frame::WIDTH_M;
use crate::explain::constants::reading_search_map_scale::{
    FARTHEST, FIRST_STEP, LAST_STEP, LEAST, MIN_CORRELATION, MIN_POSITIONS, ROUNDS,
};
use crate::explain::reading_search::map_frame::angles_by_nominal;
use crate::views::view::{TagMeasurement, View};
use armcal_core::robot::Robot;
use armcal_core::spatial::Pose;

/// Factor of all sizes and distances of the tags, with the point of the map that stays at one of the base frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MapScale {
    pub factor: f64,
    /// Mean position of the camera by the arm, base frame, m.
    arm_m: Vector3<f64>,
    /// Mean position of the camera by the map as stated, m.
    map_m: Vector3<f64>,
}

/// Camera's position by the arm and by the map, base frame, m.
type Positions = (Vector3<f64>, Vector3<f64>);

impl MapScale {
    /// Scale by the nominal arm; `None` where it is near 1, or where the views do not show one.
    pub fn by_arm(robot: &Robot, views: &[View]) -> Option<Self> {
        let positions: Vec<Positions> = views.iter().flat_map(|view| positions(robot, view)).collect();
        if positions.len() < MIN_POSITIONS {
            return None;
        }
        let mut weights = vec![1.0; positions.len()];
        let mut found = line(&positions, &weights)?;
        for _ in 0..ROUNDS {
            let weight = |(by_arm, by_map): &Positions| {
                let off_m = (found.place_m(by_map) - by_arm).norm();
                1.0 / (1.0 + (off_m / WIDTH_M).powi(2))
            };
            weights = positions.iter().map(weight).collect();
            found = line(&positions, &weights)?;
        }
        found.is_large().then_some(found)
    }

    /// Returns true if the factor is not that of a good survey.
    pub fn is_large(&self) -> bool {
        self.factor.ln().abs() > LEAST
    }

    /// Returns the best of the factors about this one by `score`, which is lower for a better one.
    pub fn refined(self, mut score: impl FnMut(Self) -> Option<f64>) -> Option<Self> {
        let n = (FARTHEST / FIRST_STEP).round() as i32;
        let all = (-n..=n).map(|k| self.times((FIRST_STEP * f64::from(k)).exp()));
        let scored = all.filter_map(|one| Some((score(one)?, one)));
        let mut best = scored.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let mut step = FIRST_STEP / 2.0;
        while step > LAST_STEP {
            let beside = [-step, step].map(|by| best.1.times(by.exp()));
            let scored = beside.into_iter().filter_map(|one| Some((score(one)?, one)));
            best = scored.chain([best]).min_by(|a, b| a.0.total_cmp(&b.0))?;
            step /= 2.0;
        }
        Some(best.1)
    }

    fn times(self, ratio: f64) -> Self {
        Self { factor: self.factor * ratio, ..self }
    }

    /// Returns the position in the base frame of a point of the map, m.
    fn place_m(&self, stated_m: &Vector3<f64>) -> Vector3<f64> {
        self.arm_m + self.factor * (stated_m - self.map_m)
    }

    /// Returns the arm with the tags so scaled.
    pub fn of_robot(&self, robot: &Robot) -> Robot {
        let mut robot = robot.clone();
        for tag in robot.tags.iter_mut().filter(|tag| tag.is_known()) {
            let mut pose = *tag.base_from_tag.isometry();
            pose.translation.vector = self.place_m(&pose.translation.vector);
            tag.base_from_tag = Pose::from_isometry(pose);
            tag.size_m *= self.factor;
        }
        robot
    }

    /// Returns the views with the tags so scaled.
    pub fn of_views(&self, views: &[View]) -> Vec<View> {
        let mut views = views.to_vec();
        for seen in views.iter_mut().flat_map(|view| &mut view.tags) {
            seen.center_in_camera_m *= self.factor;
            if let TagMeasurement::Pose(pose) = &mut seen.measured {
                pose.translation.vector *= self.factor;
            }
        }
        views
    }
}

fn positions(robot: &Robot, view: &View) -> Vec<Positions> {
    let base_from_camera = robot.tags_from(robot.camera_at(view.camera), &angles_by_nominal(robot, view));
    let known = view.tags.iter().filter(|seen| robot.tags[seen.tag_idx].is_known());
    let of_tag = |seen: &crate::views::view::TagObservation| {
        let tag_m = robot.tags[seen.tag_idx].base_from_tag.origin().vector();
        (base_from_camera.translation.vector, tag_m - base_from_camera.rotation * seen.center_in_camera_m)
    };
    known.map(of_tag).collect()
}

/// Line through the positions: its slope is the ratio of their spreads, for both sides have errors.
fn line(positions: &[Positions], weights: &[f64]) -> Option<MapScale> {
    let sum: f64 = weights.iter().sum();
    let mean = |of: fn(&Positions) -> Vector3<f64>| {
        positions.iter().zip(weights).map(|(at, weight)| of(at) * *weight).sum::<Vector3<f64>>() / sum
    };
    let (arm_m, map_m) = (mean(|at| at.0), mean(|at| at.1));
    let products = |of: fn(&Vector3<f64>, &Vector3<f64>) -> f64| {
        let one = |((arm, map), weight): (&Positions, &f64)| weight * of(&(arm - arm_m), &(map - map_m));
        positions.iter().zip(weights).map(one).sum::<f64>()
    };
    let [arm, map, both] =
        [products(|arm, _| arm.norm_squared()), products(|_, map| map.norm_squared()), products(|a, b| a.dot(b))];
    let factor = (arm / map).sqrt();
    let is_line = both / (arm * map).sqrt() > MIN_CORRELATION && factor.is_finite() && factor > 0.0;
    is_line.then_some(MapScale { factor, arm_m, map_m })
}
