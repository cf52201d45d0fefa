//! Arrays with one value per joint.

use std::marker::PhantomData;
use std::ops::{Deref, DerefMut};

/// The most joints that an arm may have; arrays of this size live on the stack, so that loops do not allocate.
pub const MAX_JOINTS: usize = 8;

/// Unit marker: radians; for a slide metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Radians;
/// Unit marker: raw sensor counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Counts;

/// Array with one value per joint in the order of the chain, base first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointArray<U> {
    n: usize,
    values: [f64; MAX_JOINTS],
    unit: PhantomData<U>,
}

/// Angles of the joints, rad; for a slide the travel along its axis, m.
pub type JointAngles = JointArray<Radians>;
/// Raw readings of the joint sensors, counts. They are not angles: only a sensor model converts them.
///
/// ```compile_fail
/// use armcal_core::joints::{JointAngles, JointCounts};
/// let counts = JointCounts::from_slice(&[1.0, 2.0]);
/// let angles: JointAngles = counts; // counts are not radians
/// ```
pub type JointCounts = JointArray<Counts>;

impl<U> JointArray<U> {
    /// # Panics
    /// If `values` holds more than [`MAX_JOINTS`]; readers of files check this first.
    #[must_use]
    pub fn from_slice(values: &[f64]) -> Self {
        assert!(values.len() <= MAX_JOINTS, "{} joints exceed {MAX_JOINTS}", values.len());
        let mut array = Self::zeros(values.len());
        array.copy_from_slice(values);
        array
    }

    /// # Panics
    /// If `n` exceeds [`MAX_JOINTS`].
    #[must_use]
    pub fn zeros(n: usize) -> Self {
        assert!(n <= MAX_JOINTS, "{n} joints exceed {MAX_JOINTS}");
        Self { n, values: [0.0; MAX_JOINTS], unit: PhantomData }
    }

    /// Builds each entry from its joint index.
    #[must_use]
    pub fn from_fn(n: usize, f: impl FnMut(usize) -> f64) -> Self {
        let mut array = Self::zeros(n);
        for (value, new) in array.iter_mut().zip((0..n).map(f)) {
            *value = new;
        }
        array
    }

    /// Returns the largest absolute difference of any joint.
    #[must_use]
    pub fn max_abs_difference(&self, other: &Self) -> f64 {
        self.iter().zip(other.iter()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }
}

impl<U> Deref for JointArray<U> {
    type Target = [f64];
    fn deref(&self) -> &[f64] {
        &self.values[..self.n]
    }
}

impl<U> DerefMut for JointArray<U> {
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.values[..self.n]
    }
}
