//! Opens a WebSocket (RFC 6455, section 4).

use std::io::{Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant, SystemTime};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use sha1::{Digest, Sha1};

/// Text that every server appends to the key.
const MAGIC: &str = "258EAFA5-E914-47DA-95CA-C5AB0DC85B11";
/// Longest answer that is read.
const MAX_ANSWER_BYTES: usize = 16 << 10;

/// Connection that speaks WebSocket from here on, and the bytes that it has already received.
pub(super) struct Opened {
    pub stream: TcpStream,
    pub rest: Vec<u8>,
}

/// Connects within `limit`.
pub(super) fn open(host: &str, port: u16, limit: Duration) -> Result<Opened, String> {
    let until = Instant::now() + limit;
    let addresses = (host, port).to_socket_addrs().map_err(|error| error.to_string())?;
    let mut problem = "no such host".to_owned();
    for address in addresses {
        match TcpStream::connect_timeout(&address, left(until)) {
            Ok(stream) => return upgrade(stream, host, port, until),
            Err(error) => problem = format!("{error}; does a rosbridge listen there?"),
        }
    }
    Err(problem)
}

/// Returns the time left until `until`; never zero, which would be no limit.
fn left(until: Instant) -> Duration {
    until.saturating_duration_since(Instant::now()).max(Duration::from_millis(1))
}

fn upgrade(mut stream: TcpStream, host: &str, port: u16, until: Instant) -> Result<Opened, String> {
    let told = |error: std::io::Error| match error.kind() {
        std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut => "it does not answer".to_owned(),
        _ => error.to_string(),
    };
    stream.set_nodelay(true).map_err(told)?;
    stream.set_write_timeout(Some(left(until))).map_err(told)?;
    let (key, host) = (key(), if host.contains(':') { format!("[{host}]") } else { host.to_owned() });
    let request = format!(
        "GET / HTTP/1.1\r\nHost: {host}:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
         Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n"
    );
    stream.write_all(request.as_bytes()).map_err(told)?;
    let (mut answer, mut piece) = (Vec::new(), [0; 1024]);
    loop {
        if let Some(end) = answer.windows(4).position(|four| four == b"\r\n\r\n") {
            check_answer(&String::from_utf8_lossy(&answer[..end]), &key)?;
            return Ok(Opened { stream, rest: answer.split_off(end + 4) });
        }
        if answer.len() > MAX_ANSWER_BYTES || Instant::now() >= until {
            return Err("its answer is no WebSocket's".to_owned());
        }
        stream.set_read_timeout(Some(left(until))).map_err(told)?;
        match stream.read(&mut piece).map_err(told)? {
            0 => return Err("it hung up instead of opening a WebSocket".to_owned()),
            n => answer.extend_from_slice(&piece[..n]),
        }
    }
}

fn check_answer(head: &str, key: &str) -> Result<(), String> {
    let mut lines = head.split("\r\n");
    let status = lines.next().unwrap_or_default();
    if !status.starts_with("HTTP/1.1 101") {
        let status: String = status.chars().take(80).collect();
        return Err(format!("it opens no WebSocket, but answers {status:?}"));
    }
    let fields: Vec<_> = lines.filter_map(|line| line.split_once(':')).collect();
    let is = |name: &str, expected: &str, same: fn(&str, &str) -> bool| {
        fields.iter().any(|(own, value)| own.eq_ignore_ascii_case(name) && same(value.trim(), expected))
    };
    if !is("Upgrade", "websocket", str::eq_ignore_ascii_case) || !is("Sec-WebSocket-Accept", &accept_key(key), str::eq)
    {
        return Err("it accepts, but not as a WebSocket does".to_owned());
    }
    Ok(())
}

/// Returns the server's answer to a key.
pub(crate) fn accept_key(key: &str) -> String {
    STANDARD.encode(Sha1::digest(format!("{key}{MAGIC}")))
}

/// Returns a new key for each connection; it is no secret.
fn key() -> String {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    let hash = Sha1::digest(format!("{} {}", now.as_nanos(), std::process::id()));
    STANDARD.encode(&hash[..16])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of RFC 6455, section 1.3.
    const KEY: &str = "dGhlIHNhbXBsZSBub25jZQ==";
    const ACCEPT: &str = "s3pPLMBiTxaQ9kYGzzhZRbK+xOo=";

    #[test]
    fn a_server_is_one_that_answers_the_key() {
        assert_eq!(accept_key(KEY), ACCEPT);
        let head = |status: &str, accept: &str| {
            format!("HTTP/1.1 {status}\r\nupgrade: WebSocket\r\nConnection: Upgrade\r\nsec-websocket-accept: {accept}")
        };
        assert_eq!(check_answer(&head("101 Switching Protocols", ACCEPT), KEY), Ok(()));
        let others = [head("101 Switching Protocols", &ACCEPT.to_lowercase()), head("404 Not Found", ACCEPT)];
        let told = others.map(|other| check_answer(&other, KEY).expect_err("no WebSocket"));
        insta::assert_snapshot!("handshakes", told.join("\n"));
    }

    #[test]
    fn a_key_is_of_sixteen_bytes() {
        assert_eq!(STANDARD.decode(key()).unwrap().len(), 16);
    }
}
