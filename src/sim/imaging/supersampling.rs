//! Radiance of a pixel on an edge: the mean over samples of position and time.

use crate::imaging::math::{Lanes, Rgb, Vec3};
use crate::imaging::scene::{Appearance, Object, SAMPLES, farthest, first_met, offset};
use crate::imaging::shader::Shade;
use crate::imaging::shading::{Intersection, ShadeCache};
use crate::imaging::shape::FACE_BITS;
use crate::imaging::shape::Form;
use crate::imaging::tag_board;
use crate::imaging::tracer::Tracer;

/// Rays of one pixel's samples, and the objects that they meet.
struct Samples {
    /// Column and row of the pixel.
    pixel: [usize; 2],
    lanes: Lanes<SAMPLES>,
    range: [f32; SAMPLES],
    /// Number of the object plus one; 0 is open water.
    number: [u16; SAMPLES],
}

/// Returns the positions of the bits that are set.
fn ones(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let k = bits.trailing_zeros() as usize;
        bits &= bits.wrapping_sub(1);
        (k < SAMPLES).then_some(k)
    })
}

impl Samples {
    fn new(tracer: &Tracer, candidates: &[(f32, u16)], column: usize, row: usize) -> Self {
        let (here, across, down) = tracer.rays.with_slopes(column, row);
        let mut lanes: Lanes<SAMPLES> = [[0.0; SAMPLES]; 3];
        for (axis, lane) in lanes.iter_mut().enumerate() {
            for (k, lane) in lane.iter_mut().enumerate() {
                let [dx, dy, _] = offset(k);
                *lane = here[axis] + across[axis] * dx + down[axis] * dy;
            }
        }
        let is_moving = candidates.iter().any(|(_, n)| tracer.objects[usize::from(*n)].moving.is_some());
        let (range, number) = if is_moving {
            met_in_motion(tracer.objects, candidates, &lanes)
        } else {
            first_met(tracer.objects, candidates, &lanes)
        };
        Self { pixel: [column, row], lanes, range, number }
    }

    fn ray(&self, k: usize) -> Vec3 {
        Vec3::new(self.lanes[0][k], self.lanes[1][k], self.lanes[2][k])
    }
}

impl Tracer<'_> {
    /// Returns the mean radiance over a pixel and the exposure.
    pub(super) fn sampled(&self, found: &[(f32, u16)], column: usize, row: usize, known: &mut ShadeCache) -> Rgb {
        let samples = Samples::new(self, found, column, row);
        let mut sum = [0.0; 3];
        let mut left = u32::MAX;
        while left != 0 {
            let number = samples.number[left.trailing_zeros() as usize];
            let mine = (0..SAMPLES).fold(0_u32, |bits, k| bits | u32::from(samples.number[k] == number) << k);
            left &= !mine;
            let mean = match number.checked_sub(1) {
                None => self.shader.open(column, row).veil,
                Some(n) => self.sampled_object(n, mine, &samples, known),
            };
            let share = mine.count_ones() as f32 / SAMPLES as f32;
            (0..3).for_each(|c| sum[c] += share * mean[c]);
        }
        sum
    }

    /// Returns the mean over the samples in `mine`, which all meet object `n`.
    fn sampled_object(&self, n: u16, mine: u32, samples: &Samples, known: &mut ShadeCache) -> Rgb {
        /// Number of samples that are shaded for all: shading is smooth except at creases.
        const SHADED: u32 = 4;
        let [column, row] = samples.pixel;
        let object = &self.objects[usize::from(n)];
        let is_tag = object.look == Appearance::Tag;
        let every = if is_tag { mine.count_ones() } else { mine.count_ones().div_ceil(SHADED) };
        let mut sum = [0.0; 3];
        let mut n_shaded = 0.0;
        for k in ones(mine).step_by(every as usize) {
            let ray = samples.ray(k);
            let (range_m, face, normal) = object.form.meet(object.place_at(k), &ray, samples.range[k]);
            // The front of a tag is one plane.
            let key = (n + 1) << FACE_BITS | if is_tag { 0 } else { face };
            let shade = known.shade(key, object, || {
                let [shade] = self.shader.shade(&[ray * range_m], &[normal], &[[column, row]]);
                shade
            });
            let radiance = if is_tag {
                printed(object, mine, samples, &shade, face)
            } else {
                shade.radiance(&self.albedo(object, &Intersection { ray, range_m, face, normal }))
            };
            (0..3).for_each(|c| sum[c] += radiance[c]);
            n_shaded += 1.0;
        }
        sum.map(|value| value / n_shaded)
    }
}

/// Returns the mean over the samples in `mine` of a tag whose shade is `shade`.
fn printed(object: &Object, mine: u32, samples: &Samples, shade: &Shade, face: u16) -> Rgb {
    let Form::Tag(board) = object.form else { return shade.radiance(&tag_board::albedo(face)) };
    if face == tag_board::FACE_BACK {
        return shade.radiance(&tag_board::albedo(face));
    }
    let is_black = |k: &usize| {
        let lanes = &samples.lanes;
        let [x, y] = object.place_at(*k).on_plane([lanes[0][*k], lanes[1][*k], lanes[2][*k]]);
        board.face(x, y) == tag_board::FACE_BLACK
    };
    let share = ones(mine).filter(is_black).count() as f32 / mine.count_ones() as f32;
    shade.radiance(&[tag_board::WHITE + share * (tag_board::BLACK - tag_board::WHITE); 3])
}

/// Returns the first intersections like `first_met`, with each sample at its own time.
fn met_in_motion(
    objects: &[Object],
    candidates: &[(f32, u16)],
    lanes: &Lanes<SAMPLES>,
) -> ([f32; SAMPLES], [u16; SAMPLES]) {
    let (mut range, mut number) = ([f32::INFINITY; SAMPLES], [0; SAMPLES]);
    for &(nearest_m, n) in candidates {
        if farthest(&range) < nearest_m {
            break;
        }
        let object = &objects[usize::from(n)];
        for k in 0..SAMPLES {
            let ray = [[lanes[0][k]], [lanes[1][k]], [lanes[2][k]]];
            let [entered] = object.form.enter(object.place_at(k), &ray);
            if entered < range[k] {
                (range[k], number[k]) = (entered, n + 1);
            }
        }
    }
    (range, number)
}
