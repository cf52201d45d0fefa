//! The cause and the remedy of a wrong input, in words.

use crate::say::constants::wrong_input_words::{NEAR, WATER};
use std::borrow::Cow;
use std::fmt;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::say::wrong_input::{MismatchMeasure, WrongInput, WrongInputKind};

impl WrongInput {
    /// Advice to correct the input.
    #[must_use]
    pub fn remedy(&self) -> Cow<'static, str> {
        let WrongInputKind::TagFrames(turn) = &self.input else { return self.usual_remedy().into() };
        let [w, x, y, z] = turn.map(|value| format!("{value:.4}"));
        format!("multiply quaternion_wxyz of each tag in the tag map by [{w}, {x}, {y}, {z}] from the right").into()
    }

    fn usual_remedy(&self) -> &'static str {
        match &self.input {
            WrongInputKind::TagFrames(_) => "",
            WrongInputKind::MapUnit(_) => "write position_m and position_std_m of the tag map in metres",
            WrongInputKind::MapAxes(_) => "write position_m of the tag map in a right-handed frame",
            WrongInputKind::NegativePixels(_) => {
                "record columns and rows in pixels from the top left corner of the image, or state the lens of the \
                 image that these count from in [camera] of robot.toml"
            }
            WrongInputKind::ImageShares => {
                "multiply the recorded columns and rows by the width and height of the image"
            }
            WrongInputKind::Distortion => {
                "set distortion of [camera] in robot.toml to zeros, and the focal length and centre to those of the \
                 rectified images"
            }
            WrongInputKind::MapQuaternions => "write quaternion_wxyz of the tag map in the order w, x, y, z",
            WrongInputKind::RecordedQuaternions => {
                "set the other one of quaternion_wxyz and quaternion_xyzw as tags.columns.rotation_form of the input \
                 map; in messages, correct the program that writes them"
            }
            WrongInputKind::RecordedDirection => {
                "set the other one of camera_from_tag and tag_from_camera as tags.columns.direction of the input map; \
                 in messages, correct the program that writes them"
            }
            WrongInputKind::RecordedOrderAndDirection => {
                "set the other one of quaternion_wxyz and quaternion_xyzw as tags.columns.rotation_form of the input \
                 map, and of camera_from_tag and tag_from_camera as tags.columns.direction; in messages, correct the \
                 program that writes them"
            }
            WrongInputKind::RecordedRotations => {
                "record the rotation of the tag in the camera's frame as its position is, or use the positions \
                 only (tags.use)"
            }
            WrongInputKind::RecordedUnit(_) => "record positions in metres",
            WrongInputKind::RecordedScale(_) => {
                "measure the border square of one tag and the distance of two; give that size to the program that \
                 recorded the poses, or correct position_m of the tag map"
            }
            WrongInputKind::ImageSize { .. } | WrongInputKind::ImageScale(_) => {
                "state the lens of the recorded image size in [camera] of robot.toml, or record images of the size \
                 that it was measured for"
            }
            WrongInputKind::FocalLength(_) => {
                "measure the intrinsics in the water or air that the arm works in, and state them in [camera] of \
                 robot.toml"
            }
            WrongInputKind::LensModel => "state the model and the distortion of that lens in [camera] of robot.toml",
            WrongInputKind::TagSize(_) => {
                "measure the border square of one tag (of tag36h11 the black one) and the distance of two tags, and \
                 correct size_m or position_m"
            }
            WrongInputKind::ExchangedIds(_) => "give each of them the id that is printed there",
            WrongInputKind::OtherMap => {
                "give the tag map of this site with --tag-map, check the tag ids, or make a map with `armcal tagmap`; \
                 if the map is right, check the lens in [camera] of robot.toml"
            }
        }
    }
}

