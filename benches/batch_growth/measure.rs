//! Cost of a computation in this process.

/// Least processor time of a measurement, s: a hundred times the error of the system's clock.
const LEAST_S: f64 = 0.4;

/// One measurement.
pub struct Row {
    pub n_detections: usize,
    pub steps: usize,
    pub cost: Cost,
    pub far_end: Option<FarEnd>,
}

#[derive(Clone, Copy)]
pub struct Cost {
    pub cpu_s: f64,
    /// Peak resident memory, less the memory before, MB.
    pub memory_mb: f64,
}

/// Accuracy of the tag that is farthest from the map's anchor tag. Each pair is error and predicted standard deviation,
/// along the corridor and across it; `squared_distance` is the squared Mahalanobis distance of its position.
pub struct FarEnd {
    pub along_mm: [f64; 2],
    pub across_mm: [f64; 2],
    pub squared_distance: f64,
}

impl Row {
    /// Last columns of the table.
    pub fn text(&self) -> String {
        let Row { n_detections, steps, cost: Cost { cpu_s, memory_mb }, far_end } = self;
        let far_end = far_end.as_ref().map_or_else(
            || ",,,,".to_owned(),
            |FarEnd { along_mm: [e, s], across_mm: [f, t], squared_distance }| {
                format!("{e:.3},{s:.3},{f:.3},{t:.3},{squared_distance:.3}")
            },
        );
        format!("{n_detections},{steps},{cpu_s:.6},{memory_mb:.3},{far_end}")
    }
}

/// Result of `compute`, and its cost: repeated if one run is too short for the resolution of the system's clock.
pub fn measured<T>(mut compute: impl FnMut() -> T) -> (T, Cost) {
    let (memory_mb, started_s) = (status_mb("VmRSS:"), processor_s());
    let mut n = 0.0;
    loop {
        let out = compute();
        n += 1.0;
        let spent_s = processor_s() - started_s;
        // NaN ends the loop, too.
        if spent_s.is_nan() || spent_s >= LEAST_S {
            return (out, Cost { cpu_s: spent_s / n, memory_mb: status_mb("VmHWM:") - memory_mb });
        }
    }
}

/// Processor time of this process so far, s, which does not depend on other programs; NaN where the system does not
/// report it.
fn processor_s() -> f64 {
    let text = std::fs::read_to_string("/proc/self/schedstat").unwrap_or_default();
    let nanos: Option<f64> = text.split_whitespace().next().and_then(|word| word.parse().ok());
    nanos.map_or(f64::NAN, |nanos| 1e-9 * nanos)
}

/// A memory figure of this process, MB; NaN where the system does not report it.
fn status_mb(key: &str) -> f64 {
    let text = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = text.lines().find_map(|line| line.strip_prefix(key));
    let kb: Option<f64> = line.and_then(|line| line.split_whitespace().next()?.parse().ok());
    kb.map_or(f64::NAN, |kb| kb * 1024.0 / 1e6)
}
