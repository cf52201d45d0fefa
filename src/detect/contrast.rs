//! Local contrast normalization of an image, for tags in haze.
//!
//! Each pixel is smoothed slightly; the mean about it is subtracted and the result divided by the standard deviation
//! about it (a window of 51 pixels). The quad search ignores differences of a few grey levels, and a tag in haze has no
//! more.

/// Half of the window, px.
const REACH: usize = 25;
/// Standard deviation after normalization, and the smallest one assumed before it, grey levels.
const TARGET_STD: f32 = 50.0;
const MIN_STD: f32 = 3.0;
/// Weights of a pixel and of its neighbours, a Gaussian of 0.5 px.
const CENTER: f32 = 0.786;
const SIDE: f32 = 0.107;

/// Buffers, reused.
#[derive(Clone, Debug, Default)]
pub(super) struct ContrastNormalizer {
    /// Sum and sum of squares of each column over the rows of the window.
    sums: Vec<[u32; 2]>,
    smooth: Vec<f32>,
}

impl ContrastNormalizer {
    /// Writes the normalized image into rows of `stride` bytes; both images have `width` columns.
    pub(super) fn normalize(&mut self, data: &[u8], width: usize, out: &mut [u8], stride: usize) {
        let height = data.len() / width.max(1);
        self.sums.clear();
        self.sums.resize(width, [0; 2]);
        let row_of = |y: usize| &data[y * width..(y + 1) * width];
        for y in 0..REACH.min(height) {
            add(&mut self.sums, row_of(y));
        }
        for (y, out) in out.chunks_exact_mut(stride).take(height).enumerate() {
            if y + REACH < height {
                add(&mut self.sums, row_of(y + REACH));
            }
            if y > REACH {
                remove(&mut self.sums, row_of(y - REACH - 1));
            }
            let n_rows = (y + REACH + 1).min(height) - y.saturating_sub(REACH);
            let [above, below] = [row_of(y.saturating_sub(1)), row_of((y + 1).min(height - 1))];
            smoothed(above, row_of(y), below, &mut self.smooth);
            normalize_row(&self.sums, n_rows, &self.smooth, &mut out[..width]);
        }
    }
}

fn add(sums: &mut [[u32; 2]], row: &[u8]) {
    for ([sum, square], value) in sums.iter_mut().zip(row) {
        let value = u32::from(*value);
        *sum += value;
        *square += value * value;
    }
}

fn remove(sums: &mut [[u32; 2]], row: &[u8]) {
    for ([sum, square], value) in sums.iter_mut().zip(row) {
        let value = u32::from(*value);
        *sum -= value;
        *square -= value * value;
    }
}

/// Gaussian smoothing by three weights, down, then across.
fn smoothed(above: &[u8], row: &[u8], below: &[u8], out: &mut Vec<f32>) {
    let down = |x: usize| CENTER * f32::from(row[x]) + SIDE * (f32::from(above[x]) + f32::from(below[x]));
    let last = row.len() - 1;
    out.clear();
    let (mut left, mut here) = (down(0), down(0));
    for x in 0..=last {
        let right = if x < last { down(x + 1) } else { here };
        out.push(CENTER * here + SIDE * (left + right));
        (left, here) = (here, right);
    }
}

fn normalize_row(sums: &[[u32; 2]], n_rows: usize, smooth: &[f32], out: &mut [u8]) {
    let width = out.len();
    let (mut sum, mut square) = (0_u32, 0_u32);
    for column in &sums[..REACH.min(width)] {
        sum += column[0];
        square += column[1];
    }
    for x in 0..width {
        if x + REACH < width {
            sum += sums[x + REACH][0];
            square += sums[x + REACH][1];
        }
        if x > REACH {
            sum -= sums[x - REACH - 1][0];
            square -= sums[x - REACH - 1][1];
        }
        let n_columns = (x + REACH + 1).min(width) - x.saturating_sub(REACH);
        let n = (n_rows * n_columns) as f32;
        let mean = sum as f32 / n;
        let std = (square as f32 / n - mean * mean).max(MIN_STD * MIN_STD).sqrt();
        // The cast clamps.
        out[x] = (128.5 + TARGET_STD / std * (smooth[x] - mean)) as u8;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the definition, sum by sum.
    #[test]
    fn normalization_agrees_with_its_definition() {
        let (width, height, stride) = (90_usize, 70_usize, 96_usize);
        let data: Vec<u8> = (0..width * height).map(|i| (i * i / 7 % 97 + i % 50) as u8).collect();
        let mut out = vec![0; stride * height];
        ContrastNormalizer::default().normalize(&data, width, &mut out, stride);
        let at = |x: isize, y: isize| {
            f64::from(data[y.clamp(0, height as isize - 1) as usize * width + x.clamp(0, width as isize - 1) as usize])
        };
        for (x, y) in [(0, 0), (89, 69), (40, 35), (5, 60), (80, 3), (26, 26)] {
            let window: Vec<f64> = (y - 25..=y + 25_isize)
                .flat_map(|y| (x - 25..=x + 25_isize).map(move |x| (x, y)))
                .filter(|(x, y)| (0..width as isize).contains(x) && (0..height as isize).contains(y))
                .map(|(x, y)| at(x, y))
                .collect();
            let n = window.len() as f64;
            let mean = window.iter().sum::<f64>() / n;
            let std = (window.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt().max(3.0);
            let weight = |d: isize| if d == 0 { 0.786 } else { 0.107 };
            let smooth: f64 = (-1..=1)
                .flat_map(|i| (-1..=1).map(move |j| (i, j)))
                .map(|(i, j)| weight(i) * weight(j) * at(x + i, y + j))
                .sum();
            let expected = (128.5 + 50.0 / std * (smooth - mean)).clamp(0.0, 255.0).floor();
            let actual = f64::from(out[y as usize * stride + x as usize]);
            assert!((actual - expected).abs() <= 1.0, "{x} {y}: {actual} {expected}");
        }
    }
}
