//! Messages of work that goes on beside the loop, such as a search for tags in an image.

use std::sync::mpsc::{Receiver, TryRecvError, channel};

use super::message::Message;

/// Why the work came to nothing, for people.
pub type LateError = Box<dyn std::error::Error + Send + Sync>;

/// Messages that come when the work for them is done, in one go.
#[derive(Debug)]
pub struct LateMessages(Receiver<Result<Vec<Message>, LateError>>);

/// Where the work leaves its messages.
pub type LateSender = std::sync::mpsc::Sender<Result<Vec<Message>, LateError>>;

impl LateMessages {
    /// Both ends.
    #[must_use]
    pub fn pair() -> (LateSender, Self) {
        let (sender, receiver) = channel();
        (sender, Self(receiver))
    }

    /// Waits for them.
    ///
    /// # Errors
    /// Why there are none.
    pub fn wait(&self) -> Result<Vec<Message>, LateError> {
        self.0.recv().unwrap_or_else(|_| Err(Self::abandoned()))
    }

    /// Without waiting; `None` where the work goes on.
    ///
    /// # Errors
    /// Why there are none.
    pub fn take_finished(&self) -> Option<Result<Vec<Message>, LateError>> {
        match self.0.try_recv() {
            Ok(messages) => Some(messages),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => Some(Err(Self::abandoned())),
        }
    }

    fn abandoned() -> LateError {
        "the work for a message ended without one".into()
    }
}
