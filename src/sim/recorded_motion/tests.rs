use std::fmt::Write as _;
use std::path::Path;

use nalgebra::{UnitQuaternion, Vector3};

use crate::recorded_motion::{RecordedMotion, VehicleKinematics};

const HEADER: &str = "time_s,x_m,y_m,z_m,roll_rad,pitch_rad,yaw_rad\n";

fn parse(text: &str) -> RecordedMotion {
    RecordedMotion::parse(Path::new("dive.csv"), text.to_owned()).expect("a motion")
}

fn problem(text: &str) -> String {
    RecordedMotion::parse(Path::new("dive.csv"), text.to_owned()).expect_err("refused").to_string()
}

/// Returns one axis of the motion below and its first two derivatives.
fn wave(k: usize, t: f64) -> [f64; 3] {
    let (amplitude, rate, phase) = (0.1 + 0.03 * k as f64, 0.8 + 0.1 * k as f64, 0.7 * k as f64);
    let (sin, cos) = (rate * t + phase).sin_cos();
    [amplitude * sin, amplitude * rate * cos, -amplitude * rate * rate * sin]
}

/// Returns a table of six sinusoids, pitched by `pitch0_rad` and yawing at `yaw_rate_rad_s`.
fn table(step_s: f64, duration_s: f64, pitch0_rad: f64, yaw_rate_rad_s: f64) -> String {
    let mut text = HEADER.to_owned();
    for i in 0..=(duration_s / step_s).round() as u32 {
        let t = f64::from(i) * step_s;
        let w: [f64; 6] = std::array::from_fn(|k| wave(k, t)[0]);
        let (pitch, yaw) = (pitch0_rad + w[4], yaw_rate_rad_s * t + w[5]);
        writeln!(text, "{t},{},{},{},{},{pitch},{yaw}", w[0], w[1], w[2], w[3]).expect("a string");
    }
    text
}

/// Returns the largest component.
fn worst(differences: &[Vector3<f64>]) -> f64 {
    assert!(differences.iter().all(|v| v.norm().is_finite()), "{differences:?}");
    differences.iter().map(Vector3::amax).fold(0.0, f64::max)
}

/// Returns the largest differences of velocity, acceleration, rate and angular acceleration from central differences of
/// the pose at `t`.
fn off_central_differences(motion: &RecordedMotion, t: f64) -> f64 {
    // Within a cubic piece the third derivative is constant: 1e-4 s leaves 1e-8 of truncation, and 1e-16/h2 = 1e-8 of
    // rounding.
    let h = 1e-4;
    let [before, now, after] = [t - h, t, t + h].map(|t| motion.at(t));
    let velocity = (after.position - before.position) / (2.0 * h);
    let acceleration = (after.velocity - before.velocity) / (2.0 * h);
    let rate = (before.rotation.inverse() * after.rotation).scaled_axis() / (2.0 * h);
    // The components' derivative in body axes is the angular acceleration.
    let angular = (after.rate - before.rate) / (2.0 * h);
    worst(&[
        velocity - now.velocity,
        acceleration - now.acceleration,
        rate - now.rate,
        angular - now.angular_acceleration,
    ])
}

#[test]
fn derivatives_are_those_of_what_it_returns() {
    /// Tolerance, m/s2 or rad/s2.
    const TOLERANCE: f64 = 1e-6;
    // Level, and with the nose straight up while it turns continuously.
    for (pitch0_rad, yaw_rate_rad_s) in [(0.0, 0.0), (std::f64::consts::FRAC_PI_2, 0.4)] {
        let motion = parse(&table(0.2, 30.0, pitch0_rad, yaw_rate_rad_s));
        // Inside pieces; the last three while the recording plays slower, and at rest after it.
        for t in [0.31, 4.93, 17.05, 27.9, 28.7, 30.3, 31.9, 35.0] {
            let off = off_central_differences(&motion, t);
            assert!(off < TOLERANCE, "pitch {pitch0_rad}, {t} s: {off:.1e}");
        }
    }
}

