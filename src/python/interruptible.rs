//! Long work without the lock of the interpreter: other Python threads run on, and Ctrl-C ends the wait.

use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread::Builder;
use std::time::Duration;

use pyo3::prelude::*;

use crate::errors::wrong_value;

/// Period in which signals are looked for.
const LOOK: Duration = Duration::from_millis(50);
/// As the main thread of a program has.
const STACK_BYTES: usize = 16 << 20;

/// Does `work` without the interpreter's lock. After Ctrl-C its answer is thrown away.
pub fn interruptible<T: Send + 'static>(py: Python<'_>, work: impl FnOnce() -> T + Send + 'static) -> PyResult<T> {
    let (sender, receiver) = channel();
    let begun = Builder::new().stack_size(STACK_BYTES).spawn(move || {
        let _ = sender.send(work());
    });
    begun.map_err(|error| wrong_value(format!("no thread can be started: {error}; free memory or threads")))?;
    py.detach(move || {
        loop {
            match receiver.recv_timeout(LOOK) {
                Ok(answer) => return Ok(answer),
                Err(RecvTimeoutError::Timeout) => Python::attach(|py| py.check_signals())?,
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(wrong_value("the work ended without an answer; please report it with its inputs"));
                }
            }
        }
    })
}
