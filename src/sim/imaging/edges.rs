//! Pixels at edges: neighbours that show another face, and pixels that an edge crosses during the exposure.

use rayon::prelude::*;

use crate::imaging::math::max;
use crate::imaging::rays::Rays;
use crate::imaging::scene::Object;
use crate::imaging::tracer::object_of;

/// Largest sweep of a moving edge that is searched, px.
const FARTHEST_SWEEP_PX: usize = 48;

/// Returns the sweep of the edges in the image, px; 0 if nothing moves.
pub(super) fn sweep_px(objects: &[Object], faces: &[u16]) -> usize {
    if objects.iter().all(|object| object.moving.is_none()) {
        return 0;
    }
    let mut is_seen = vec![false; objects.len()];
    faces.iter().filter_map(|face| object_of(*face)).for_each(|n| is_seen[n] = true);
    let seen = objects.iter().zip(&is_seen).filter(|(_, is_seen)| **is_seen);
    let farthest = seen.map(|(object, _)| object.motion_px).fold(0.0, max);
    // The image halfway through the exposure is in the middle of the sweep.
    ((0.5 * farthest).ceil() as usize).min(FARTHEST_SWEEP_PX)
}

/// Marks the pixels within `reach` of an edge.
pub(super) fn mark_swept(rays: &Rays, faces: &[u16], reach: usize, swept: &mut [u8], spare: &mut [u8]) {
    let (width, height) = (rays.width, rays.height);
    spare.par_chunks_mut(width).enumerate().for_each(|(row, line)| {
        spread(width, reach, |x| has_other_face(faces, width, height, x, row), line);
    });
    let spare = &*spare;
    let column = |x: usize| {
        let mut column = vec![0; height];
        spread(height, reach, |row| spare[row * width + x] == 1, &mut column);
        column
    };
    let columns: Vec<Vec<u8>> = (0..width).into_par_iter().map(column).collect();
    swept.par_chunks_mut(width).enumerate().for_each(|(row, line)| {
        line.iter_mut().zip(&columns).for_each(|(mark, column)| *mark = column[row]);
    });
}

/// Returns true if a pixel's neighbourhood shows more than one face.
#[inline]
pub(super) fn has_other_face(faces: &[u16], width: usize, height: usize, column: usize, row: usize) -> bool {
    let own = faces[row * width + column];
    let (left, right) = (column.saturating_sub(1), (column + 1).min(width - 1));
    (row.saturating_sub(1)..=(row + 1).min(height - 1))
        .any(|y| faces[y * width + left..=y * width + right].iter().any(|face| *face != own))
}

/// Sets `out` to 1 within `reach` of each index for which `is_set` is true, else to 0.
fn spread(n: usize, reach: usize, is_set: impl Fn(usize) -> bool, out: &mut [u8]) {
    // Last set index up to k + reach.
    let mut last: Option<usize> = None;
    let mut next = 0;
    for (k, out) in out.iter_mut().enumerate().take(n) {
        while next < n && next <= k + reach {
            if is_set(next) {
                last = Some(next);
            }
            next += 1;
        }
        *out = u8::from(last.is_some_and(|set| set + reach >= k));
    }
}