impl WrongInput {
    /// Causes in recorded poses.
    fn fmt_of_poses(&self, f: &mut fmt::Formatter<'_>, of_pairs: &str) -> fmt::Result {
        let cause = match &self.input {
            WrongInputKind::RecordedUnit(unit) => {
                return write!(
                    f,
                    "the recorded positions of tags are in {unit}, not in metres, by the distances of the tag map"
                );
            }
            WrongInputKind::RecordedScale(factor) => {
                write!(f, "the tags of a view are recorded {factor:.3} times as far apart as the tag map has them: ")?;
                write!(f, "the detector was given {factor:.3} times their size")?;
                self.size_hint.as_ref().map_or(Ok(()), |hint| write!(f, ", {hint}"))?;
                return write!(f, "; or all distances of the tag map are {:.3} times the true ones", 1.0 / factor);
            }
            WrongInputKind::RecordedQuaternions => "the recorded quaternions are in the other order: read so",
            WrongInputKind::RecordedDirection => "the recorded poses are inverse: inverted",
            WrongInputKind::RecordedOrderAndDirection => {
                "the recorded poses are inverse and their quaternions in the other order: read so"
            }
            _ => "the recorded rotations are inverse, the positions are not: read so",
        };
        match self.measure {
            MismatchMeasure::Distances => write!(f, "{cause}, the tags of a view fit each other within {of_pairs}"),
            MismatchMeasure::Positions => {
                let percent = |share: f64| format!("{:.0} %", 100.0 * share);
                let [otherwise, as_written] = [self.mismatch_otherwise.unwrap_or(f64::NAN), self.mismatch].map(percent);
                write!(f, "{cause}, camera and tag are where the arm and the tag map have them within {otherwise} ")?;
                write!(f, "of their distance instead of {as_written}")
            }
            MismatchMeasure::Rotations => {
                let degrees = |rad: f64| format!("{:.0} deg", rad.to_degrees());
                let [otherwise, as_written] = [self.mismatch_otherwise.unwrap_or(f64::NAN), self.mismatch].map(degrees);
                write!(
                    f,
                    "{cause}, the rotations of the landmark over the views agree within {otherwise} instead of "
                )?;
                f.write_str(&as_written)
            }
        }
    }

    /// Causes in the tag map.
    fn fmt_of_map(&self, f: &mut fmt::Formatter<'_>, of_pairs: &str) -> fmt::Result {
        match &self.input {
            WrongInputKind::TagSize(ratio) => {
                write!(f, "the size of all tags differs by {:+.1} % from the stated size", 100.0 * (ratio - 1.0))?;
                self.size_hint.as_ref().map_or(Ok(()), |hint| write!(f, ", {hint}"))?;
                write!(f, "; or all distances of the tag map are {ratio:.3} times the true ones")
            }
            WrongInputKind::MapUnit(unit) => {
                write!(
                    f,
                    "the positions of the tag map are in {unit}, not in metres: so many of them are seen as one metre"
                )
            }
            WrongInputKind::MapAxes(axes) => {
                write!(f, "the positions of the tag map are those of a mirrored frame: read as {axes}, ")?;
                write!(f, "the tags of a view fit each other within {of_pairs}")
            }
            WrongInputKind::TagFrames(turn) => {
                write!(f, "the frames of all tags are turned alike against the tag map, by {}: ", turn_in_words(turn))?;
                write!(f, "turned so, the tags of a view fit each other within {of_pairs}")
            }
            WrongInputKind::ExchangedIds(ids) => {
                let ids: Vec<String> = ids.iter().map(ToString::to_string).collect();
                write!(f, "the tag map has the ids {} exchanged: corrected, ", ids.join(", "))?;
                write!(f, "the tags of a view fit each other within {of_pairs}")
            }
            WrongInputKind::OtherMap => write!(
                f,
                "the tags are not placed as the tag map says: within one view they differ by {} of their distances, \
                 regardless of the arm",
                format_args!("{:.0} %", 100.0 * self.mismatch)
            ),
            _ => Ok(()),
        }
    }
}

