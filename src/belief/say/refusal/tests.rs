use super::words::{in_words, told_apart_mm};
use super::*;
use crate::say::reading_error::{JointZero, ReadingError};

#[test]
fn figures_that_differ_are_told_apart() {
    assert_eq!(told_apart_mm([0.0041, 0.003]), ["4.1", "3.0"]);
    assert_eq!(told_apart_mm([0.003_04, 0.003]), ["3.04", "3.00"]);
}

#[test]
fn what_explains_all_others_comes_first() {
    let solver = Refusal::NotSolved { outcome: armcal_core::numeric::Outcome::Stalled, evaluations: 9 };
    let outliers = |outliers| Refusal::Outliers { outliers, observations: 100 };
    let few = Refusal::TooFewViews { views: 3, parameters: 9 };
    assert!(outliers(60).rank() < solver.rank() && few.rank() < outliers(60).rank());
    assert_eq!(outliers(40).rank(), solver.rank());
}
use crate::say::geometry_error::ErrorKind;

#[test]
fn the_words_of_each_reason() {
    let mut all = measured();
    all.extend([geometry(), contradicted(), touch(), length(), Refusal::PriorReused, Refusal::PriorSingular]);
    all.push(Refusal::PriorUntested);
    all.extend(of_stated_angles());
    all.extend(motions());
    all.push(camera_mounted_anew());
    let mut words: Vec<String> = all.iter().map(ToString::to_string).collect();
    words.extend(in_words(&all[..2]));
    insta::assert_snapshot!("refusals", words.join("\n"));
    assert_eq!(in_words(&[]), None);
}

/// Reasons that follow from a wrong input come without advice.
#[test]
fn the_advice_of_a_wrong_input_is_the_only_one() {
    let outliers = || Refusal::Outliers { outliers: 40, observations: 100 };
    let exchanged = misread(ReadingError::Exchanged { joints: ["shoulder".to_owned(), "elbow".to_owned()] });
    for (reasons, n) in [(vec![exchanged, outliers()], 1), (vec![outliers(), Refusal::NoHeldOutTag], 2)] {
        assert_eq!(with_advice(&reasons).len(), n);
        let words = in_words(&reasons).expect("words");
        for (k, reason) in reasons.iter().enumerate() {
            assert!(words.contains(&reason.cause()) && words.contains(&*reason.remedy()) == (k < n), "{words}");
        }
    }
}

fn motions() -> [Refusal; 4] {
    use MovedBody::{BaseOrTags, Camera, CarriedTags, StandingCamera};
    [(Camera, Some("elbow")), (StandingCamera, None), (BaseOrTags, None), (CarriedTags, None)].map(|(body, name)| {
        let camera = name.map(str::to_owned);
        Refusal::MovedBetweenViews { body, camera, views: [20, 21], shift_m: 0.0102, turn_rad: 0.015 }
    })
}

fn geometry() -> Refusal {
    Refusal::Geometry(GeometryError {
        element: "upperarm_link".to_owned(),
        joint: Some("forearm_pitch".to_owned()),
        error: ErrorKind::Shift,
        size: [0.01, 0.0, 0.0],
        chi2: 300.0,
        limit: 30.0,
        tool_error_m: 0.009,
    })
}

fn contradicted() -> Refusal {
    Refusal::PriorContradicted {
        joint: "wrist_yaw".to_owned(),
        off_rad: 0.1,
        off_std_rad: 0.01,
        moves: JointKind::Revolute,
        chi2: 90.0,
        degrees_of_freedom: 6,
        limit: 22.0,
        used_share: 0.4,
        joints_off: 1,
        camera_moved: None,
    }
}

fn camera_mounted_anew() -> Refusal {
    match contradicted() {
        Refusal::PriorContradicted { joint, off_rad, off_std_rad, moves, chi2, degrees_of_freedom, limit, .. } => {
            let camera_moved = Some(CameraMoved { shift_m: 0.0269, turn_rad: 0.1025 });
            let (used_share, joints_off) = (0.1, 6);
            Refusal::PriorContradicted {
                joint,
                off_rad,
                off_std_rad,
                moves,
                chi2,
                degrees_of_freedom,
                limit,
                used_share,
                joints_off,
                camera_moved,
            }
        }
        other => other,
    }
}

fn touch() -> Refusal {
    Refusal::Touch {
        off_m: 0.018,
        surface: "toe plate".to_owned(),
        chi2: 250.0,
        limit: 21.1,
        causes: vec!["tool point or links beyond the camera".to_owned()],
        link: "manipulator_link".to_owned(),
        tool_point_m: [0.0, 0.02, -0.001],
    }
}

