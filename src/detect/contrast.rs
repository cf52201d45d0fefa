//! Local contrast normalization of an image, for tags in haze.
//!
//! Each pixel is smoothed slightly; the mean about it is subtracted and the result divided by the standard deviation
//! about it (a window of 51 pixels). The quad search ignores differences of a few grey levels, and a tag in haze has no
//! more.

use armcal_core::numeric::whole_part;

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
    /// Sums of each column over the rows of the window.
    columns: Sums,
    /// Sums of the window about each pixel of a row.
    windows: Sums,
    /// Number of columns in the window about each pixel of a row.
    n_columns: Vec<f32>,
    /// One row smoothed over its neighbours above and below; `smooth` is smoothed across as well.
    down: Vec<f32>,
    smooth: Vec<f32>,
}

/// Sums of grey levels and of their squares: at most `51 * 51 * 255^2`.
#[derive(Clone, Debug, Default)]
struct Sums {
    levels: Vec<i32>,
    squares: Vec<i32>,
}

impl ContrastNormalizer {
    /// Writes the normalized image into rows of `stride` bytes; both images have `width` columns.
    pub(super) fn normalize(&mut self, data: &[u8], width: usize, out: &mut [u8], stride: usize) {
        let height = data.len() / width.max(1);
        self.columns.reset(width);
        self.windows.reset(width);
        self.n_columns.clear();
        self.n_columns.extend((0..width).map(|x| n_within(x, width) as f32));
        let row_of = |y: usize| &data[y * width..(y + 1) * width];
        for y in 0..REACH.min(height) {
            self.columns.add(row_of(y));
        }
        for (y, out) in out.chunks_exact_mut(stride).take(height).enumerate() {
            if y + REACH < height {
                self.columns.add(row_of(y + REACH));
            }
            if y > REACH {
                self.columns.remove(row_of(y - REACH - 1));
            }
            let [above, below] = [row_of(y.saturating_sub(1)), row_of((y + 1).min(height - 1))];
            smoothed([above, row_of(y), below], &mut self.down, &mut self.smooth);
            across(&self.columns.levels, &mut self.windows.levels);
            across(&self.columns.squares, &mut self.windows.squares);
            self.write_row(n_within(y, height) as f32, &mut out[..width]);
        }
    }

    /// Writes one normalized row, by loops that the compiler vectorizes.
    fn write_row(&self, n_rows: f32, out: &mut [u8]) {
        let Sums { levels, squares } = &self.windows;
        let windows = levels.iter().zip(squares).zip(&self.n_columns);
        for ((out, smooth), ((sum, square), n_columns)) in out.iter_mut().zip(&self.smooth).zip(windows) {
            let n = n_rows * n_columns;
            let mean = *sum as f32 / n;
            let std = (*square as f32 / n - mean * mean).max(MIN_STD * MIN_STD).sqrt();
            let level = 128.5 + TARGET_STD / std * (smooth - mean);
            *out = whole_part(level.clamp(0.0, 255.0));
        }
    }
}

impl Sums {
    fn reset(&mut self, n: usize) {
        for sums in [&mut self.levels, &mut self.squares] {
            sums.clear();
            sums.resize(n, 0);
        }
    }

    fn add(&mut self, row: &[u8]) {
        for ((sum, square), value) in self.levels.iter_mut().zip(&mut self.squares).zip(row) {
            let value = i32::from(*value);
            *sum += value;
            *square += value * value;
        }
    }

    fn remove(&mut self, row: &[u8]) {
        for ((sum, square), value) in self.levels.iter_mut().zip(&mut self.squares).zip(row) {
            let value = i32::from(*value);
            *sum -= value;
            *square -= value * value;
        }
    }
}

/// Number of positions within reach of one of `n`.
fn n_within(at: usize, n: usize) -> usize {
    (at + REACH + 1).min(n) - at.saturating_sub(REACH)
}

/// Sums of the columns within reach of each.
fn across(columns: &[i32], out: &mut [i32]) {
    let n = columns.len();
    let mut sum: i32 = columns.iter().take(REACH).sum();
    // Below `full` no column leaves the window; from `last` on none enters it.
    let (full, last) = ((REACH + 1).min(n), n.saturating_sub(REACH));
    for (x, out) in out.iter_mut().enumerate().take(full) {
        sum += columns.get(x + REACH).copied().unwrap_or(0);
        *out = sum;
    }
    let between = full..last.max(full);
    let leaving = columns.iter().zip(columns.iter().skip(2 * REACH + 1));
    for (out, (gone, new)) in out[between.clone()].iter_mut().zip(leaving) {
        sum += new - gone;
        *out = sum;
    }
    for (x, out) in out.iter_mut().enumerate().skip(between.end) {
        sum -= columns[x - REACH - 1];
        *out = sum;
    }
}

/// Gaussian smoothing by three weights, down, then across.
fn smoothed([above, row, below]: [&[u8]; 3], down: &mut Vec<f32>, out: &mut Vec<f32>) {
    let columns = row.iter().zip(above).zip(below);
    down.clear();
    down.extend(
        columns.map(|((row, above), below)| CENTER * f32::from(*row) + SIDE * (f32::from(*above) + f32::from(*below))),
    );
    let last = row.len() - 1;
    let at_end = |x: usize| CENTER * down[x] + SIDE * (down[x.saturating_sub(1)] + down[(x + 1).min(last)]);
    out.clear();
    out.push(at_end(0));
    out.extend(down.windows(3).map(|near| CENTER * near[1] + SIDE * (near[0] + near[2])));
    if last > 0 {
        out.push(at_end(last));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares the running sums with a direct sum over each window.
    #[test]
    fn normalization_agrees_with_its_definition() {
        // The window is larger than the last two.
        for (width, height, stride) in [(90_usize, 70_usize, 96_usize), (40, 30, 40), (20, 9, 24)] {
            let data: Vec<u8> = (0..width * height).map(|i| (i * i / 7 % 97 + i % 50) as u8).collect();
            let mut out = vec![0; stride * height];
            ContrastNormalizer::default().normalize(&data, width, &mut out, stride);
            let at = |x: isize, y: isize| {
                f64::from(
                    data[y.clamp(0, height as isize - 1) as usize * width + x.clamp(0, width as isize - 1) as usize],
                )
            };
            for (x, y) in [(0, 0), (89, 69), (40, 35), (5, 60), (80, 3), (26, 26)]
                .map(|(x, y)| (x % width as isize, y % height as isize))
            {
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
}
