//! Search for tags in the images of a camera without a detector node, in parallel to the loop.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::{Heard, LiveError, Wire};
use armcal_core::streams::{CameraImage, JointCounts, Message};

/// Detector that searches an image for tags.
pub trait TagFinder {
    /// Returns detections with the image's stamp, and rejects if there are any.
    ///
    /// # Errors
    /// The fault of the image, for people.
    fn find(&mut self, image: &CameraImage) -> Result<Vec<Message>, String>;
}

/// A wire whose images are searched on a thread of their own. Where images come faster than they are searched, the
/// newest is searched next and those before it are not.
pub struct ImageSearch<W> {
    wire: W,
    next: Arc<Next>,
    found: Receiver<Heard>,
}

/// The image that is searched next.
#[derive(Default)]
struct Next {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    image: Option<CameraImage>,
    is_over: bool,
}

impl Next {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for an image; `None` at the end.
    fn take(&self) -> Option<CameraImage> {
        let mut state = self.lock();
        loop {
            if state.is_over {
                return None;
            }
            if let Some(image) = state.image.take() {
                return Some(image);
            }
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

impl<W: Wire> ImageSearch<W> {
    /// Searches the images that come over `wire`; the finder is made on its thread.
    ///
    /// # Errors
    /// [`LiveError::Thread`].
    pub fn new<F: TagFinder>(wire: W, make: impl FnOnce() -> F + Send + 'static) -> Result<Self, LiveError> {
        let (next, (told, found)) = (Arc::<Next>::default(), channel());
        let theirs = Arc::clone(&next);
        let search = move || search(&theirs, &mut make(), &told);
        std::thread::Builder::new().name("tags".to_owned()).spawn(search).map_err(LiveError::Thread)?;
        Ok(Self { wire, next, found })
    }
}

fn search(next: &Next, finder: &mut impl TagFinder, told: &Sender<Heard>) {
    while let Some(image) = next.take() {
        let found = match finder.find(&image) {
            Ok(messages) => messages.into_iter().map(Heard::Other).collect(),
            Err(why) => vec![Heard::Unusable(format!("an image: {why}"))],
        };
        for heard in found {
            if told.send(heard).is_err() {
                return;
            }
        }
    }
}

impl<W> Drop for ImageSearch<W> {
    fn drop(&mut self) {
        self.next.lock().is_over = true;
        self.next.changed.notify_all();
    }
}

impl<W: Wire> Wire for ImageSearch<W> {
    fn elapsed(&self) -> Duration {
        self.wire.elapsed()
    }

    fn receive(&mut self, timeout: Duration, heard: &mut Vec<Heard>) -> Result<(), LiveError> {
        let before = heard.len();
        self.wire.receive(timeout, heard)?;
        let newest = heard[before..].iter().rev().find_map(|heard| match heard {
            Heard::Other(Message::Image(image)) => Some(image.clone()),
            _ => None,
        });
        if let Some(image) = newest {
            self.next.lock().image = Some(image);
            self.next.changed.notify_all();
        }
        heard.extend(self.found.try_iter());
        Ok(())
    }

    fn send(&mut self, set_point: &JointCounts, within_s: f64) -> Result<(), LiveError> {
        self.wire.send(set_point, within_s)
    }

    fn stop(&mut self) -> Result<(), LiveError> {
        self.wire.stop()
    }
}
