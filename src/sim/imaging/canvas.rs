//! Faces, ranges and radiance of all pixels, and the order in which they are computed.

use rayon::prelude::*;

use crate::imaging::edges::{mark_swept, sweep_px};
use crate::imaging::scene::TILE_PX;
use crate::imaging::shading::Band;
use crate::imaging::tracer::{Candidates, Tracer};

/// Face, range and radiance (cd/m2) of each pixel.
#[derive(Clone, Debug, Default)]
pub(super) struct Canvas {
    /// Object and face that the ray through each pixel's centre meets.
    faces: Vec<u16>,
    /// Range, m; infinite in open water.
    pub ranges: Vec<f32>,
    /// 1 where samples are needed although all neighbours are alike.
    swept: Vec<u8>,
    spare: Vec<u8>,
    pub planes: [Vec<f32>; 3],
}

impl Canvas {
    pub(super) fn new(n_pixels: usize) -> Self {
        Self {
            faces: vec![0; n_pixels],
            ranges: vec![f32::INFINITY; n_pixels],
            swept: vec![0; n_pixels],
            spare: vec![0; n_pixels],
            planes: std::array::from_fn(|_| vec![0.0; n_pixels]),
        }
    }

    pub(super) fn trace(&mut self, tracer: &Tracer) {
        let rays = tracer.rays;
        let band = rays.width * TILE_PX;
        let Self { faces, ranges, swept, spare, planes } = self;
        let bands = faces.par_chunks_mut(band).zip(ranges.par_chunks_mut(band)).enumerate();
        let tiles: Vec<Vec<Candidates>> =
            bands.map(|(n, (faces, ranges))| tracer.meet_band(n * TILE_PX, faces, ranges)).collect();
        let sweep_px = sweep_px(tracer.objects, faces);
        if sweep_px > 0 {
            mark_swept(rays, faces, sweep_px, swept, spare);
        }
        let swept = (sweep_px > 0).then_some(&swept[..]);
        let [red, green, blue] = planes;
        let bands = red.par_chunks_mut(band).zip(green.par_chunks_mut(band)).zip(blue.par_chunks_mut(band));
        bands.zip(&tiles).enumerate().for_each(|(n, (((red, green), blue), tiles))| {
            Band { tracer, faces, ranges, swept, top: n * TILE_PX, planes: [red, green, blue] }.shade(tiles);
        });
    }
}
