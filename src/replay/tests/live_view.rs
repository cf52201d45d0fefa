//! Run in progress, shown to viewers that are connected, slow, or absent.

use std::collections::BTreeMap;
use std::net::TcpListener;
use std::time::{Duration, Instant};

use re_sdk_types::external::arrow::array::Array;

use super::{input, small};
use crate::news::{LiveDrawings, News};
use crate::*;
use armcal_core::log::Recording;
use armcal_core::robot::Robot;
use armcal_core::streams::{CameraImage, Message};

/// Time by which every stream has been heard, ns.
const FIRST_HEARD_NANOS: i64 = 2_000_000_000;

fn drawings(robot: &Robot) -> LiveDrawings {
    LiveDrawings { robot: robot.clone(), vehicle: None, scene: None }
}

/// Number of rows by entity, time and content; `fixed` rows have no time.
#[derive(Default)]
struct Drawn {
    rows: BTreeMap<(String, i64, String), usize>,
    fixed: BTreeMap<String, usize>,
}

impl Drawn {
    fn add(&mut self, chunks: &[crate::rerun::log::Chunk]) {
        for chunk in chunks {
            let entity = chunk.entity_path().to_string();
            if chunk.is_static() {
                *self.fixed.entry(entity).or_default() += 1;
                continue;
            }
            let (_, times) = chunk.timelines().iter().next().expect("a timeline");
            for (n, time) in times.times_raw().iter().enumerate() {
                let row = chunk.row_sliced_shallow(n, 1);
                let mut parts: Vec<String> = row
                    .components()
                    .iter()
                    .filter_map(|(component, column)| {
                        Some(format!(
                            "{component}: {:?}",
                            column.list_array.is_valid(0).then(|| column.list_array.value(0))?
                        ))
                    })
                    .collect();
                parts.sort();
                *self.rows.entry((entity.clone(), *time, parts.join("; "))).or_default() += 1;
            }
        }
    }
}

/// Returns the rows of a recording with images that is sent in parts; `every` says after which messages.
fn told(recording: &Recording, robot: &Robot, mut every: impl FnMut(usize) -> bool) -> (Drawn, usize) {
    let (mut news, mut drawn, mut n_layouts) = (News::new(drawings(robot)), Drawn::default(), 0);
    let mut take = |update: Option<crate::news::Update>| {
        let Some(update) = update else { return };
        n_layouts += usize::from(update.layout.is_some());
        drawn.add(&update.chunks);
    };
    for (n, (log_time, message)) in recording.messages.iter().enumerate() {
        news.hear(*log_time, message.clone());
        if every(n) {
            take(news.take().unwrap());
            news.trim();
        }
    }
    take(news.take_rest().unwrap());
    (drawn, n_layouts)
}

/// Returns the made-up run with images of the given size, five per second in its first half.
fn with_images(bytes: usize) -> (tempfile::TempDir, Recording, Robot) {
    let (dir, mut recording, _, robot) = small();
    let n = recording.messages.len();
    let stamps = recording.messages.iter().take(n / 2).filter_map(|(stamp, message)| match message {
        Message::Detections(_) => Some(*stamp),
        _ => None,
    });
    let images: Vec<_> = stamps
        .step_by(2)
        .map(|stamp| (stamp, Message::Image(CameraImage { stamp, jpeg: vec![0xff; bytes] })))
        .collect();
    recording.messages.extend(images);
    recording.messages.sort_by_key(|(log_time, _)| *log_time);
    (dir, recording, robot)
}

/// Each row is sent once, at any times of the updates, and the drawing of the whole run has it too.
#[test]
fn updates_together_are_the_drawing_at_once() {
    let (_dir, recording, robot) = with_images(20_000);
    let (at_once, _) = told(&recording, &robot, |_| false);
    assert!(at_once.rows.len() > 2000, "{}", at_once.rows.len());
    assert!(at_once.rows.keys().any(|(entity, ..)| entity == "/camera/image"));
    let mut of_file = Drawn::default();
    let run = crate::recording::scene(&input(&recording, &robot)).unwrap();
    of_file.add(&crate::recording::draw(&run, &input(&recording, &robot)).into_chunks().unwrap());
    let without_images = |drawn: &Drawn| -> BTreeMap<_, _> {
        drawn.rows.clone().into_iter().filter(|((entity, ..), _)| entity != "/camera/image").collect()
    };
    assert_eq!(without_images(&at_once), without_images(&of_file), "the drawing of a file");
    for every in [7, 100, 901] {
        let (bit_by_bit, n_layouts) = told(&recording, &robot, |n| n % every == every - 1);
        for (row, n) in &bit_by_bit.rows {
            assert_eq!(at_once.rows.get(row), Some(n), "sent too often or wrongly, every {every} messages: {row:?}");
        }
        // The drawing of the whole run also has the first temperature before it was measured.
        for (row, n) in at_once.rows.iter().filter(|((_, nanos, _), _)| *nanos >= FIRST_HEARD_NANOS) {
            assert_eq!(bit_by_bit.rows.get(row), Some(n), "not sent, every {every} messages: {row:?}");
        }
        let fixed = |drawn: &Drawn| drawn.fixed.keys().cloned().collect::<Vec<_>>();
        let [live, whole] = [&bit_by_bit, &at_once].map(fixed);
        assert!(whole.iter().all(|entity| live.contains(entity)), "{live:?} {whole:?}");
        assert!(n_layouts <= 4, "{n_layouts} layouts");
    }
}

