//! Joint readings that are recorded as angles rather than raw counts.

/// Line from a joint's recorded number to its angle: `angle = unit_rad factor (recorded - zero)`; for a slide, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StatedAngle {
    /// Radians of one unit that the input map states.
    pub unit_rad: f64,
    /// Ratio of angle to reading by the input map; 1 if it states none.
    pub factor: f64,
    /// Recorded number at angle zero.
    pub zero: f64,
}

impl StatedAngle {
    /// Returns the angle of a recorded number.
    #[must_use]
    pub fn angle_rad(&self, recorded: f64) -> f64 {
        self.unit_rad * self.factor * (recorded - self.zero)
    }

    /// Recorded number at an angle.
    #[must_use]
    pub fn recorded(&self, angle_rad: f64) -> f64 {
        self.zero + angle_rad / (self.unit_rad * self.factor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_recorded_at_an_angle_means_that_angle() {
        for (unit_rad, factor, zero) in [(1.0, 1.0, 0.0), (1f64.to_radians(), -0.5, 90.0), (1e-3, 20.0, -4.0)] {
            let stated = StatedAngle { unit_rad, factor, zero };
            for angle_rad in [-2.0, 0.0, 0.7] {
                let back_rad = stated.angle_rad(stated.recorded(angle_rad));
                assert!((back_rad - angle_rad).abs() < 1e-12, "{stated:?}: {angle_rad}");
            }
            assert_eq!(stated.angle_rad(zero), 0.0);
        }
    }
}