/// The cause and its evidence.
impl fmt::Display for WrongInput {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent = |share: f64| format!("{:.0} %", 100.0 * share);
        let otherwise = self.mismatch_otherwise.unwrap_or(f64::NAN);
        let of_pairs = format!("{} of their distances instead of {}", percent(otherwise), percent(self.mismatch));
        match &self.input {
            WrongInputKind::MapQuaternions => {
                write!(
                    f,
                    "the quaternions of the tag map are in the order x, y, z, w: read so, the tags of a view fit "
                )?;
                write!(f, "each other within {of_pairs}")
            }
            WrongInputKind::ImageSize { stated_px: [columns, rows], seen_px: [x, y] } => write!(
                f,
                "the lens of robot.toml belongs to an image of {columns} x {rows} px, but corners reach ({x:.0}, \
                 {y:.0}) px"
            ),
            WrongInputKind::ImageScale(scale) => {
                write!(f, "the lens of robot.toml belongs to an image {scale} times the size of the recorded image: ")?;
                write!(f, "scaled, the tags of a view fit each other within {of_pairs}")
            }
            WrongInputKind::FocalLength(ratio) => {
                write!(f, "the lens is not that of robot.toml: with {ratio:.2} times its focal length ")?;
                write!(f, "the tags of a view fit each other within {of_pairs}{}", medium_of_lens(*ratio))
            }
            WrongInputKind::NegativePixels([x, y]) => write!(
                f,
                "corners of the recording have negative columns or rows, down to ({x:.0}, {y:.0}) px: they do not \
                 count from the image's top left corner"
            ),
            WrongInputKind::ImageShares => {
                f.write_str("all corners of the recording are within 1 px: they are shares of the image, not pixels")
            }
            WrongInputKind::Distortion => {
                write!(f, "the corners come from rectified images: without the distortion of robot.toml ")?;
                write!(f, "the tags of a view fit each other within {of_pairs}")
            }
            WrongInputKind::LensModel => {
                write!(
                    f,
                    "the lens has another model than robot.toml says (fisheye or pinhole): with the other model "
                )?;
                write!(f, "the tags of a view fit each other within {of_pairs}")
            }
            WrongInputKind::RecordedQuaternions
            | WrongInputKind::RecordedDirection
            | WrongInputKind::RecordedOrderAndDirection
            | WrongInputKind::RecordedRotations
            | WrongInputKind::RecordedUnit(_)
            | WrongInputKind::RecordedScale(_) => self.fmt_of_poses(f, &of_pairs),
            _ => self.fmt_of_map(f, &of_pairs),
        }
    }
}

/// `180 deg about x`, `120 deg about (1, 1, -1)`.
pub(crate) fn turn_in_words([w, x, y, z]: &[f64; 4]) -> String {
    let turn = UnitQuaternion::new_normalize(Quaternion::new(*w, *x, *y, *z));
    let axis = turn.axis().map_or(Vector3::z(), |axis| axis.into_inner() / axis.amax());
    let signs = [axis.x, axis.y, axis.z].map(|along| along.round() as i32);
    let name = match signs {
        [1, 0, 0] => "x".to_owned(),
        [-1, 0, 0] => "-x".to_owned(),
        [0, 1, 0] => "y".to_owned(),
        [0, -1, 0] => "-y".to_owned(),
        [0, 0, 1] => "z".to_owned(),
        [0, 0, -1] => "-z".to_owned(),
        [a, b, c] => format!("({a}, {b}, {c})"),
    };
    format!("{:.0} deg about {name}", turn.angle().to_degrees())
}

/// The medium in which a lens shows a focal length of `ratio` times the stated one. Sea water has the refractive index
/// 1.34, by which a flat window in front of the lens multiplies the focal length (Treibitz et al. 2012).
pub(crate) fn medium_of_lens(ratio: f64) -> &'static str {
    match ratio {
        r if (r / WATER - 1.0).abs() < NEAR => ". A lens of air shows this factor in water",
        r if (r * WATER - 1.0).abs() < NEAR => ". A lens of water shows this factor in air",
        _ => "",
    }
}
