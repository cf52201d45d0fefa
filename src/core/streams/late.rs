//! Messages of work that runs parallel to the loop, such as a search for tags in an image.

use std::sync::mpsc::{Receiver, TryRecvError, channel};

use super::message::Message;

/// Reason why the work failed, for people.
pub type LateError = Box<dyn std::error::Error + Send + Sync>;

/// Messages that arrive all at once when the work for them is done.
#[derive(Debug)]
pub struct LateMessages(Receiver<Result<Vec<Message>, LateError>>);

/// Sender through which the work delivers its messages.
pub type LateSender = std::sync::mpsc::Sender<Result<Vec<Message>, LateError>>;

impl LateMessages {
    /// Returns both ends of the channel.
    #[must_use]
    pub fn pair() -> (LateSender, Self) {
        let (sender, receiver) = channel();
        (sender, Self(receiver))
    }

    /// Waits for the messages and returns them.
    ///
    /// # Errors
    /// The reason why there are none.
    pub fn wait(&self) -> Result<Vec<Message>, LateError> {
        self.0.recv().unwrap_or_else(|_| Err(Self::abandoned()))
    }

    /// Returns the messages without waiting; `None` while the work goes on.
    ///
    /// # Errors
    /// The reason why there are none.
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
