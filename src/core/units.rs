//! Units: a figure is stored in the SI unit of its name and shown in a more convenient one.

/// Unit of a figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Shown in millimetres.
    Metres,
    /// Shown in degrees.
    Radians,
    /// Shown as stored.
    Seconds,
    /// Shown as stored.
    Pixels,
    /// Integer, from 0.
    Count,
    /// Ratio of two figures of one unit.
    Ratio,
    /// A number without a unit.
    None,
}

impl Unit {
    /// Returns the factor from the stored value to the shown value.
    #[must_use]
    pub const fn scale(self) -> f64 {
        match self {
            Self::Metres => 1e3,
            Self::Radians => 180.0 / std::f64::consts::PI,
            Self::Seconds | Self::Pixels | Self::Count | Self::Ratio | Self::None => 1.0,
        }
    }

    /// Returns the symbol shown after the number; empty if there is none.
    #[must_use]
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::Metres => "mm",
            Self::Radians => "deg",
            Self::Seconds => "s",
            Self::Pixels => "px",
            Self::Ratio => "x",
            Self::Count | Self::None => "",
        }
    }

    /// Returns the number alone, with `digits` after the point.
    #[must_use]
    pub fn number(self, value: f64, digits: usize) -> String {
        format!("{:.digits$}", value * self.scale())
    }

    /// Returns the number with `digits` after the point, and its unit: `1.25 mm`.
    #[must_use]
    pub fn shown(self, value: f64, digits: usize) -> String {
        format!("{} {}", self.number(value, digits), self.symbol()).trim_end().to_owned()
    }

    /// Returns the number with its unit, or a dash if it was not measured.
    #[must_use]
    pub fn shown_if(self, value: Option<f64>, digits: usize) -> String {
        value.map_or_else(|| "-".to_owned(), |value| self.shown(value, digits))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn people_read_millimetres_and_degrees() {
        assert_eq!(Unit::Metres.shown(0.001_25, 2), "1.25 mm");
        assert_eq!(Unit::Radians.shown(std::f64::consts::PI, 1), "180.0 deg");
        assert_eq!(Unit::Count.shown(3.0, 0), "3");
        assert_eq!(Unit::Pixels.shown_if(None, 2), "-");
    }
}
