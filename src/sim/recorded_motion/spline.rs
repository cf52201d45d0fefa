//! Natural cubic spline through samples at any spacing: twice continuously differentiable.

/// Position and quaternion of one sample.
pub(super) type Value = [f64; 7];

#[derive(Clone, Debug)]
pub(super) struct Spline {
    times_s: Vec<f64>,
    values: Vec<Value>,
    /// Second derivative at each sample; linear in between, zero at both ends.
    bends: Vec<Value>,
}

impl Spline {
    /// Builds the spline from two samples or more, at rising times.
    pub(super) fn natural(times_s: Vec<f64>, values: Vec<Value>) -> Self {
        let bends = bends(&times_s, &values);
        Self { times_s, values, bends }
    }

    pub(super) fn times_s(&self) -> &[f64] {
        &self.times_s
    }

    pub(super) fn end_s(&self) -> f64 {
        self.times_s[self.times_s.len() - 1]
    }

    /// Returns value, first and second derivative at `t_s`, which is between the first sample and the last.
    pub(super) fn at(&self, t_s: f64) -> [Value; 3] {
        let next = self.times_s.partition_point(|&time| time <= t_s).clamp(1, self.times_s.len() - 1);
        let (i, j) = (next - 1, next);
        let h = self.times_s[j] - self.times_s[i];
        let b = (t_s - self.times_s[i]) / h;
        let a = 1.0 - b;
        let (y, m) = (&self.values, &self.bends);
        [
            std::array::from_fn(|k| {
                let bend = (a * a * a - a) * m[i][k] + (b * b * b - b) * m[j][k];
                a * y[i][k] + b * y[j][k] + bend * h * h / 6.0
            }),
            std::array::from_fn(|k| {
                let bend = (3.0 * b * b - 1.0) * m[j][k] - (3.0 * a * a - 1.0) * m[i][k];
                (y[j][k] - y[i][k]) / h + bend * h / 6.0
            }),
            std::array::from_fn(|k| a * m[i][k] + b * m[j][k]),
        ]
    }
}

/// Solves the tridiagonal system of continuous first derivatives, `h- m- + 2 (h- + h+) m + h+ m+ = 6 (slope+ -
/// slope-)`, by elimination from the first sample on.
fn bends(times_s: &[f64], values: &[Value]) -> Vec<Value> {
    let n = times_s.len();
    let mut bends = vec![[0.0; 7]; n];
    let mut share = vec![0.0; n];
    for i in 1..n - 1 {
        let (before, after) = (times_s[i] - times_s[i - 1], times_s[i + 1] - times_s[i]);
        let pivot = 2.0 * (before + after) - before * share[i - 1];
        share[i] = after / pivot;
        bends[i] = std::array::from_fn(|k| {
            let slope_change = (values[i + 1][k] - values[i][k]) / after - (values[i][k] - values[i - 1][k]) / before;
            (6.0 * slope_change - before * bends[i - 1][k]) / pivot
        });
    }
    for i in (1..n - 1).rev() {
        bends[i] = std::array::from_fn(|k| bends[i][k] - share[i] * bends[i + 1][k]);
    }
    bends
}
