//! One routine and one seed give one result, regardless of the machine's state.

use std::net::TcpListener;
use std::path::PathBuf;
use std::sync::OnceLock;

use serde_json::Value;

use crate::support::{Answer, ShortRoutine, Simulated, answer, lasting_folder, program, read, shared_run, temp, write};

/// summary.json without its wall-clock times.
fn without_wall_time(summary: &[u8]) -> Value {
    let mut value: Value = serde_json::from_slice(summary).expect("JSON");
    value["wall_s"] = Value::Null;
    value["calibration"]["wall_s"] = Value::Null;
    value
}

/// The shared run repeated on one thread, in another folder, with other sines, and without the viewer that it requests.
pub struct Elsewhere {
    pub out: PathBuf,
    pub said: Answer,
    /// Address at which no viewer listens.
    pub viewer: String,
}

pub fn elsewhere() -> &'static Elsewhere {
    static RUN: OnceLock<Elsewhere> = OnceLock::new();
    RUN.get_or_init(|| {
        let folder = lasting_folder();
        let out = folder.join("again");
        // The same files under another spelling of their paths.
        let text = read(&shared_run().routine).replace("/robots/", "/robots/../robots/./");
        write(&folder.join("other.toml"), &text);
        let viewer = TcpListener::bind("127.0.0.1:0").and_then(|port| port.local_addr()).expect("a port").to_string();
        let mut again = program();
        again.env("RAYON_NUM_THREADS", "1").env("TZ", "Pacific/Chatham").env("LC_ALL", "tr_TR.UTF-8");
        again.env("GLIBC_TUNABLES", "glibc.cpu.hwcaps=-FMA,-AVX2,-AVX512F,-FMA4").current_dir(&folder);
        let said = answer(again.args(["run", "other.toml"]).arg(format!("--live={viewer}")).arg("--out").arg(&out));
        said.expect("again", 0, &["ACCEPTED"]);
        Elsewhere { out, said, viewer }
    })
}

#[test]
fn a_routine_repeats_byte_for_byte_on_one_thread_and_in_another_place() {
    let (first, out) = (shared_run(), &elsewhere().out);
    for name in ["run.mcap", "truth.mcap", "run.rrd", "calibration.toml", "calibration.covariance.toml"] {
        assert!(first.bytes(name) == std::fs::read(out.join(name)).expect("written"), "{name} differs");
    }
    let html = |bytes: Vec<u8>| {
        let text = String::from_utf8(bytes).expect("text");
        let (before, time) = text.split_once("<th scope=\"row\">time</th>").expect("a line of times");
        format!("{before}{}", time.split_once("</tr>").expect("its end").1)
    };
    assert_eq!(html(first.bytes("report.html")), html(std::fs::read(out.join("report.html")).expect("written")));

    let again = std::fs::read(out.join("summary.json")).expect("written");
    assert_eq!(without_wall_time(&first.bytes("summary.json")), without_wall_time(&again));
}

/// The C library glibc has two sines, one for processors with fused multiply-add, and a variable selects the other;
/// other libraries ignore it. The estimator's fit and the sampling of noise would spread a difference in the last bit.
#[test]
fn sines_are_not_the_platforms() {
    for name in ["run.mcap", "truth.mcap", "calibration.toml", "calibration.covariance.toml"] {
        let of_others = std::fs::read(elsewhere().out.join(name)).expect("written");
        assert!(shared_run().bytes(name) == of_others, "{name} differs");
    }
}

#[test]
fn replaying_a_recording_twice_gives_the_same_bytes() {
    let folder = temp();
    let [a, b] = ["a.rrd", "b.rrd"].map(|name| {
        let mut replay = program();
        replay.arg("replay").arg(shared_run().file("run.mcap")).arg("--save").arg(name).current_dir(folder.path());
        answer(&mut replay).expect(name, 0, &["written"]);
        std::fs::read(folder.path().join(name)).expect("written")
    });
    assert!(a == b);
}

#[test]
fn calibrating_a_recording_twice_gives_the_same_bytes() {
    let run = shared_run();
    let folder = temp();
    let [a, b] = ["a", "b"].map(|name| {
        let out = folder.path().join(name);
        crate::support::calibrate(&run.file("run.mcap"), &crate::support::robot_folder(), &out).expect(name, 0, &[]);
        ["calibration.toml", "summary.json"].map(|file| std::fs::read(out.join(file)).expect("written"))
    });
    assert!(a[0] == b[0]);
    assert_eq!(without_wall_time(&a[1]), without_wall_time(&b[1]));
}

#[test]
fn another_seed_gives_another_recording() {
    let folder = temp();
    let tiny = ShortRoutine { poses: 4, held_out: 0, ..ShortRoutine::default() };
    let tiny = ShortRoutine { targets_m: tiny.targets_m[..1].to_vec(), ..tiny };
    let [first, second] = [1, 2].map(|seed| {
        let run = Simulated::of(&ShortRoutine { seed, ..tiny.clone() }, &folder.path().join(seed.to_string()));
        [run.bytes("run"), run.bytes("truth"), run.finished().calibration.to_toml().into_bytes()]
    });
    for (a, b) in first.iter().zip(&second) {
        assert!(a != b);
    }
}
