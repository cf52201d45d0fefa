//! WebSocket on its own thread, which always listens. It answers pings and drops old readings while a session plans,
//! and neither a slow line nor a stuck one delays the loop.

use std::collections::VecDeque;
use std::io::ErrorKind;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use mio::net::TcpStream;
use mio::{Events, Interest, Poll, Token, Waker};
use tungstenite::protocol::{Role, WebSocketConfig};
use tungstenite::{Error, Message, WebSocket};

use super::handshake::Opened;
use super::protocol::{Listener, Said, shown};
use crate::topics::Content;
use crate::{Heard, LiveError};
use armcal_core::log::Stream;

/// Largest size of a message that is read.
const MAX_MESSAGE_BYTES: usize = 32 << 20;
/// Largest number of bytes that wait to be sent; with more, the other side takes none.
const MAX_WAITING_BYTES: usize = 1 << 20;
/// Number of messages of one topic that are kept while nobody listens; `IMAGE_DEPTH` is that of images, which are
/// large.
const DEPTH: usize = 200;
const IMAGE_DEPTH: usize = 4;
/// Number of messages that are read between two looks at the outbox.
const BURST: usize = 64;
/// Longest time for which the other side may take nothing.
const WRITE_LIMIT: Duration = Duration::from_millis(250);
/// Longest sleep of the thread; `SLEEP_WRITING` applies while a text waits to be sent.
const SLEEP: Duration = Duration::from_millis(100);
const SLEEP_WRITING: Duration = Duration::from_millis(5);

const SOCKET: Token = Token(0);
const WAKER: Token = Token(1);

/// End of the link outside its thread.
pub(super) struct Link {
    shared: Arc<Shared>,
    waker: Waker,
    thread: Option<JoinHandle<()>>,
}

#[derive(Default)]
struct Shared {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    inbox: VecDeque<(Option<Content>, Heard)>,
    outbox: Vec<String>,
    /// True if a text was taken from the outbox that may not be on its way yet.
    is_writing: bool,
    /// Reason for which the connection is lost.
    lost: Option<String>,
    is_over: bool,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits while `is_waiting` returns true, for at most `timeout`.
    fn wait(&self, timeout: Duration, is_waiting: impl Fn(&State) -> bool) -> MutexGuard<'_, State> {
        let waited = self.changed.wait_timeout_while(self.lock(), timeout, |state| is_waiting(state));
        waited.unwrap_or_else(PoisonError::into_inner).0
    }

    fn lose(&self, why: String) {
        self.lock().lost.get_or_insert(why);
        self.changed.notify_all();
    }
}

impl State {
    /// Keeps the newest messages of each topic.
    fn keep(&mut self, content: Option<Content>, heard: Heard) {
        let depth = if content == Some(Content::Stream(Stream::Images)) { IMAGE_DEPTH } else { DEPTH };
        let is_same = |(own, _): &(Option<Content>, Heard)| *own == content;
        if self.inbox.iter().filter(|kept| is_same(kept)).count() >= depth {
            let oldest = self.inbox.iter().position(is_same);
            oldest.map(|oldest| self.inbox.remove(oldest));
        }
        self.inbox.push_back((content, heard));
    }
}

impl Link {
    pub fn start(opened: Opened, listener: Listener, url: &str) -> Result<Self, LiveError> {
        let failed = |error: std::io::Error| LiveError::rosbridge(url, error.to_string());
        opened.stream.set_nonblocking(true).map_err(failed)?;
        let mut stream = TcpStream::from_std(opened.stream);
        let poll = Poll::new().map_err(failed)?;
        poll.registry().register(&mut stream, SOCKET, Interest::READABLE | Interest::WRITABLE).map_err(failed)?;
        let waker = Waker::new(poll.registry(), WAKER).map_err(failed)?;
        let config = WebSocketConfig::default()
            .max_message_size(Some(MAX_MESSAGE_BYTES))
            .max_frame_size(Some(MAX_MESSAGE_BYTES))
            .write_buffer_size(0)
            .max_write_buffer_size(MAX_WAITING_BYTES);
        let socket = WebSocket::from_partially_read(stream, opened.rest, Role::Client, Some(config));
        let shared = Arc::<Shared>::default();
        let (theirs, complained) = (Arc::clone(&shared), String::new());
        let mut line = Line { socket, shared: theirs, listener, complained, blocked_since: None };
        let run = move || {
            if let Err(why) = line.run(poll) {
                line.shared.lose(why);
            }
        };
        let thread = std::thread::Builder::new().name("rosbridge".to_owned()).spawn(run).map_err(LiveError::Thread)?;
        Ok(Self { shared, waker, thread: Some(thread) })
    }

    /// Waits for messages, for at most `timeout`, and appends all that came. Returns the reason if the connection is
    /// lost and no message is left.
    pub fn take(&self, timeout: Duration, heard: &mut Vec<Heard>) -> Result<(), String> {
        let mut state = self.shared.wait(timeout, |state| state.inbox.is_empty() && state.lost.is_none());
        if let (true, Some(why)) = (state.inbox.is_empty(), &state.lost) {
            return Err(why.clone());
        }
        heard.extend(state.inbox.drain(..).map(|(_, heard)| heard));
        Ok(())
    }

