use super::*;

#[test]
fn figures_that_differ_are_told_apart() {
    let refusal = |predicted_m| Refusal::BeyondTolerance { predicted_m, tolerance_m: 0.003 };
    assert!(refusal(0.0041).to_string().contains("4.1 mm exceeds the task's tolerance of 3.0 mm"));
    assert!(refusal(0.003_04).to_string().contains("3.04 mm exceeds the task's tolerance of 3.00 mm"));
}

#[test]
fn what_explains_all_others_comes_first() {
    let solver = Refusal::NotSolved { outcome: armcal_core::numeric::Outcome::Stalled, evaluations: 9 };
    let outliers = |outliers| Refusal::Outliers { outliers, observations: 100 };
    let few = Refusal::TooFewViews { views: 3, parameters: 9 };
    assert!(outliers(60).rank() < solver.rank() && few.rank() < outliers(60).rank());
    assert_eq!(outliers(40).rank(), solver.rank());
}
use crate::calib::geometry_error::ErrorKind;

#[test]
fn words_say_cause_and_figure_and_each_reason_has_a_remedy() {
    let first = Refusal::TooFewViews { views: 8, parameters: 10 };
    let second = Refusal::Overfitted { held_out_m: 0.011, fit_m: 0.004 };
    let words = in_words(&[first.clone(), second]).expect("two reasons");
    assert!(words.contains("[too_few_views]; also: ") && words.ends_with("[overfitted]"), "{words}");
    assert!(words.contains("11.0 mm rms") && words.contains("4.0 mm"), "{words}");
    assert_eq!((first.remedy(), first.code()), ("capture more views", Code::TooFewViews));
    assert_eq!(in_words(&[]), None);
}

/// One of each kind that says something measured.
fn measured() -> Vec<Refusal> {
    let joint = || "wrist_yaw".to_owned();
    vec![
        Refusal::TooFewViews { views: 8, parameters: 10 },
        Refusal::NotSolved { outcome: Outcome::Stalled, evaluations: 40 },
        Refusal::TooFewHeldOutViews { views: 1, needed: 3 },
        Refusal::NoHeldOutTag,
        Refusal::NoBetterThanDatasheet { held_out_m: 0.02, datasheet_m: 0.019 },
        Refusal::NoBetterThanBaseline { held_out_m: 0.0201, baseline_m: 0.0203, p_value: 0.4 },
        Refusal::Overfitted { held_out_m: 0.011, fit_m: 0.004 },
        Refusal::BeyondTolerance { predicted_m: 0.03, tolerance_m: 0.02 },
        Refusal::PriorsBeyondTolerance { predicted_m: 0.03, tolerance_m: 0.02, most: None },
        Refusal::SensorError { joint: joint(), std_rad: 0.01, datasheet_std_rad: 0.002, moves: JointKind::Revolute },
        Refusal::Nonlinearity { joint: joint(), std_rad: 0.03, datasheet_std_rad: 0.002, moves: JointKind::Revolute },
        Refusal::CornerNoise { residual_px: 1.2, stated_px: 0.3, limit_px: 0.9 },
        Refusal::BeyondDatasheet { parameter: "wrist_yaw offset".to_owned(), sigmas: 9.0 },
        Refusal::Outliers { outliers: 40, observations: 100 },
        Refusal::Innovations {
            quantity: InnovationQuantity::Coordinates,
            per_dof: 9.0,
            limit: 1.7,
            expected: [0.9, 1.1],
        },
        Refusal::TooFewViewsSinceSlip { joint: joint(), evidence: "it slipped".to_owned(), views: 4 },
        Refusal::SensorFailed {
            joint: joint(),
            kind: FailedKind::Dead,
            tool_error_m: Some(0.2),
            tool_error_by_camera_m: Some(0.01),
            tolerance_m: 0.02,
        },
    ]
}

#[test]
fn each_reason_says_a_figure_and_what_to_do_next() {
    for refusal in measured() {
        let words = refusal.to_string();
        assert!(words.contains(|c: char| c.is_ascii_digit()), "{words}");
        assert!(words.ends_with(&format!("; {}", refusal.remedy())), "{words}");
    }
    for refusal in [Refusal::PriorReused, Refusal::PriorSingular, Refusal::PriorUntested] {
        assert!(refusal.to_string().ends_with(refusal.remedy()));
    }
}

#[test]
fn a_reason_survives_the_file() {
    let geometry = Refusal::Geometry(GeometryError {
        element: "upperarm_link".to_owned(),
        joint: Some("forearm_pitch".to_owned()),
        error: ErrorKind::Shift,
        size: [0.01, 0.0, 0.0],
        chi2: 300.0,
        limit: 30.0,
        tool_error_m: 0.009,
    });
    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct File {
        refusals: Vec<Refusal>,
    }
    let contradicted = Refusal::PriorContradicted {
        joint: "wrist_yaw".to_owned(),
        off_rad: 0.1,
        off_std_rad: 0.01,
        moves: JointKind::Revolute,
        chi2: 90.0,
        degrees_of_freedom: 6,
        limit: 22.0,
        used_share: 0.4,
        joints_off: 1,
    };
    let touch = Refusal::Touch {
        off_m: 0.018,
        surface: "toe plate".to_owned(),
        chi2: 250.0,
        limit: 21.1,
        causes: vec!["tool point or links beyond the camera".to_owned()],
        link: "manipulator_link".to_owned(),
        tool_point_m: [0.0, 0.02, -0.001],
    };
    assert!(touch.to_string().starts_with("touch: the tool is 18 mm from where it should be at toe plate"));
    let file = File {
        refusals: vec![
            geometry,
            Refusal::NotSolved { outcome: Outcome::Stalled, evaluations: 40 },
            contradicted,
            touch,
        ],
    };
    let text = toml::to_string(&file).expect("it has a TOML form");
    assert_eq!(toml::from_str::<File>(&text).expect("it reads"), file, "{text}");
}
