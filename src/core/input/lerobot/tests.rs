use std::path::Path;

use super::*;

const NEWER: &str = "{\"pan\": {\"id\": 1, \"drive_mode\": 0, \"homing_offset\": -12, \"range_min\": 700, \
    \"range_max\": 3301}, \"lift\": {\"id\": 2, \"drive_mode\": 1, \"homing_offset\": 40, \"range_min\": 900, \
    \"range_max\": 3100}}";
const OLDER: &str = "{\"homing_offset\": [-2048, 1024, 0], \"drive_mode\": [0, 1, 0], \"start_pos\": [0, 0, 1500], \
    \"end_pos\": [1, 1, 2500], \"calib_mode\": [\"DEGREE\", \"DEGREE\", \"LINEAR\"], \
    \"motor_names\": [\"pan\", \"lift\", \"jaw\"]}";

fn read(text: &str, motors: LerobotMotors, values: LerobotValues) -> Result<LerobotCalibration, String> {
    let raw = LerobotToml { file: "arm.json".into(), motors, values };
    LerobotCalibration::parse(Path::new("arm.json"), text, &raw).map_err(|error| error.to_string())
}

/// Uses LeRobot's own equations, inverted.
#[test]
fn numbers_become_the_ticks_that_lerobot_made_them_of() {
    use LerobotMotors::{Dynamixel, Feetech};
    use LerobotValues::{Degrees, Range0To100, RangeM100To100, Ticks};
    for tick in [900.0, 1234.0, 2000.5, 3100.0] {
        let share = |low: f64, high: f64| (tick - low) / (high - low);
        let cases = [
            (Feetech, Degrees, "pan.pos", (tick - 2000.5) * 360.0 / 4095.0),
            (Feetech, Degrees, "lift", (tick - 2000.0) * 360.0 / 4095.0),
            (Feetech, RangeM100To100, "pan", share(700.0, 3301.0) * 200.0 - 100.0),
            (Feetech, RangeM100To100, "lift", 100.0 - share(900.0, 3100.0) * 200.0),
            (Dynamixel, RangeM100To100, "lift", share(900.0, 3100.0) * 200.0 - 100.0),
            (Feetech, Range0To100, "lift", 100.0 - share(900.0, 3100.0) * 100.0),
            (Dynamixel, Range0To100, "lift", share(900.0, 3100.0) * 100.0),
            (Feetech, Ticks, "lift", tick),
        ];
        for (motors, values, name, value) in cases {
            let found = read(NEWER, motors, values).expect("it reads").tick(name, value);
            assert!((found - tick).abs() < 1e-9, "{motors:?} {values:?} {name}: {found} for {tick}");
        }
        let older = [
            (Degrees, "pan", (tick - 2048.0) / 2048.0 * 180.0),
            (Degrees, "lift", (1024.0 - tick) / 2048.0 * 180.0),
            (Range0To100, "jaw", (tick - 1500.0) / 1000.0 * 100.0),
        ];
        for (values, name, value) in older {
            let found = read(OLDER, Feetech, values).expect("it reads").tick(name, value);
            assert!((found - tick).abs() < 1e-9, "{values:?} {name}: {found} for {tick}");
        }
    }
}

/// Uses the motor's own reading under the new offset, by the makers' equations.
#[test]
fn a_homing_offset_moves_the_reading_to_where_it_shall_be() {
    let homing = |text: &str, motors: LerobotMotors, name: &str| {
        let mut found = read(text, motors, LerobotValues::Degrees).expect("it reads");
        found.rehome(name, 2100.0, 2080.0).expect("moved");
        found.form
    };
    for (motors, sign) in [(LerobotMotors::Feetech, -1), (LerobotMotors::Dynamixel, 1)] {
        let Form::Newer(all) = homing(NEWER, motors, "lift.pos") else { panic!("the newer form") };
        // Present = actual + sign * offset; the reading was 2100 under the old offset.
        let actual = 2100 - sign * 40;
        assert_eq!(actual + sign * all["lift"].homing_offset, 2080, "{motors:?}");
        assert_eq!(all["pan"].homing_offset, -12);
    }
    let Form::Older(older) = homing(OLDER, LerobotMotors::Feetech, "lift") else { panic!("the older form") };
    assert_eq!(-2100 + older.homing_offset[1], -2080 + 1024);
    let mut found = read(NEWER, LerobotMotors::Feetech, LerobotValues::Degrees).expect("it reads");
    let told = found.rehome("pan", 4095.0, 0.0).expect_err("too far").to_string();
    assert!(told.contains("pan.homing_offset") && told.contains("2047"), "{told}");
}

#[test]
fn what_is_wrong_is_named_with_file_and_key() {
    let faults = [
        (NEWER, "\"id\": 1, ", ""),
        (NEWER, "\"id\": 1", "\"id\": 1, \"speed\": 3"),
        (NEWER, "\"lift\"", "\"pan\""),
        (NEWER, "3301", "5000"),
        (NEWER, "3301", "700"),
        (NEWER, "-12", "-3000"),
        (NEWER, "-12", "nan"),
        (NEWER, "\"drive_mode\": 1", "\"drive_mode\": 2"),
        (OLDER, "\"lift\"", "\"pan\""),
        (OLDER, "[0, 1, 0]", "[0, 1]"),
        (OLDER, "LINEAR", "ROUND"),
        (OLDER, "2500", "1500"),
        (NEWER, NEWER, "{}"),
        (NEWER, NEWER, "[]"),
    ];
    let told = faults.map(|(good, from, to)| {
        assert!(good.contains(from), "{from}");
        let told = read(&good.replacen(from, to, 1), LerobotMotors::Feetech, LerobotValues::Degrees);
        format!("{from} -> {to}\n  {}\n", told.expect_err("refused"))
    });
    let line = |text, values, name| read(text, LerobotMotors::Feetech, values).expect("it reads").line(name);
    let names = [
        line(NEWER, LerobotValues::Degrees, "elbow").expect_err("unknown").to_string(),
        line(OLDER, LerobotValues::Degrees, "jaw").expect_err("percents").to_string(),
        line(OLDER, LerobotValues::RangeM100To100, "pan").expect_err("degrees").to_string(),
    ];
    insta::assert_snapshot!("lerobot", told.concat() + &names.join("\n"));
}
