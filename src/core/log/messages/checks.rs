//! Checks of numbers that several messages contain.

use super::basic::Quaternion;
use crate::log::error::DecodeRejection;

/// Largest deviation of a quaternion's length from 1. Float32 senders are within 1e-6; a zero quaternion is clearly
/// outside.
const QUATERNION_LENGTH_TOLERANCE: f64 = 0.01;

pub fn finite(field: &'static str, values: impl IntoIterator<Item = f64>) -> Result<(), DecodeRejection> {
    if values.into_iter().all(f64::is_finite) { Ok(()) } else { Err(DecodeRejection::NotFinite { field }) }
}

pub fn variance(value: f64) -> Result<f64, DecodeRejection> {
    finite("variance", [value])?;
    if value < 0.0 { Err(DecodeRejection::NegativeVariance) } else { Ok(value) }
}

/// Returns a quaternion of length 1, within the tolerance, as w, x, y, z.
pub fn unit_quaternion_wxyz(quaternion: &Quaternion) -> Result<[f64; 4], DecodeRejection> {
    let wxyz = quaternion.wxyz();
    finite("orientation", wxyz)?;
    let length = wxyz.iter().map(|c| c * c).sum::<f64>().sqrt();
    if (length - 1.0).abs() > QUATERNION_LENGTH_TOLERANCE {
        return Err(DecodeRejection::QuaternionLength);
    }
    Ok(wxyz)
}
