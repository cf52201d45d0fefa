//! Ranges of axes on which the viewer writes at least two numbers.

/// Largest number of powers of ten on an axis: the viewer labels only these, and only if no more of them fit.
const MOST_STEPS: f64 = 4.0;
/// Free margin above and below, as a share of the range: a number at the very edge is cut off.
const MARGIN: f64 = 0.04;

/// Returns a range around `values`; `None` if there are none.
pub(super) fn labelled_range(values: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
    let values = values.filter(|value| value.is_finite());
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    if low > high {
        return None;
    }
    let span = (high - low).max(1e-3);
    let step = 10_f64.powf((span / MOST_STEPS).log10().ceil());
    let has_two = (high / step).floor() - (low / step).ceil() >= 1.0;
    let [low, high] = if has_two {
        [low, high]
    } else {
        let first = (low / step).floor();
        [first, (high / step).ceil().max(first + 1.0)].map(|n| n * step)
    };
    let margin = MARGIN * (high - low);
    Some([low - margin, high + margin])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the number of labels that the viewer writes on an axis.
    fn n_labels([low, high]: [f64; 2]) -> i32 {
        let n = |step: f64| ((high / step).floor() - (low / step).ceil()) as i32 + 1;
        (-6..6).map(|power| 10_f64.powi(power)).find(|step| (high - low) / step <= 1.2 * MOST_STEPS).map_or(0, n)
    }

    #[test]
    fn every_axis_has_two_numbers_at_least_and_all_values() {
        for [low, high] in [[-6.6, 5.2], [4.0, 19.0], [0.0, 151.5], [-0.4, 0.3], [3.9, 4.2], [7.0, 7.0], [-950.0, 30.0]]
        {
            let range = labelled_range([low, high].into_iter()).expect("values");
            assert!(range[0] <= low && range[1] >= high, "{range:?}");
            assert!(n_labels(range) >= 2, "{low} .. {high}: {range:?}");
            assert!(range[1] - range[0] < 12.0 * (high - low).max(0.02), "{low} .. {high}: {range:?}");
        }
        assert_eq!(labelled_range([-6.6, 5.2, f64::NAN].into_iter()), Some([-10.8, 10.8]));
        assert_eq!(labelled_range([f64::NAN].into_iter()), None);
    }
}
