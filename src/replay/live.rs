//! View of a run in progress, in an open viewer.
//!
//! A separate thread takes the messages from a bounded queue, draws the new data (`news`) a few times per second and
//! sends them. The sender of messages never waits for a viewer. Without a viewer nothing is drawn; if the viewer is too
//! slow, messages are dropped and counted. A viewer that connects late, or again, gets layout and scenery first.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, channel, sync_channel};
use std::time::{Duration, Instant};

use crate::blueprint;
use crate::connection::{State, Taken, Viewer};
use crate::error::ReplayError;
use crate::news::{LiveDrawings, News, Update};
use crate::read::bytes_of;
use crate::recording::{draw, scene};
use crate::scene::ReplayInput;
use armcal_core::streams::Message;
use armcal_core::time::Stamp;

/// Time between two updates.
const TURN: Duration = Duration::from_millis(200);
/// Largest number of messages that may wait to be drawn, and their bytes: several seconds of images.
const MAX_WAITING: usize = 1 << 14;
const MAX_WAITING_BYTES: usize = 32 << 20;
/// Time between two attempts of a waiting sender.
const PAUSE: Duration = Duration::from_millis(2);
/// Time in which the viewer may take the remaining data at the end.
const FAREWELL: Duration = Duration::from_secs(2);
/// Time in which a viewer must connect to show a whole recording; `WHOLE` is the time in which it may take the
/// recording.
const CONNECT: Duration = Duration::from_secs(5);
const WHOLE: Duration = Duration::from_secs(120);

/// View of a run in progress.
pub struct LiveView {
    queue: SyncSender<(Stamp, Message)>,
    shared: Arc<Shared>,
    over: Receiver<Result<Taken, ReplayError>>,
}

/// State that the drawing thread and the senders share.
#[derive(Default)]
struct Shared {
    waiting_bytes: AtomicUsize,
    left_out: AtomicU64,
    was_seen: AtomicBool,
    is_over: AtomicBool,
}

impl Shared {
    /// Puts the message into the queue; returns false if there is no room.
    fn offer(&self, queue: &SyncSender<(Stamp, Message)>, log_time: Stamp, message: &Message) -> bool {
        let bytes = bytes_of(message);
        let waiting = self.waiting_bytes.fetch_add(bytes, Ordering::Relaxed);
        let is_taken = waiting + bytes <= MAX_WAITING_BYTES && queue.try_send((log_time, message.clone())).is_ok();
        if !is_taken {
            self.waiting_bytes.fetch_sub(bytes, Ordering::Relaxed);
        }
        is_taken
    }
}

/// Outcome of a view.
#[derive(Debug)]
pub struct LiveViewEnd {
    /// True if a viewer ever listened.
    pub was_seen: bool,
    /// True if a viewer was connected at the end and took everything in time.
    pub was_taken: bool,
    /// Number of messages that were dropped because the viewer was too slow.
    pub left_out: u64,
    /// Reason for which the view ended before the run.
    pub failure: Option<ReplayError>,
}

impl LiveView {
    /// Starts to look for a viewer at `address`, host and port, and continues to look.
    ///
    /// # Errors
    /// [`ReplayError::Address`].
    pub fn open(drawings: LiveDrawings, address: &str) -> Result<Self, ReplayError> {
        let viewer = Viewer::at(address)?;
        let (queue, messages) = sync_channel(MAX_WAITING);
        let (ended, over) = channel();
        let shared = Arc::<Shared>::default();
        let ours = Arc::clone(&shared);
        let view = move || {
            // Nobody reads the end of a view that was dropped.
            let _ = ended.send(show_news(&messages, News::new(drawings), viewer, &ours));
        };
        let started = std::thread::Builder::new().name("live view".to_owned()).spawn(view);
        started.map_err(|source| ReplayError::Thread { source })?;
        Ok(Self { queue, shared, over })
    }

    /// Returns a function that takes messages for this view. For a viewer that is too slow it waits `patience` in
    /// total, and then drops messages.
    pub fn listener(&self, mut patience: Duration) -> impl FnMut(Stamp, &Message) + Send + use<> {
        let (queue, shared) = (self.queue.clone(), Arc::clone(&self.shared));
        move |log_time, message| {
            while !shared.offer(&queue, log_time, message) {
                if patience.is_zero() {
                    shared.left_out.fetch_add(1, Ordering::Relaxed);
                    break;
                }
                let pause = patience.min(PAUSE);
                std::thread::sleep(pause);
                patience -= pause;
            }
        }
    }

    /// Lets the viewer take the remaining data, for at most 2.4 s.
    #[must_use]
    pub fn end(self) -> LiveViewEnd {
        self.shared.is_over.store(true, Ordering::Relaxed);
        drop(self.queue);
        let (was_taken, failure) = match self.over.recv_timeout(FAREWELL + TURN + TURN) {
            Ok(Ok(taken)) => (taken == Taken::Whole, None),
            Ok(Err(failure)) => (false, Some(failure)),
            Err(_) => (false, None),
        };
        let was_seen = self.shared.was_seen.load(Ordering::Relaxed);
        LiveViewEnd { was_seen, was_taken, left_out: self.shared.left_out.load(Ordering::Relaxed), failure }
    }
}

/// Shows a whole recording in the viewer that listens at `address`.
///
/// # Errors
/// [`ReplayError::NoViewer`], or the errors of writing a file.
pub fn show_recording(input: &ReplayInput, address: &str) -> Result<(), ReplayError> {
    let gone = || ReplayError::NoViewer { address: address.to_owned() };
    let mut viewer = Viewer::at(address)?;
    let asked = Instant::now();
    while viewer.state() != State::Connected {
        if asked.elapsed() > CONNECT {
            return Err(gone());
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    let run = scene(input)?;
    let chunks = draw(&run, input).into_chunks().map_err(ReplayError::Live)?;
    viewer.tell(Update { layout: Some(blueprint::build(&run)), chunks })?;
    match viewer.finish(WHOLE) {
        Taken::Whole => Ok(()),
        Taken::InPart => Err(gone()),
    }
}

/// Shows news until the run is over.
fn show_news(
    messages: &Receiver<(Stamp, Message)>,
    mut news: News,
    mut viewer: Viewer,
    shared: &Shared,
) -> Result<Taken, ReplayError> {
    loop {
        let is_over = hear_for_a_turn(messages, &mut news, shared);
        match viewer.state() {
            State::Connected => {
                shared.was_seen.store(true, Ordering::Relaxed);
                let update = if is_over { news.take_rest()? } else { news.take()? };
                if let Some(update) = update {
                    viewer.tell(update)?;
                }
            }
            State::Away => {}
            State::Lost => {
                viewer = viewer.again()?;
                news.forget_shown();
            }
        }
        news.trim();
        if is_over {
            return Ok(viewer.finish(FAREWELL));
        }
    }
}

/// Takes messages for one turn; returns true if it was the last turn.
fn hear_for_a_turn(messages: &Receiver<(Stamp, Message)>, news: &mut News, shared: &Shared) -> bool {
    let end = Instant::now() + TURN;
    loop {
        match messages.recv_timeout(end.saturating_duration_since(Instant::now())) {
            Ok((log_time, message)) => {
                shared.waiting_bytes.fetch_sub(bytes_of(&message), Ordering::Relaxed);
                news.hear(log_time, message);
            }
            Err(RecvTimeoutError::Timeout) => return shared.is_over.load(Ordering::Relaxed),
            Err(RecvTimeoutError::Disconnected) => return true,
        }
    }
}
