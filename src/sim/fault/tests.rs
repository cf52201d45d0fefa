//! Fault tables and impulses.

use std::path::Path;

use crate::fault::*;
use crate::spec::WorldSpec;

#[test]
fn a_fault_of_the_list_reads_back_and_misspelt_keys_are_refused() {
    let text = "[[fault]]\nat_s = 120\nkind = \"tag_moved\"\nid = 3\nby_m = [0.01, 0, 0]\n\
                [[fault]]\nkind = \"silt\"\nseconds = 2.5\n";
    let read = |text: &str| read_list(&text.parse().expect("TOML"), Path::new("r.toml"));
    let faults = read(text).expect("valid");
    let moved = Fault::TagMoved { id: 3, by_m: [0.01, 0.0, 0.0], by_rad: [0.0; 3] };
    assert_eq!(faults[0], ScheduledFault { at_s: Some(120.0), fault: moved });
    assert_eq!(faults[1], Fault::Silt { seconds: 2.5 }.into());
    let spec = WorldSpec { fault: faults.clone(), ..WorldSpec::default() };
    assert_eq!(read(&spec.to_toml().expect("text")).expect("it reads back"), faults);
    let problem = |text: &str| read(text).expect_err("refused").to_string();
    let told = [
        "[[fault]]\nkind = \"silt\"\nseconds = 1.0\nat = 3.0",
        "[[fault]]\nkind = \"flood\"",
        "[fault]\nkind = \"silt\"",
    ];
    insta::assert_snapshot!("faults", told.map(|text| format!("{text:?}\n  {}\n", problem(text))).concat());
}

#[test]
fn details_are_what_a_routine_says() {
    let fault = Fault::SensorJump { joint: "wrist_yaw".into(), by_rad: 0.05 };
    assert_eq!((fault.kind(), fault.details().as_str()), ("sensor_jump", "by_rad = 0.05, joint = \"wrist_yaw\""));
}

#[test]
fn a_blow_beside_the_origin_turns_the_vehicle() {
    let impulse = Impulse::new([0.0, 100.0, 0.0], 0.5, [2.0, 0.0, 0.0]);
    assert_eq!(impulse.impulse_n_s, [0.0, 50.0, 0.0]);
    assert_eq!(impulse.angular_impulse_n_m_s, [0.0, 0.0, 100.0]);
}