/// A late viewer receives earlier motion at a lower rate, and all single events.
#[test]
fn a_late_viewer_is_told_what_happened() {
    let (_dir, recording, robot) = with_images(20_000);
    let (at_once, _) = told(&recording, &robot, |_| false);
    let mut news = News::new(drawings(&robot));
    for (log_time, message) in &recording.messages {
        news.hear(*log_time, message.clone());
        news.trim();
    }
    let mut late = Drawn::default();
    late.add(&news.take_rest().unwrap().unwrap().chunks);
    let rows = |drawn: &Drawn, part: &str| drawn.rows.keys().filter(|(entity, ..)| entity.starts_with(part)).count();
    for part in ["/phase", "/log", "/world/vehicle/base/views"] {
        assert_eq!(rows(&late, part), rows(&at_once, part), "{part}");
    }
    assert_eq!(rows(&late, "/plots/joint_angle"), rows(&at_once, "/plots/joint_angle"));
    assert!(rows(&late, "/world/vehicle/base/arm") > rows(&at_once, "/world/vehicle/base/arm") / 4);
    let again = news.take_rest().unwrap().unwrap();
    assert!(again.chunks.is_empty() && again.layout.is_none(), "{} chunks", again.chunks.len());
    news.forget_shown();
    let next = news.take_rest().unwrap().unwrap();
    assert!(next.layout.is_some() && next.chunks.iter().any(|chunk| chunk.is_static()));
}

/// Sends a view the whole recording several times. Returns the time of the slowest message, and the outcome of the
/// view.
fn speak(recording: &Recording, robot: &Robot, address: &str, times: usize) -> (Duration, LiveViewEnd) {
    let view = LiveView::open(drawings(robot), address).unwrap();
    let mut listener = view.listener(Duration::ZERO);
    let mut slowest = Duration::ZERO;
    let length_s = recording.messages[recording.messages.len() - 1].0.since_s(recording.messages[0].0);
    for time in 0..times {
        for (log_time, message) in &recording.messages {
            let at = log_time.plus_s(time as f64 * (length_s + 0.1));
            let began = Instant::now();
            listener(at, message);
            slowest = slowest.max(began.elapsed());
        }
        std::thread::sleep(Duration::from_millis(300));
    }
    let began = Instant::now();
    let end = view.end();
    assert!(began.elapsed() < Duration::from_secs(4), "the end took {:?}", began.elapsed());
    (slowest, end)
}

#[test]
fn nobody_waits_for_a_viewer_that_is_not_there() {
    let (_dir, recording, robot) = with_images(20_000);
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let (slowest, end) = speak(&recording, &robot, &format!("127.0.0.1:{port}"), 2);
    assert!(slowest < Duration::from_millis(500), "{slowest:?}");
    assert!(!end.was_seen && end.failure.is_none(), "{end:?}");
    let shown = show_recording(&input(&recording, &robot), &format!("127.0.0.1:{port}"));
    let error = shown.expect_err("there is no viewer").to_string();
    insta::assert_snapshot!("no_viewer", error.replace(&port.to_string(), "PORT"));
}

/// The viewer accepts the connection and reads nothing.
#[test]
fn nobody_waits_for_a_viewer_that_is_too_slow() {
    let (_dir, recording, robot) = with_images(100_000);
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let held = std::thread::spawn(move || listener.accept().map(|(stream, _)| stream));
    let (slowest, end) = speak(&recording, &robot, &address, 20);
    assert!(slowest < Duration::from_millis(500), "{slowest:?}");
    assert!(end.was_seen && !end.was_taken && end.left_out > 0, "{end:?}");
    drop(held);
}

#[test]
fn an_address_has_a_host_and_a_port() {
    let robot = armcal_core::robot::load(&super::robots().join("titan4")).unwrap();
    let addresses = ["127.0.0.1", "127.0.0.1:", ":9876", "127.0.0.1:0", "127.0.0.1:99999", "http://127.0.0.1:9876"];
    let told = addresses.map(|address| {
        let Err(error) = LiveView::open(drawings(&robot), address) else { panic!("{address} is taken") };
        error.to_string()
    });
    insta::assert_snapshot!("addresses", told.join("\n"));
}
