//! Values of elements, and the list of the skipped parts.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::robot::xml_tree::{Element, Place, XmlTree};

/// Largest coordinate of a frame, m. Doubles resolve 15 nm there, finer than any calibration of an arm.
pub(super) const MAX_POSITION_M: f64 = 1e8;
/// Largest angle of a frame, rad. Doubles resolve 1e-12 rad there.
const MAX_ANGLE_RAD: f64 = 1e4;

/// A part of a URDF that was skipped, or replaced by a default.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Skipped {
    /// Name of the link or joint, as ``link `tool` ``.
    pub owner: String,
    pub place: Place,
    /// End of a sentence that begins with the owner.
    pub text: String,
}

/// A frame as `<origin>` states it.
#[derive(Clone, Copy, Debug, Default)]
pub struct UrdfPose {
    pub xyz_m: [f64; 3],
    pub rpy_rad: [f64; 3],
}

impl UrdfPose {
    /// Returns the pose as an isometry.
    pub fn isometry(&self) -> Isometry3<f64> {
        let [roll, pitch, yaw] = self.rpy_rad;
        Isometry3::from_parts(
            Translation3::from(Vector3::from(self.xyz_m)),
            UnitQuaternion::from_euler_angles(roll, pitch, yaw),
        )
    }
}

/// Elements of a file, and the parts skipped so far.
pub(super) struct Scan<'a> {
    tree: &'a XmlTree,
    skipped: Vec<Skipped>,
}

impl<'a> Scan<'a> {
    pub fn new(tree: &'a XmlTree) -> Self {
        Self { tree, skipped: Vec::new() }
    }

    pub fn into_skipped(self) -> Vec<Skipped> {
        self.skipped
    }

    pub fn element(&self, at: usize) -> &'a Element {
        self.tree.element(at)
    }

    /// Returns the elements of URDF directly in another one.
    pub fn children(&self, at: usize) -> impl Iterator<Item = usize> + use<'a> {
        let tree = self.tree;
        tree.children(at).filter(move |&child| tree.element(child).prefix.is_empty())
    }

    pub fn skip(&mut self, owner: &str, at: usize, text: String) {
        self.skipped.push(Skipped { owner: owner.to_owned(), place: self.element(at).place, text });
    }

    /// Returns the first element of that name; further ones are noted as skipped.
    pub fn only(&mut self, owner: &str, at: usize, name: &str) -> Option<usize> {
        let mut found =
            self.children(at).filter(|&child| self.element(child).name == name).collect::<Vec<_>>().into_iter();
        let first = found.next();
        for further in found {
            self.skip(owner, further, format!("a further <{name}> is skipped; the first one is used"));
        }
        first
    }

    /// Notes the elements that `known` does not list.
    pub fn skip_unknown(&mut self, owner: &str, at: usize, known: &[&str]) {
        for child in self.children(at) {
            let name = &self.element(child).name;
            if !known.contains(&name.as_str()) {
                self.skip(owner, child, format!("the element `{name}` is not part of URDF here: skipped"));
            }
        }
    }

    /// Returns the numbers of an attribute; `None` if it is absent.
    ///
    /// # Errors
    /// The end of a sentence that begins with the attribute's element.
    pub fn numbers<const N: usize>(&self, at: usize, attribute: &str) -> Result<Option<[f64; N]>, String> {
        let Some(text) = self.element(at).attribute(attribute) else { return Ok(None) };
        let wrong = || {
            let wanted = if N == 1 { "a number".to_owned() } else { format!("{N} numbers separated by spaces") };
            format!("{attribute} = `{text}` is not {wanted}")
        };
        let values: Option<Vec<f64>> = text.split_whitespace().map(|word| word.parse().ok()).collect();
        values.and_then(|values| values.try_into().ok()).map(Some).ok_or_else(wrong)
    }

    /// Returns the number of an attribute; `None` if it is absent.
    ///
    /// # Errors
    /// The errors of [`Self::numbers`].
    pub fn number(&self, at: usize, attribute: &str) -> Result<Option<f64>, String> {
        Ok(self.numbers::<1>(at, attribute)?.map(|[value]| value))
    }

    /// Returns the frame of an `<origin>`; zero if an attribute is absent.
    ///
    /// # Errors
    /// The errors of [`Self::numbers`], and an error for values that are not finite or too large.
    pub fn pose(&self, origin: usize) -> Result<UrdfPose, String> {
        let xyz_m = self.numbers::<3>(origin, "xyz")?.unwrap_or_default();
        let rpy_rad = self.numbers::<3>(origin, "rpy")?.unwrap_or_default();
        for (name, values, most) in [("xyz", xyz_m, MAX_POSITION_M), ("rpy", rpy_rad, MAX_ANGLE_RAD)] {
            if let Some(value) = values.iter().find(|value| !(value.is_finite() && value.abs() <= most)) {
                return Err(format!("{name} has {value}, and at most {most} is allowed"));
            }
        }
        Ok(UrdfPose { xyz_m, rpy_rad })
    }
}
