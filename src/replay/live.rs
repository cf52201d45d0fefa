//! A run as it happens, in a viewer that is open already.
//!
//! A thread of its own takes the messages from a bounded queue, draws a few times a second what is new (`news`) and
//! sends it. Whoever speaks never waits for a viewer: where none listens nothing is drawn, where one is too slow
//! messages are left out and counted. A viewer that comes late, or again, gets layout and scenery first.

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

/// Between two updates.
const TURN: Duration = Duration::from_millis(200);
/// Messages that may wait to be drawn, and their bytes: some seconds of images.
const MAX_WAITING: usize = 1 << 14;
const MAX_WAITING_BYTES: usize = 32 << 20;
/// Between two tries of somebody who waits.
const PAUSE: Duration = Duration::from_millis(2);
/// The viewer gets so long to take what is left at the end.
const FAREWELL: Duration = Duration::from_secs(2);
/// A viewer that is to show a whole recording must be there by then, and has so long to take it.
const CONNECT: Duration = Duration::from_secs(5);
const WHOLE: Duration = Duration::from_secs(120);

/// A view of a run that goes on.
pub struct LiveView {
    queue: SyncSender<(Stamp, Message)>,
    shared: Arc<Shared>,
    over: Receiver<Result<Taken, ReplayError>>,
}

/// What the thread that draws and those who speak both know.
#[derive(Default)]
struct Shared {
    waiting_bytes: AtomicUsize,
    left_out: AtomicU64,
    was_seen: AtomicBool,
    is_over: AtomicBool,
}

impl Shared {
    /// Whether there is room for the message.
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

/// How a view ended.
#[derive(Debug)]
pub struct LiveViewEnd {
    /// Whether a viewer ever listened.
    pub was_seen: bool,
    /// Whether a viewer was there at the end and took everything in time.
    pub was_taken: bool,
    /// Messages that were not sent because the viewer was too slow.
    pub left_out: u64,
    /// Why the view ended before the run.
    pub failure: Option<ReplayError>,
}

impl LiveView {
    /// Begins to look for a viewer at `address`, host and port, and goes on to look.
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
            // Nobody listens to the end of a view that was left.
            let _ = ended.send(show_news(&messages, News::new(drawings), viewer, &ours));
        };
        let started = std::thread::Builder::new().name("live view".to_owned()).spawn(view);
        started.map_err(|source| ReplayError::Thread { source })?;
        Ok(Self { queue, shared, over })
    }

    /// Something that takes messages for this view. It waits `patience` in all for a viewer that is too slow, and then
    /// leaves messages out.
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

    /// Lets the viewer have what is left, for two and a half seconds at most.
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
/// [`ReplayError::NoViewer`], or as for a file.
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

/// Until the run is over.
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

/// Hears messages for one turn; whether that was the last one.
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
