//! Sentences that describe the truth's faults; the truth has them as in a routine, by kind and values.

use toml::{Table, Value};

use crate::entities::{ARM_FAULT_LANE, SEA_FAULT_LANE, TAG_FAULT_LANE};

/// Part of the world that a fault affects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FaultOf {
    /// Fault of a joint, a sensor, or the camera on the arm.
    Arm,
    Tag,
    /// Fault of the water or the vehicle, or one unknown to this version.
    Sea,
}

/// Fault of the run, with its time.
#[derive(Clone, Debug)]
pub(super) struct Fault {
    pub time_s: f64,
    pub of: FaultOf,
    pub sentence: String,
}

impl FaultOf {
    pub(super) fn of(kind: &str) -> Self {
        let begins = |with: [&str; 5]| with.iter().any(|with| kind.starts_with(with));
        match () {
            () if kind.starts_with("tag_") => Self::Tag,
            () if begins(["sensor_", "joint_", "pressure_", "camera_", "arm_"]) => Self::Arm,
            () => Self::Sea,
        }
    }

    pub(super) fn lane(self) -> &'static str {
        match self {
            Self::Arm => ARM_FAULT_LANE,
            Self::Tag => TAG_FAULT_LANE,
            Self::Sea => SEA_FAULT_LANE,
        }
    }
}

/// Returns the sentence that describes a fault: `sensor_jump`, `by_rad = 0.03, joint = "wrist_pitch"` gives `the sensor
/// of wrist_pitch slipped by 1.72 deg`. A fault unknown to this version is returned as it is written.
pub(super) fn sentence(kind: &str, details: &str) -> String {
    let values: Option<Table> = format!("fault = {{ {details} }}").parse().ok();
    let fault = values.and_then(|mut values| match values.remove("fault") {
        Some(Value::Table(table)) => Some(FaultValues(table)),
        _ => None,
    });
    let told =
        fault.and_then(|fault| fault.of_sensor(kind).or_else(|| fault.of_tag(kind)).or_else(|| fault.other(kind)));
    told.unwrap_or_else(|| format!("{}: {details}", kind.replace('_', " ")))
}

/// Values of a fault by their keys.
struct FaultValues(Table);

impl FaultValues {
    fn text(&self, key: &str) -> Option<&str> {
        self.0.get(key)?.as_str()
    }

    fn number(&self, key: &str) -> Option<f64> {
        number(self.0.get(key)?)
    }

    fn id(&self, key: &str) -> Option<i64> {
        self.0.get(key)?.as_integer()
    }

    /// Returns the length of a vector; zero if there is none.
    fn length(&self, key: &str) -> f64 {
        let parts = self.0.get(key).and_then(Value::as_array).map(Vec::as_slice).unwrap_or_default();
        parts.iter().filter_map(number).map(|part| part * part).sum::<f64>().sqrt()
    }

    /// Returns `by 41.2 mm and 5.7 deg`, or only the part that is not zero.
    fn shift(&self) -> String {
        let (mm, deg) = (1e3 * self.length("by_m"), self.length("by_rad").to_degrees());
        match (mm > 0.0, deg > 0.0) {
            (_, false) => format!("by {mm:.1} mm"),
            (false, true) => format!("by {deg:.1} deg"),
            (true, true) => format!("by {mm:.1} mm and {deg:.1} deg"),
        }
    }

    fn of_sensor(&self, kind: &str) -> Option<String> {
        let deg = |key: &str| self.number(key).map(f64::to_degrees);
        let what = match kind {
            "sensor_jump" => format!("slipped by {:.2} deg", deg("by_rad")?),
            "sensor_stuck" => "is stuck".to_owned(),
            "sensor_dead" => "is dead".to_owned(),
            "sensor_reversed" => "reads the other way".to_owned(),
            "sensor_worn" => format!("is worn about {:.1} deg, by {:.2} deg", deg("at_rad")?, deg("by_rad")?),
            "sensor_dying" => format!("loses contact {} times a second", self.number("dropout_per_s")?),
            _ => return None,
        };
        Some(format!("the sensor of {} {what}", self.text("joint")?))
    }

    fn of_tag(&self, kind: &str) -> Option<String> {
        let what = match kind {
            "tag_lost" => "fell off".to_owned(),
            "tag_moved" => format!("was knocked aside {}", self.shift()),
            "tag_misread" => format!("is read as tag {}", self.id("as_id")?),
            _ => return None,
        };
        Some(format!("tag {} {what}", self.id("id")?))
    }

    fn other(&self, kind: &str) -> Option<String> {
        let force = || Some(format!("{:.0} N for {} s", self.length("force_n"), self.number("duration_s")?));
        Some(match kind {
            "camera_slipped" => format!("the camera slipped on its mount {}", self.shift()),
            "joint_locked" => format!("{} is locked", self.text("joint")?),
            "pressure_lost" => {
                let of =
                    self.text("joint").map_or_else(|| "the pump".to_owned(), |joint| format!("the valve of {joint}"));
                format!("{of} lost {:.0} % of its pressure", 100.0 * self.number("ratio")?)
            }
            "silt" => format!("silt: the camera sees nothing for {} s", self.number("seconds")?),
            "vehicle_knocked" => format!("the vehicle was knocked, {}", force()?),
            "arm_bumped" => format!("{} was bumped, {}", self.text("link")?, force()?),
            _ => return None,
        })
    }
}

fn number(value: &Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|n| n as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_plain_sentences_and_unknown_ones_are_told_as_they_are_written() {
        let faults = [
            ("sensor_jump", "by_rad = 0.03, joint = \"wrist_pitch\""),
            ("sensor_dying", "dropout_per_s = 2.0, joint = \"elbow\""),
            ("tag_moved", "by_m = [0.04, 0.0, 0.01], by_rad = [0.0, 0.0, 0.1], id = 1"),
            ("tag_moved", "by_m = [0.0, 0.003, 0.0], id = 4"),
            ("tag_misread", "as_id = 2, id = 7"),
            ("silt", "seconds = 20.0"),
            ("pressure_lost", "ratio = 0.5"),
            ("arm_bumped", "duration_s = 0.2, force_n = [0.0, 300.0, 400.0], link = \"forearm\""),
            ("hose_cut", "at_m = 1.0"),
            ("sensor_jump", "no values"),
        ];
        let told = faults.map(|(kind, details)| format!("{kind}: {details}\n  {}\n", sentence(kind, details)));
        insta::assert_snapshot!("faults", told.concat());
    }

    #[test]
    fn each_fault_has_its_lane() {
        let lanes = ["sensor_dead", "joint_locked", "pressure_lost", "camera_slipped", "arm_bumped"];
        assert!(lanes.iter().all(|kind| FaultOf::of(kind) == FaultOf::Arm));
        assert_eq!(FaultOf::of("tag_misread").lane(), "/fault_tag");
        assert!(["silt", "vehicle_knocked", "hose_cut"].iter().all(|kind| FaultOf::of(kind) == FaultOf::Sea));
    }
}
