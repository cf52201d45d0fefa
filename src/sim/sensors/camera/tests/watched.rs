//! Tags that the arm carries in front of a fixed camera.

use rand::RngExt;

use super::*;
use armcal_core::stats::stream_rng;

#[derive(Clone, Copy, PartialEq)]
enum Links {
    AsDrawn,
    WithoutShapes,
}

/// Returns the watched arm in a random configuration.
fn watched(seed: u64, links: Links, change: impl FnOnce(&mut WorldSpec)) -> Site {
    let mut rng = stream_rng(seed, "configuration");
    let pose = |robot: &mut Robot| {
        let center = |j: usize| robot.sensors[j].center_rad;
        let reach = |j: usize| robot.sensors[j].half_range_rad.min(1.5);
        let angle = |j: usize| center(j) + 0.9 * reach(j) * rng.random_range(-1.0..1.0);
        robot.stowed = JointAngles::from_fn(robot.n_joints(), angle);
        if links == Links::WithoutShapes {
            robot.bodies.iter_mut().for_each(|body| body.collisions.clear());
        }
    };
    site_of("titan4-watched", pose, change)
}

#[test]
fn carried_tags_are_where_their_link_is_and_the_camera_stays() {
    let mut n = 0;
    for seed in 0..60 {
        let site = watched(seed, Links::AsDrawn, |_| {});
        let (_, image) = site.image(&mut site.camera(), 0.2, 1.0);
        let stays = site.built.camera_attachment(&site.robot).link_from_frame;
        assert_eq!(site.camera().base_from_camera(&site.links), stays);
        for tag in &image.tags {
            n += 1;
            assert!(largest_px(&tag.corners_px, &site.drawn_corners(tag.id, 0.0, 0.0)) < 1e-9);
        }
    }
    assert!(n > 20, "{n} tags seen");
}

/// The corners of moving tags are Simpson's mean over the exposure.
#[test]
fn carried_tags_blur_as_they_move() {
    let (mut n, exposure_s, rate_rad_s) = (0, 0.05, 0.3);
    for seed in 0..60 {
        let site = watched(seed, Links::AsDrawn, |spec| spec.camera.exposure_s = exposure_s);
        let (_, image) = site.image(&mut site.camera(), rate_rad_s, 1.0);
        for tag in &image.tags {
            let [start, middle, end] =
                [exposure_s, 0.5 * exposure_s, 0.0].map(|earlier_s| site.drawn_corners(tag.id, rate_rad_s, earlier_s));
            let mean = std::array::from_fn(|k| (start[k] + middle[k] * 4.0 + end[k]) / 6.0);
            assert!(largest_px(&tag.corners_px, &mean) < 1e-9, "tag {}", tag.id);
            assert!((start[0] - end[0]).norm() > 0.5, "it moved");
            n += 1;
        }
    }
    assert!(n > 20, "{n} tags seen");
}

/// The tags that an arm with shapes hides are visible on the same arm without shapes, and it hides no others.
#[test]
fn the_arms_own_links_hide_its_tags() {
    let (mut hidden, mut seen) = (0, 0);
    for seed in 0..120 {
        let [with, without] = [Links::AsDrawn, Links::WithoutShapes].map(|links| {
            let site = watched(seed, links, |_| {});
            all_ids(&site.image(&mut site.camera(), 0.0, 1.0).1)
        });
        assert!(with.iter().all(|id| without.contains(id)), "{with:?} {without:?}");
        (hidden, seen) = (hidden + without.len() - with.len(), seen + with.len());
    }
    assert!(hidden > 10 && seen > 40, "{hidden} hidden, {seen} seen");
}