    /// Hands texts to the thread, in this order.
    pub fn send(&self, texts: impl IntoIterator<Item = String>) -> Result<(), String> {
        let mut state = self.shared.lock();
        if let Some(why) = &state.lost {
            return Err(why.clone());
        }
        state.outbox.extend(texts);
        drop(state);
        self.waker.wake().map_err(|error| error.to_string())
    }

    /// Waits until all texts are on their way, for at most `timeout`.
    pub fn flush(&self, timeout: Duration) -> Result<(), String> {
        let is_waiting = |state: &State| (state.is_writing || !state.outbox.is_empty()) && state.lost.is_none();
        let state = self.shared.wait(timeout, is_waiting);
        match &state.lost {
            Some(why) => Err(why.clone()),
            None if is_waiting(&state) => Err("it takes nothing".to_owned()),
            None => Ok(()),
        }
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        self.shared.lock().is_over = true;
        // Without the waker the thread looks later.
        let _ = self.waker.wake();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// End of the link on its thread.
struct Line {
    socket: WebSocket<TcpStream>,
    shared: Arc<Shared>,
    listener: Listener,
    /// Last complaint: a repeated one is reported once.
    complained: String,
    /// Time from which a text has waited to be sent.
    blocked_since: Option<Instant>,
}

impl Line {
    /// Runs until the link closes; the error says why the connection is lost.
    fn run(&mut self, mut poll: Poll) -> Result<(), String> {
        let mut events = Events::with_capacity(8);
        loop {
            let is_over = self.write()?;
            if is_over && self.blocked_since.is_none() {
                self.say_goodbye(&mut poll, &mut events);
                return Ok(());
            }
            if self.read()? {
                continue;
            }
            let sleep = if self.blocked_since.is_some() { SLEEP_WRITING } else { SLEEP };
            if let Err(error) = poll.poll(&mut events, Some(sleep))
                && error.kind() != ErrorKind::Interrupted
            {
                return Err(error.to_string());
            }
        }
    }

    /// Reads to the end: with bytes that nobody took the system would cut the connection, and the other side might miss
    /// what was said last.
    fn say_goodbye(&mut self, poll: &mut Poll, events: &mut Events) {
        let until = Instant::now() + WRITE_LIMIT;
        let mut closed = unless_blocked(self.socket.close(None)).map(|_| None);
        while let Ok(message) = closed
            && Instant::now() < until
        {
            if message.is_none() {
                let _ = poll.poll(events, Some(SLEEP_WRITING));
            }
            closed = unless_blocked(self.socket.read());
        }
    }

    /// Sends the waiting texts, as far as the other side takes them; returns true at the end.
    fn write(&mut self) -> Result<bool, String> {
        let (texts, is_over) = {
            let mut state = self.shared.lock();
            state.is_writing = self.blocked_since.is_some() || !state.outbox.is_empty();
            (std::mem::take(&mut state.outbox), state.is_over)
        };
        for text in texts {
            unless_blocked(self.socket.write(Message::text(text)))?;
        }
        if unless_blocked(self.socket.flush())?.is_some() {
            self.blocked_since = None;
            let mut state = self.shared.lock();
            if std::mem::take(&mut state.is_writing) {
                self.shared.changed.notify_all();
            }
        } else if self.blocked_since.get_or_insert_with(Instant::now).elapsed() > WRITE_LIMIT {
            return Err(format!("it has taken nothing for {} s", WRITE_LIMIT.as_secs_f64()));
        }
        Ok(is_over)
    }

    /// Reads the messages that have come; returns true if there may be more.
    fn read(&mut self) -> Result<bool, String> {
        for _ in 0..BURST {
            let said = match unless_blocked(self.socket.read())? {
                None => return Ok(false),
                Some(Message::Text(text)) => self.listener.read(&text),
                Some(Message::Binary(_)) => Said::Complaint("it sent a binary message".to_owned()),
                Some(Message::Close(frame)) => {
                    let reason = frame.map(|frame| shown(&frame.reason)).filter(|reason| !reason.is_empty());
                    return Err(format!(
                        "it closed the connection{}",
                        reason.map_or_else(String::new, |r| format!(": {r}"))
                    ));
                }
                Some(Message::Ping(_) | Message::Pong(_) | Message::Frame(_)) => Said::Nothing,
            };
            let (content, heard) = match said {
                Said::Heard(content, heard) => (Some(content), heard),
                Said::Complaint(why) => (None, Heard::Unusable(self.complain(&why))),
                Said::Nothing => continue,
            };
            self.shared.lock().keep(content, heard);
            self.shared.changed.notify_all();
        }
        Ok(true)
    }

    fn complain(&mut self, why: &str) -> String {
        if self.complained != why {
            tracing::warn!("rosbridge: {why}");
            why.clone_into(&mut self.complained);
        }
        format!("rosbridge: {why}")
    }
}

/// Returns the value; `None` if the call would block, and the reason if the connection is of no use any more.
fn unless_blocked<T>(done: Result<T, Error>) -> Result<Option<T>, String> {
    match done {
        Ok(value) => Ok(Some(value)),
        Err(Error::Io(error)) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Ok(None),
        Err(Error::WriteBufferFull(_)) => Err("it takes nothing".to_owned()),
        Err(Error::ConnectionClosed | Error::AlreadyClosed) => Err("it hung up".to_owned()),
        Err(error) => Err(shown(&error.to_string())),
    }
}
