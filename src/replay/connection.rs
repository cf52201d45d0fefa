//! Connection to a running viewer.

use std::sync::mpsc::channel;
use std::time::Duration;

use crate::rerun::log::LogMsg;
use crate::rerun::{StoreId, StoreKind};
use re_grpc_client::write::{Client, ClientConnectionState, Options};

use crate::error::ReplayError;
use crate::news::Update;
use crate::rrd;

/// Default address of the viewer, on this machine only.
pub const LOOPBACK_VIEWER: &str = "127.0.0.1:9876";

/// State of the connection to a viewer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum State {
    /// No viewer has listened so far.
    Away,
    Connected,
    /// The viewer has left; nothing more can be sent over this connection.
    Lost,
}

/// Share of the data that a viewer took until the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Taken {
    Whole,
    InPart,
}

/// Viewer that listens, or may listen later.
pub(super) struct Viewer {
    address: String,
    client: Client,
    recording: StoreId,
    n_layouts: usize,
}

impl Viewer {
    /// Starts to look for a viewer at `address`, host and port. Each call has its own recording in the viewer.
    pub fn at(address: &str) -> Result<Self, ReplayError> {
        Self::connect(address, StoreId::random(StoreKind::Recording, rrd::APPLICATION))
    }

    fn connect(address: &str, recording: StoreId) -> Result<Self, ReplayError> {
        let wrong = || ReplayError::Address { address: address.to_owned() };
        let (host, port) = address.rsplit_once(':').ok_or_else(wrong)?;
        let is_port = port.parse::<u16>().is_ok_and(|port| port > 0);
        if host.is_empty() || host.contains('/') || !is_port {
            return Err(wrong());
        }
        let uri = format!("rerun+http://{address}/proxy").parse().map_err(|_| wrong())?;
        Ok(Self { address: address.to_owned(), client: Client::new(uri, Options::default()), recording, n_layouts: 0 })
    }

    pub fn state(&self) -> State {
        match self.client.status() {
            ClientConnectionState::Connecting { .. } => State::Away,
            ClientConnectionState::Connected => State::Connected,
            ClientConnectionState::Disconnected(_) => State::Lost,
        }
    }

    /// Looks for the viewer again after it was lost.
    pub fn again(self) -> Result<Self, ReplayError> {
        Self::connect(&self.address, self.recording)
    }

    /// Sends an update; waits while the viewer takes nothing.
    pub fn tell(&mut self, update: Update) -> Result<(), ReplayError> {
        if let Some(layout) = update.layout {
            self.client.send_blocking(rrd::store_info(&self.recording));
            self.n_layouts += 1;
            let id = format!("layout-{}-{}", self.recording.recording_id(), self.n_layouts);
            for message in rrd::layout(&self.recording, &id, &layout).map_err(ReplayError::Live)? {
                self.client.send_blocking(message);
            }
        }
        for chunk in update.chunks {
            let message = chunk.to_arrow_msg().map_err(|error| ReplayError::Live(error.into()))?;
            self.client.send_blocking(LogMsg::ArrowMsg(self.recording.clone(), message));
        }
        Ok(())
    }

    /// Ends the connection. Data that the viewer does not take within `patience` are lost.
    pub fn finish(self, patience: Duration) -> Taken {
        if self.state() != State::Connected {
            // A client that is dropped waits for an absent viewer.
            std::mem::forget(self.client);
            return Taken::InPart;
        }
        let (done, is_done) = channel();
        // A client that is dropped waits until all data were taken, for ever if the viewer takes none.
        let finish = move || {
            drop(self.client);
            let _ = done.send(());
        };
        let started = std::thread::Builder::new().name("live view's end".to_owned()).spawn(finish);
        if started.is_ok() && is_done.recv_timeout(patience).is_ok() { Taken::Whole } else { Taken::InPart }
    }
}
