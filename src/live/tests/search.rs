//! Images over a wire in memory, searched in parallel to the loop.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

use crate::{Heard, ImageSearch, LiveError, TagFinder, Wire};
use armcal_core::streams::{CameraImage, JointCounts, Message, TagDetection, TagDetections};
use armcal_core::time::{SIMULATION_EPOCH, Stamp};

/// Wire that returns the messages of the test.
struct Pipe(Receiver<Heard>);

impl Wire for Pipe {
    fn elapsed(&self) -> Duration {
        Duration::ZERO
    }

    fn receive(&mut self, _: Duration, heard: &mut Vec<Heard>) -> Result<(), LiveError> {
        heard.extend(self.0.try_iter());
        Ok(())
    }

    fn send(&mut self, _: &JointCounts, _: f64) -> Result<(), LiveError> {
        Ok(())
    }

    fn stop(&mut self) -> Result<(), LiveError> {
        Ok(())
    }
}

/// "Sees" one tag, whose id is the image's first byte; an empty image is damaged.
struct Slow {
    takes: Duration,
    /// Lets the test hold a search.
    go: Receiver<()>,
}

impl TagFinder for Slow {
    fn find(&mut self, image: &CameraImage) -> Result<Vec<Message>, String> {
        std::thread::sleep(self.takes);
        let _ = self.go.recv();
        let id = u32::from(*image.jpeg.first().ok_or("it is empty")?);
        let tags = vec![TagDetection { id, corners_px: [[1.0; 2]; 4], decision_margin: 50.0 }];
        Ok(vec![Message::Detections(TagDetections { stamp: image.stamp, tags })])
    }
}

fn image(id: u8) -> Heard {
    Heard::Other(Message::Image(CameraImage { stamp: stamp(id), jpeg: vec![id; 10] }))
}

fn stamp(id: u8) -> Stamp {
    SIMULATION_EPOCH.plus_s(f64::from(id))
}

fn search() -> (Sender<Heard>, Sender<()>, ImageSearch<Pipe>) {
    let ((say, said), (go, gone)) = (channel(), channel());
    let finder = Slow { takes: Duration::from_millis(5), go: gone };
    (say, go, ImageSearch::new(Pipe(said), move || finder).expect("a thread"))
}

/// Receives until `wanted` returns true; returns the messages.
fn receive_until(wire: &mut impl Wire, wanted: impl Fn(&[Heard]) -> bool) -> Vec<Heard> {
    let (mut heard, began) = (Vec::new(), Instant::now());
    while !wanted(&heard) {
        assert!(began.elapsed() < Duration::from_secs(20), "only {heard:?} came");
        wire.receive(Duration::ZERO, &mut heard).expect("it receives");
        std::thread::sleep(Duration::from_millis(1));
    }
    heard
}

fn detections(heard: &[Heard]) -> Vec<(Stamp, u32)> {
    let of = |heard: &Heard| match heard {
        Heard::Other(Message::Detections(found)) => Some((found.stamp, found.tags[0].id)),
        _ => None,
    };
    heard.iter().filter_map(of).collect()
}

#[test]
fn images_are_passed_on_and_their_tags_follow_with_the_images_stamp() {
    let (say, go, mut wire) = search();
    for id in [3, 4, 5] {
        say.send(image(id)).expect("sent");
        go.send(()).expect("sent");
        let heard = receive_until(&mut wire, |heard| !detections(heard).is_empty());
        assert_eq!(heard[0], image(id), "the image itself is recorded");
        assert_eq!(detections(&heard), [(stamp(id), u32::from(id))]);
    }
}

/// The loop never waits, and after a long search the newest image is next.
#[test]
fn a_slow_search_skips_images_and_holds_nobody_up() {
    let (say, go, mut wire) = search();
    say.send(image(1)).expect("sent");
    let mut heard = receive_until(&mut wire, |heard| !heard.is_empty());
    // The search of the first one has begun, or it would be replaced by the next.
    std::thread::sleep(Duration::from_millis(100));
    let began = Instant::now();
    for id in 2..100 {
        say.send(image(id)).expect("sent");
        wire.receive(Duration::ZERO, &mut heard).expect("it receives");
    }
    assert!(began.elapsed() < Duration::from_secs(2), "{:?}", began.elapsed());
    assert_eq!(heard.len(), 99, "all images are passed on");
    for _ in 0..10 {
        go.send(()).expect("sent");
    }
    let found = receive_until(&mut wire, |heard| detections(heard).len() == 2);
    assert_eq!(detections(&found), [(stamp(1), 1), (stamp(99), 99)]);
}

#[test]
fn an_image_that_cannot_be_read_is_said_and_the_next_one_is_searched() {
    let (say, go, mut wire) = search();
    say.send(Heard::Other(Message::Image(CameraImage { stamp: stamp(1), jpeg: Vec::new() }))).expect("sent");
    go.send(()).expect("sent");
    let heard = receive_until(&mut wire, |heard| heard.len() == 2);
    assert_eq!(heard[1], Heard::Unusable("an image: it is empty".to_owned()));
    say.send(image(7)).expect("sent");
    go.send(()).expect("sent");
    assert_eq!(detections(&receive_until(&mut wire, |heard| heard.len() == 2)), [(stamp(7), 7)]);
}