/// Samples of a known motion reproduce its velocities and accelerations, with an error of second order in the step.
#[test]
fn a_sampled_motion_comes_back_with_its_accelerations() {
    let worst = |step_s: f64| {
        let motion = parse(&table(step_s, 20.0, 0.0, 0.0));
        // Away from the ends, where a natural spline's acceleration is zero.
        (0..100).map(|i| 5.0 + 0.1037 * f64::from(i)).fold([0.0_f64; 3], |mut worst, t| {
            let jet = motion.at(t);
            let w: [[f64; 3]; 6] = std::array::from_fn(|k| wave(k, t));
            let part = |order: usize| Vector3::new(w[0][order], w[1][order], w[2][order]);
            let rotation = UnitQuaternion::from_euler_angles(w[3][0], w[4][0], w[5][0]);
            worst[0] = worst[0].max((jet.position - part(0)).amax()).max(jet.rotation.angle_to(&rotation));
            worst[1] = worst[1].max((jet.velocity - part(1)).amax()).max((jet.rate - body_rate(&w)).amax());
            worst[2] = worst[2].max((jet.acceleration - part(2)).amax());
            worst
        })
    };
    let (coarse, fine) = (worst(0.2), worst(0.1));
    let show = |w: &[f64; 3]| w.map(|v| format!("{v:.1e}")).join(", ");
    eprintln!("pose, rates, accelerations off by {} at 5 Hz, {} at 10 Hz", show(&coarse), show(&fine));
    assert!(fine[0] < 2e-6 && fine[1] < 2e-5 && fine[2] < 1e-3, "{fine:?}");
    for (order, (c, f)) in [4.0, 3.0, 2.0].iter().zip(coarse.iter().zip(&fine)) {
        assert!((c / f).log2() > order - 0.3, "order {order}: {c:.2e} {f:.2e}");
    }
}

/// Returns the angular velocity of `R = Rz(yaw) Ry(pitch) Rx(roll)` in body axes.
fn body_rate(w: &[[f64; 3]; 6]) -> Vector3<f64> {
    let ([roll, droll, _], [pitch, dpitch, _], dyaw) = (w[3], w[4], w[5][1]);
    let ((sr, cr), (sp, cp)) = (roll.sin_cos(), pitch.sin_cos());
    Vector3::new(droll - dyaw * sp, dpitch * cr + dyaw * sr * cp, -dpitch * sr + dyaw * cr * cp)
}

fn largest_difference(a: &VehicleKinematics, b: &VehicleKinematics) -> f64 {
    let vectors = [
        a.position - b.position,
        a.velocity - b.velocity,
        a.acceleration - b.acceleration,
        a.rate - b.rate,
        a.angular_acceleration - b.angular_acceleration,
    ];
    worst(&vectors).max(a.rotation.angle_to(&b.rotation))
}

#[test]
fn nothing_jumps_at_samples_nor_where_it_slows_down_nor_where_it_stops() {
    // The remaining error is the third derivative times twice this.
    let h = 1e-9;
    let motion = parse(&table(0.25, 10.0, 0.2, 0.3));
    for t in [0.25, 1.0, 5.5, 8.0, 9.75, 10.0, 12.0] {
        let jump = largest_difference(&motion.at(t - h), &motion.at(t + h));
        assert!(jump < 1e-7, "{t} s: {jump:.1e}");
    }
}

#[test]
fn it_begins_with_the_first_sample_and_holds_the_last() {
    let text = table(0.1, 20.0, 0.0, 0.0);
    let late = text.lines().skip(1).fold(HEADER.to_owned(), |mut late, line| {
        let (time_s, rest) = line.split_once(',').expect("columns");
        writeln!(late, "{},{rest}", time_s.parse::<f64>().expect("a time") + 1024.0).expect("a string");
        late
    });
    let (motion, late) = (parse(&text), parse(&late));
    assert!((motion.duration_s() - 20.0).abs() < 1e-12 && motion.hash() != late.hash() && motion.text() == text);
    for t in [0.0, 3.21, 19.0] {
        assert!(largest_difference(&motion.at(t), &late.at(t)) < 1e-9, "the first sample's time does not count");
    }
    let first = motion.at(0.0);
    assert!((first.position - Vector3::from_fn(|k, _| wave(k, 0.0)[0])).amax() < 1e-12);
    assert!((first.velocity - Vector3::from_fn(|k, _| wave(k, 0.0)[1])).amax() < 5e-3, "already moving");
    // The end is two seconds after the last sample, because the last two seconds took four.
    let last = Vector3::from_fn(|k, _| wave(k, 20.0)[0]);
    assert!((motion.at(21.5).position - last).amax() > 1e-6, "not there yet");
    for t in [22.0, 23.0, 1e6] {
        let jet = motion.at(t);
        assert!((jet.position - last).amax() < 1e-12, "{t} s");
        let moves = [jet.velocity, jet.acceleration, jet.rate, jet.angular_acceleration];
        assert_eq!(moves.iter().map(Vector3::amax).fold(0.0, f64::max), 0.0, "{t} s");
    }
}

