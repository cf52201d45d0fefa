//! Advice of a refusal: what to do about its cause.

use std::borrow::Cow;

use crate::say::length_unit::unit_of;
use crate::say::refusal::Refusal;
use crate::say::sensor_keys::Rescaled;

impl Refusal {
    /// Advice to remove the cause.
    #[must_use]
    pub fn remedy(&self) -> Cow<'static, str> {
        match self {
            Self::MisreadReadings(misread) => misread.remedy().into(),
            Self::WrongInput(wrong) => wrong.remedy(),
            Self::SensorLine { joint, slope, input_factor } => {
                let found = Rescaled { joint, slope: *slope, input_factor: *input_factor };
                remedy_of_line(found.with_own_scale_if_reversed()).into()
            }
            Self::SensorUnit { joint, gain, moves, input_factor } => {
                let found = Rescaled { joint, slope: *gain, input_factor: *input_factor };
                format!("convert the readings of {joint}, or {}", found.of_another_unit(*moves).line()).into()
            }
            Self::CornerNoiseUnderstated { residual_px, .. } => {
                format!("state corner_std_px = {residual_px:.2} in [camera] of robot.toml, or check lens and tag map")
                    .into()
            }
            Self::Lens { focal_px: [x, y], .. } => format!(
                "measure the intrinsics in the water or air that the arm works in; these views show focal_px = \
                 [{x:.1}, {y:.1}] for [camera] of robot.toml"
            )
            .into(),
            Self::BeyondTolerance { survey, is_watched, .. } if !survey.is_empty() => {
                let otherwise = if *is_watched { "" } else { ", or put a tag on the gripper" };
                let keys = survey.join(", ");
                format!("measure what no view determines and state its smaller sigma in robot.toml ({keys}){otherwise}")
                    .into()
            }
            _ => self.usual_remedy().into(),
        }
    }

    /// Advice without figures of this result.
    fn usual_remedy(&self) -> &'static str {
        match self {
            Self::MisreadReadings(_)
            | Self::WrongInput(_)
            | Self::Lens { .. }
            | Self::SensorLine { .. }
            | Self::SensorUnit { .. }
            | Self::CornerNoiseUnderstated { .. } => "",
            Self::MovedBetweenViews { body, .. } => body.remedy(),
            Self::TooFewViews { .. } | Self::PriorUntested | Self::BeyondTolerance { is_watched: true, .. } => {
                "capture more views"
            }
            Self::TooFewViewsSinceSlip { .. } => "fasten the sensor on its shaft, then capture more views",
            Self::SlipNotEstimated { .. } => {
                "fasten the sensor on its shaft, then calibrate with --method bundle, which estimates the slip, or \
                 capture again"
            }
            Self::NotSolved { .. } => "capture views that move each joint over more of its range",
            Self::TooFewHeldOutViews { .. } | Self::NoHeldOutTag => "hold out more views that show tags",
            Self::NoBetterThanDatasheet { .. } | Self::NoBetterThanBaseline { .. } => {
                "keep the datasheet values, or check tag map, camera mount and time stamps"
            }
            Self::Overfitted { .. } => "capture more views at other configurations",
            Self::PriorsBeyondTolerance { .. } | Self::BeyondTolerance { .. } => self.remedy_of_tolerance(),
            Self::TargetsNotJudged { .. } => "remove these targets from the task, or free the joints that they need",
            Self::TargetsNotCovered { .. } => "capture views that move these joints as far as the targets need",
            Self::HeldOutError { .. } => {
                "check units, rotation form, joint order and directions in the input map, and the tag map; state the \
                 noise with tags.position_std_m"
            }
            Self::Geometry(geometry) => geometry.remedy(),
            Self::RotationNoise { .. } => {
                "check rotation form, order and direction in the input map, or use the positions only (tags.use)"
            }
            Self::RepairTooLarge { .. } => {
                "check the zeros, order and units of the joint readings; then measure this element and correct its file"
            }
            Self::TagSizeRepair { .. } => "measure the border square of one tag and correct size_m, in metres",
            Self::CornerNoise { .. } => "check lens, corner noise and tag sizes in robot.toml, and the tag map",
            Self::SensorError { .. } | Self::SensorFailed { .. } => "check that joint's sensor",
            Self::Nonlinearity { .. } => "replace the sensor, or state its linearity in robot.toml",
            Self::OffsetsWalk { .. } => {
                "calibrate right before the work and again during it, follow the estimate online, or replace the sensor"
            }
            Self::BeyondDatasheet { .. } => "check joint and sensor, and robot.toml against the installed sensor",
            Self::Outliers { .. } => "check tag map, tag ids, the lens and the URDF",
            Self::Innovations { .. } => "look for what moved or warmed up during the capture",
            Self::Touch { .. } => {
                "measure the tool point ([tool] point_m of robot.toml), the links beyond the camera and the camera \
                 mount"
            }
            Self::Length { measured_m, by_views_m, .. } if unit_of(measured_m / by_views_m).is_some() => {
                "write this length in metres"
            }
            Self::Length { .. } => "measure again, and correct this length or the tags' size_m in robot.toml",
            Self::PriorReused | Self::PriorSingular | Self::PriorContradicted { .. } => self.remedy_of_prior(),
        }
    }

    /// Advice for a result beyond the tolerance.
    fn remedy_of_tolerance(&self) -> &'static str {
        match self {
            Self::PriorsBeyondTolerance { most: Some(most), .. } if most.starts_with("tag survey") => {
                "measure the frame of the tags in the arm's base and state its sigmas in [geometry] of robot.toml, or \
                 touch three surveyed surfaces (step `touch`)"
            }
            Self::PriorsBeyondTolerance { most: Some(most), .. } if most.starts_with("camera mount") => {
                "measure where the camera is and state its smaller sigmas in [camera] of robot.toml (mount_std_m, \
                 mount_std_rad), or touch three surveyed surfaces (step `touch`)"
            }
            Self::PriorsBeyondTolerance { .. } => {
                "put a tag on the gripper, touch three surveyed surfaces (step `touch`), or measure the arm and state \
                 its sigmas in [geometry] of robot.toml"
            }
            _ => "capture more views, or put a tag on the gripper",
        }
    }

    /// Advice for a prior that cannot be used.
    fn remedy_of_prior(&self) -> &'static str {
        match self {
            Self::PriorReused => "give a prior that was made from other views",
            Self::PriorSingular => "make the prior again",
            Self::PriorContradicted { camera_moved: Some(_), .. } => {
                "put the camera back, or calibrate without --prior from as many views as the first time"
            }
            _ => "calibrate without --prior",
        }
    }
}

/// Advice for a sensor that is reversed or of another scale.
fn remedy_of_line(found: Rescaled<'_>) -> String {
    let (joint, line) = (found.joint, found.line());
    match (found.slope, found.input_factor) {
        (-1.0, None) => "swap its ends, or change the sign of its scale in robot.toml".to_owned(),
        (-1.0, Some(_)) => format!("swap its ends, or {line}"),
        _ => format!("correct the scale of {joint}: {line}, or correct the unit of its readings"),
    }
}