fn length() -> Refusal {
    let (what, key) = ("the distance of tags 3 and 7".to_owned(), "[[geometry.tag_distance]]".to_owned());
    Refusal::Length { what, key, measured_m: 1.204, by_views_m: 1.1903, std_m: 0.0011 }
}

fn misread(found: ReadingError) -> Refusal {
    let alternatives = vec![ReadingError::Exchanged { joints: ["elbow".to_owned(), "wrist_yaw".to_owned()] }];
    Refusal::MisreadReadings(MisreadReadings { found, alternatives, tag_error_m: 0.9, corrected_m: Some(0.002) })
}

fn sensor_failed() -> Refusal {
    Refusal::SensorFailed {
        joint: "wrist_yaw".to_owned(),
        kind: FailedKind::Dead,
        since_view: Some(27),
        tool_error_m: Some(0.2),
        tool_error_by_camera_m: Some(0.01),
        tolerance_m: Some(0.02),
    }
}

fn map_frame() -> ReadingError {
    ReadingError::MapFrame { position_m: [0.0, 0.1, 0.35], turn: [0.8, 0.0, 0.0, 0.6] }
}

fn zeros(input_zero: Option<f64>) -> Refusal {
    let (joint, moves) = ("wrist_yaw".to_owned(), JointKind::Revolute);
    let zero = JointZero { joint, off_rad: 1.57, moves, offset_counts: -1.57, input_zero };
    misread(ReadingError::Zeros { joints: vec![zero] })
}

/// Refusals of readings that the input map states as angles.
fn of_stated_angles() -> Vec<Refusal> {
    let joint = || "wrist_yaw".to_owned();
    vec![
        Refusal::SensorLine { joint: joint(), slope: -0.998, input_factor: Some(-0.998) },
        Refusal::SensorUnit { joint: joint(), gain: 0.0173, moves: JointKind::Revolute, input_factor: Some(0.0173) },
        misread(ReadingError::Scaled { joint: joint(), factor: 0.048, input_factor: Some(0.048) }),
        zeros(Some(-90.0)),
    ]
}

/// One refusal of each kind that states a measured value.
fn measured() -> Vec<Refusal> {
    [measured_of_the_fit(), misread_inputs(), measured_of_repairs()].concat()
}

/// A result beyond the tolerance: of an arm that is watched if a survey would help.
fn beyond_tolerance(survey: Vec<String>) -> Refusal {
    let is_watched = !survey.is_empty();
    Refusal::BeyondTolerance { target: 3, probability: 0.31, u95_m: 0.03, tolerance_m: 0.02, survey, is_watched }
}

fn measured_of_the_fit() -> Vec<Refusal> {
    let joint = || "wrist_yaw".to_owned();
    vec![
        Refusal::TooFewViews { views: 8, parameters: 10 },
        Refusal::NotSolved { outcome: Outcome::Stalled, evaluations: 40 },
        Refusal::TooFewHeldOutViews { views: 1, needed: 3 },
        Refusal::NoHeldOutTag,
        Refusal::NoBetterThanDatasheet { held_out_m: 0.02, datasheet_m: 0.019 },
        Refusal::NoBetterThanBaseline { held_out_m: 0.0201, baseline_m: 0.0203, p_value: 0.4 },
        Refusal::Overfitted { held_out_m: 0.011, fit_m: 0.004 },
        beyond_tolerance(Vec::new()),
        beyond_tolerance(vec!["offset_std_rad of turn".to_owned(), "mount_std_rad".to_owned()]),
        Refusal::PriorsBeyondTolerance { target: 3, probability: 0.08, u95_m: 0.03, tolerance_m: 0.02, most: None },
        Refusal::TargetsNotJudged { targets: vec![2, 5] },
        Refusal::HeldOutError { held_out_m: 0.3, limit_m: 0.019, source: HeldOutLimitSource::Reach },
        Refusal::SensorError { joint: joint(), std_rad: 0.01, datasheet_std_rad: 0.002, moves: JointKind::Revolute },
        Refusal::Nonlinearity { joint: joint(), std_rad: 0.03, datasheet_std_rad: 0.002, moves: JointKind::Revolute },
        Refusal::CornerNoise { residual_px: 1.2, stated_px: 0.3, limit_px: 0.9 },
        Refusal::CornerNoiseUnderstated { residual_px: 0.25, stated_px: 0.03, outliers: 135, observations: 137 },
        Refusal::BeyondDatasheet {
            parameter: "wrist_yaw offset".to_owned(),
            sigmas: 9.0,
            off: 0.18,
            unit: FindingUnit::Radian,
        },
        Refusal::TargetsNotCovered { targets: vec![4], ranges: vec!["target 4 lies 80 deg beyond".to_owned()] },
        Refusal::Lens {
            camera: None,
            ratio: 1.333,
            std: 3e-4,
            stated_std: 2e-3,
            most_sigmas: 10.0,
            focal_px: [900.1, 900.2],
        },
        Refusal::SensorLine { joint: joint(), slope: 0.5, input_factor: None },
        Refusal::Outliers { outliers: 40, observations: 100 },
        Refusal::Innovations {
            quantity: InnovationQuantity::Coordinates,
            per_dof: 9.0,
            limit: 1.7,
            expected: [0.9, 1.1],
        },
    ]
}

