//! First-order lag, exact for inputs that change linearly between its samples.

/// Output that follows an input with a time constant.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Lag {
    last: Option<Sampled>,
}

#[derive(Clone, Copy, Debug)]
struct Sampled {
    input: f64,
    output: f64,
}

impl Lag {
    /// Returns the output `elapsed_s` after the last sample. Before the first sample it has settled.
    pub(crate) fn follow(&mut self, input: f64, elapsed_s: f64, lag_s: f64) -> f64 {
        let output = match self.last {
            Some(last) if lag_s > 0.0 => {
                let elapsed_s = elapsed_s.max(f64::MIN_POSITIVE);
                // Behind a linear change, the output settles with a delay of one lag.
                let late = lag_s * (input - last.input) / elapsed_s;
                let unsettled = last.output - (last.input - late);
                input - late + unsettled * (-elapsed_s / lag_s).exp()
            }
            _ => input,
        };
        self.last = Some(Sampled { input, output });
        output
    }
}
