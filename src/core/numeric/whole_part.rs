//! Whole parts of floats without the range check of a cast, which no vector instruction makes.

/// A float about this large has no fraction: its lowest bits are an integer.
pub const NO_FRACTION: f32 = 12_582_912.0;

/// Returns the whole part of 0 <= x <= 255.
#[inline]
#[must_use]
pub fn whole_part(x: f32) -> u8 {
    let nearest = (x + NO_FRACTION) - NO_FRACTION;
    let whole = if nearest > x { nearest - 1.0 } else { nearest };
    (whole + NO_FRACTION).to_bits() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_whole_part_is_that_of_a_cast() {
        for k in 0..=255_u8 {
            for x in [f32::from(k), f32::from(k) + 0.5, f32::from(k).next_up(), f32::from(k).next_down()] {
                let x = x.clamp(0.0, 255.0);
                assert_eq!(whole_part(x), x as u8, "{x}");
            }
        }
    }
}
