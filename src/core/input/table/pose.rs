//! Conversion of a row's numbers to a pose.

use nalgebra::{Isometry3, Matrix3, Quaternion, Translation3, UnitQuaternion, Vector3};

use crate::input::map::QUATERNION_LENGTH_TOLERANCE;
use crate::input::map::{Direction, PoseColumns, RotationForm};

/// Returns `camera_from_tag` of a row; the rotation is the identity if the table has none. The error is the end of a
/// sentence about the row.
pub(super) fn camera_from_tag(
    layout: &PoseColumns,
    position: impl Iterator<Item = f64>,
    rotation: &[f64],
) -> Result<Isometry3<f64>, String> {
    let position = Vector3::from_iterator(position) * layout.position_unit_m;
    let rotation = match &layout.rotation {
        None => UnitQuaternion::identity(),
        Some(columns) => {
            let in_rad: Vec<f64> = rotation.iter().map(|value| value * columns.unit_rad).collect();
            unit_quaternion(columns.form, &in_rad)?
        }
    };
    let given = Isometry3::from_parts(Translation3::from(position), rotation);
    Ok(match layout.direction {
        Direction::CameraFromTag => given,
        Direction::TagFromCamera => given.inverse(),
    })
}

/// Converts a rotation to a quaternion. `values` has the number of elements of the form, angles in rad.
fn unit_quaternion(form: RotationForm, values: &[f64]) -> Result<UnitQuaternion<f64>, String> {
    Ok(match (form, values) {
        (RotationForm::QuaternionWxyz, &[w, x, y, z]) | (RotationForm::QuaternionXyzw, &[x, y, z, w]) => {
            let quaternion = Quaternion::new(w, x, y, z);
            let length = quaternion.norm();
            if (length - 1.0).abs() > QUATERNION_LENGTH_TOLERANCE {
                return Err(format!("the quaternion has the length {length}, not 1 within 1 %"));
            }
            UnitQuaternion::from_quaternion(quaternion)
        }
        (RotationForm::RotationVector, values) => UnitQuaternion::from_scaled_axis(Vector3::from_column_slice(values)),
        (RotationForm::FixedXyz, &[x, y, z]) => UnitQuaternion::from_euler_angles(x, y, z),
        (_, values) => {
            let matrix = Matrix3::from_row_slice(values);
            let off = (matrix.transpose() * matrix - Matrix3::identity()).amax();
            if off > 2.0 * QUATERNION_LENGTH_TOLERANCE || matrix.determinant() < 0.0 {
                return Err(format!(
                    "the matrix is no rotation: determinant {}, its rows are off square by {off}",
                    matrix.determinant()
                ));
            }
            UnitQuaternion::from_matrix(&matrix)
        }
    })
}