fn misread_inputs() -> Vec<Refusal> {
    let joint = || "wrist_yaw".to_owned();
    vec![
        misread(ReadingError::Exchanged { joints: ["shoulder".to_owned(), joint()] }),
        misread(ReadingError::Reversed { joints: vec!["shoulder".to_owned(), joint()] }),
        misread(ReadingError::Coupled { joint: joint(), with: "shoulder".to_owned(), sign: -1.0 }),
        misread(ReadingError::Alike { joint: joint(), with: "shoulder".to_owned(), views: 40 }),
        misread(ReadingError::OtherTurns { joints: vec![joint()], wrap_counts: 16_560.0 }),
        zeros(None),
        misread(ReadingError::Shifted { views: 1 }),
        misread(map_frame()),
        misread(ReadingError::MapScale { factor: 1.25, is_in_pixels: true, hint: None }),
        misread(ReadingError::MapScale { factor: 0.001, is_in_pixels: false, hint: None }),
        Refusal::MisreadReadings(MisreadReadings {
            found: ReadingError::Zeros {
                joints: vec![JointZero {
                    joint: joint(),
                    off_rad: 1.57,
                    moves: JointKind::Revolute,
                    offset_counts: -1.57,
                    input_zero: None,
                }],
            },
            alternatives: vec![map_frame()],
            tag_error_m: 0.9,
            corrected_m: Some(0.002),
        }),
        misread(ReadingError::Camera { link: Some("wrist".to_owned()), turn: [1.0, 0.0, 0.0, 0.0] }),
        misread(ReadingError::Camera { link: None, turn: [0.5, -0.5, 0.5, -0.5] }),
    ]
}

fn measured_of_repairs() -> Vec<Refusal> {
    let joint = || "wrist_yaw".to_owned();
    vec![
        Refusal::TagSizeRepair { element: "tag 3".to_owned(), ratio: 0.015, stated_m: 9.9 },
        Refusal::TooFewViewsSinceSlip { joint: joint(), evidence: "it slipped".to_owned(), views: 4 },
        Refusal::SlipNotEstimated { joint: joint(), evidence: "the sensor slipped by 1.00 deg".to_owned() },
        sensor_failed(),
    ]
}

#[test]
fn each_reason_says_a_figure_and_what_to_do_next() {
    for refusal in measured() {
        let words = refusal.to_string();
        assert!(words.contains(|c: char| c.is_ascii_digit()), "{words}");
        assert!(words.ends_with(&format!("; {} [{}]", refusal.remedy(), refusal.code())), "{words}");
    }
    for refusal in [Refusal::PriorReused, Refusal::PriorSingular, Refusal::PriorUntested] {
        assert!(refusal.to_string().ends_with(&format!("; {} [{}]", refusal.remedy(), refusal.code())));
    }
}

#[test]
fn a_reason_survives_the_file() {
    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct File {
        refusals: Vec<Refusal>,
    }
    let file = File {
        refusals: vec![
            geometry(),
            Refusal::NotSolved { outcome: Outcome::Stalled, evaluations: 40 },
            contradicted(),
            touch(),
            Refusal::SensorLine { joint: "wrist_yaw".to_owned(), slope: 0.5, input_factor: None },
        ]
        .into_iter()
        .chain(of_stated_angles())
        .collect(),
    };
    let text = toml::to_string(&file).expect("it has a TOML form");
    assert_eq!(toml::from_str::<File>(&text).expect("it reads"), file, "{text}");
}