#[test]
fn angles_and_quaternions_are_the_same_motion_whatever_the_quaternions_sign() {
    let angles = table(0.2, 10.0, 0.3, 0.5);
    let mut quaternions = "# by a filter\n time_s, x_m, y_m, z_m, qw, qx, qy, qz\n".to_owned();
    for (i, line) in angles.lines().skip(1).enumerate() {
        let v: Vec<f64> = line.split(',').map(|text| text.parse().expect("a figure")).collect();
        let q = UnitQuaternion::from_euler_angles(v[4], v[5], v[6]);
        let sign = if i % 3 == 0 { -1.0 } else { 1.0 };
        let [w, x, y, z] = [q.w, q.i, q.j, q.k].map(|part| sign * part);
        writeln!(quaternions, "{},{},{},{},{w},{x},{y},{z}", v[0], v[1], v[2], v[3]).expect("a string");
    }
    let (by_angles, by_quaternions) = (parse(&angles), parse(&quaternions));
    for i in 0..120 {
        let t = 0.1 * f64::from(i);
        assert!(largest_difference(&by_angles.at(t), &by_quaternions.at(t)) < 1e-9, "{t} s");
    }
}

/// Returns five good lines, with the line of `number` (the header is line 1) replaced.
fn with_line(number: usize, line: &str) -> String {
    let text = table(0.5, 2.0, 0.0, 0.0);
    text.lines().enumerate().fold(String::new(), |all, (i, l)| all + if i + 1 == number { line } else { l } + "\n")
}

#[test]
fn bad_files_are_refused_with_line_column_and_range() {
    // Turns of 0.5 rad to and fro within a tenth of a second: each turn is allowed, the acceleration is not.
    let shaken = "0,0,0,0,0,0,0\n0.05,0,0,0,0,0,0.5\n0.1,0,0,0,0,0,0\n0.15,0,0,0,0,0,0.5\n0.2,0,0,0,0,0,0\n";
    let close = "0,0,0,0,0,0,0\n1e-300,0,0,0,0,0,0\n2e-300,5,0,0,0,0,0\n0.2,0,0,0,0,0,0\n";
    let texts = [
        with_line(3, "0.5,nan,0,0,0,0,0"),
        with_line(3, "0.5,0,0,inf,0,0,0"),
        with_line(4, "1,0,0,zero,0,0,0"),
        with_line(4, "1,0,0,0,0,,0"),
        with_line(4, "1,0,0,0,0,0"),
        with_line(4, "0.5,0,0,0,0,0,0"),
        with_line(6, "20,0,0,0,0,0,0"),
        with_line(5, "1.5,40,0,0,0,0,0"),
        with_line(5, "1.5,0,0,0,0,0,3.0"),
        with_line(1, "t,x,y,z,roll,pitch,yaw"),
        with_line(5, &",".repeat(5000)),
        HEADER.to_owned() + "0,0,0,0,0,0,0\n0.1,0,0,0,0,0,0\n",
        String::new(),
        "time_s,x_m,y_m,z_m,qw,qx,qy,qz\n0,0,0,0,0.5,0,0,0.5\n".to_owned(),
        HEADER.to_owned() + shaken,
        HEADER.to_owned() + close,
    ];
    insta::assert_snapshot!("recorded_motions", texts.map(|text| problem(&text)).join("\n"));
    let missing = RecordedMotion::read(Path::new("no/such.csv")).expect_err("refused").to_string();
    assert!(missing.contains("no/such.csv"), "{missing}");
}

/// The sample of routines/motion has the motion that its generator states.
#[test]
fn the_hover_is_as_rough_as_it_says() {
    let file = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("routines/motion/hover.csv");
    let motion = RecordedMotion::read(&file).expect("the sample reads");
    assert!((motion.duration_s() - 600.0).abs() < 1e-9);
    let n = 6000;
    let mut squares = [0.0; 4];
    let mut most = [0.0_f64; 2];
    for i in 0..n {
        let jet = motion.at(f64::from(i) * 0.0996);
        let (roll, pitch, yaw) = jet.rotation.euler_angles();
        for (square, value) in squares.iter_mut().zip([jet.position.z, roll, pitch, yaw]) {
            *square += value * value / f64::from(n);
        }
        most = [most[0].max(jet.acceleration.norm()), most[1].max(jet.angular_acceleration.norm())];
    }
    let rms = squares.map(f64::sqrt);
    eprintln!("heave {:.4} m, roll, pitch, yaw {:.4?} rad rms; at most {most:.3?} m/s2, rad/s2", rms[0], &rms[1..]);
    let degree = 1f64.to_radians();
    for (value, expected) in rms.iter().zip([0.05, degree, degree, 2.02 * degree]) {
        assert!((value / expected - 1.0).abs() < 0.02, "{value} {expected}");
    }
    assert!(most[0] < 0.3 && most[1] < 0.1, "{most:?}");
}
