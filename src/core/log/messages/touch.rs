//! Contact of the tool with a surveyed surface, felt by the arm.

use serde::{Deserialize, Serialize};

use super::basic::{Header, Point, Vector3};
use super::checks::finite;
use crate::log::error::{DecodeRejection, EncodeError};
use crate::log::header::RecordingHeader;
use crate::log::schema::{RosMessage, RosSchema};
use crate::streams::ToolTouch;

/// armcal_msgs/msg/ToolTouch: `header.stamp` is the beginning of the span; `point` and `normal` in `header.frame_id`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Touch {
    /// Beginning of the span, and the frame of `point` and `normal`.
    pub header: Header,
    /// Duration of the contact, s.
    pub duration_s: f64,
    /// Name of the surface, for people.
    pub surface: String,
    /// Any point of the plane, m.
    pub point: Point,
    /// Unit normal out of the surface.
    pub normal: Vector3,
    /// Radius of a ball about the tool point, m; zero if the tip is the tool point.
    pub tip_radius_m: f64,
    /// Standard deviation along the normal, m.
    pub std_m: f64,
}

message!(
    Touch,
    "armcal_msgs/msg/ToolTouch",
    "std_msgs/Header header\nfloat64 duration_s\nstring surface\ngeometry_msgs/Point point\n\
     geometry_msgs/Vector3 normal\nfloat64 tip_radius_m\nfloat64 std_m\n",
    header!(),
    point!(),
    vector3!(),
);

/// Largest deviation of a normal's length from 1.
const LENGTH_TOLERANCE: f64 = 0.01;

pub(in crate::log) fn to_ros(m: &ToolTouch, header: &RecordingHeader) -> Result<Touch, EncodeError> {
    Ok(Touch {
        header: Header::new(m.stamp, &header.base_frame)?,
        duration_s: m.duration_s,
        surface: m.surface.clone(),
        point: m.point_m.into(),
        normal: m.normal.into(),
        tip_radius_m: m.tip_radius_m,
        std_m: m.std_m,
    })
}

pub(in crate::log) fn from_ros(m: Touch) -> Result<ToolTouch, DecodeRejection> {
    let (point_m, normal): ([f64; 3], [f64; 3]) = (m.point.into(), m.normal.into());
    finite("point", point_m)?;
    finite("normal", normal)?;
    finite("duration_s", [m.duration_s])?;
    finite("tip_radius_m", [m.tip_radius_m])?;
    finite("std_m", [m.std_m])?;
    let length = normal.iter().map(|c| c * c).sum::<f64>().sqrt();
    if (length - 1.0).abs() > LENGTH_TOLERANCE {
        return Err(DecodeRejection::NormalLength);
    }
    if m.duration_s < 0.0 {
        return Err(DecodeRejection::MarkSpan);
    }
    if m.std_m <= 0.0 || m.tip_radius_m < 0.0 {
        return Err(DecodeRejection::TouchSize);
    }
    Ok(ToolTouch {
        stamp: m.header.stamp.try_into()?,
        duration_s: m.duration_s,
        surface: m.surface,
        point_m,
        normal,
        tip_radius_m: m.tip_radius_m,
        std_m: m.std_m,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoded(edit: fn(&mut Touch)) -> Result<ToolTouch, DecodeRejection> {
        let normal = Vector3 { x: 0.0, y: 0.0, z: 1.0 };
        let mut touch = Touch { normal, duration_s: 0.5, std_m: 1e-3, ..Touch::default() };
        edit(&mut touch);
        from_ros(touch)
    }

    #[test]
    fn a_touch_without_direction_sigma_or_span_is_rejected() {
        assert!(decoded(|_| ()).is_ok());
        assert_eq!(decoded(|m| m.normal.z = 0.0), Err(DecodeRejection::NormalLength));
        assert_eq!(decoded(|m| m.std_m = 0.0), Err(DecodeRejection::TouchSize));
        assert_eq!(decoded(|m| m.tip_radius_m = -1e-3), Err(DecodeRejection::TouchSize));
        assert_eq!(decoded(|m| m.duration_s = -1.0), Err(DecodeRejection::MarkSpan));
        assert_eq!(decoded(|m| m.point.x = f64::NAN), Err(DecodeRejection::NotFinite { field: "point" }));
        assert_eq!(decoded(|m| m.duration_s = f64::INFINITY), Err(DecodeRejection::NotFinite { field: "duration_s" }));
    }
}
