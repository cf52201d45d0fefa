//! Address of a rosbridge, and the ROS version behind it.

use schemars::JsonSchema;
use serde::Deserialize;

/// The table `[rosbridge]` of a connection map.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Rosbridge {
    /// Address of the bridge: `ws://HOST:PORT`.
    pub url: String,
    /// ROS version, 1 or 2, which decides the spelling of times and types.
    #[schemars(range(min = 1, max = 2))]
    pub ros: u32,
}

impl Default for Rosbridge {
    fn default() -> Self {
        Self { url: "ws://127.0.0.1:9090".to_owned(), ros: 1 }
    }
}

impl Rosbridge {
    /// Returns host and port.
    pub(crate) fn address(&self) -> Result<(&str, u16), String> {
        let problem = || format!("{:?} is not ws://HOST:PORT, such as \"ws://127.0.0.1:9090\"", self.url);
        let (host, port) = self.url.strip_prefix("ws://").and_then(|rest| rest.rsplit_once(':')).ok_or_else(problem)?;
        // An address of IPv6 stands in brackets.
        let inner = host.strip_prefix('[').and_then(|host| host.strip_suffix(']'));
        let is_sound = match inner {
            Some(address) => address.parse::<std::net::Ipv6Addr>().is_ok(),
            None => !host.is_empty() && host.chars().all(|c| c.is_ascii_alphanumeric() || c == '.' || c == '-'),
        };
        let is_number = port.chars().all(|c| c.is_ascii_digit());
        let port = port.parse().ok().filter(|port| *port != 0 && is_sound && is_number).ok_or_else(problem)?;
        Ok((inner.unwrap_or(host), port))
    }

    /// Returns a type's name as this ROS writes it.
    pub(crate) fn type_name(&self, ros2_name: &str) -> String {
        if self.ros == 1 { ros2_name.replacen("/msg/", "/", 1) } else { ros2_name.to_owned() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn host_and_port_are_all_that_a_url_may_have() {
        let of = |url: &str| Rosbridge { url: url.to_owned(), ros: 1 }.address().map(|(h, p)| (h.to_owned(), p));
        assert_eq!(of("ws://127.0.0.1:9090"), Ok(("127.0.0.1".to_owned(), 9090)));
        assert_eq!(of("ws://rov-7.local:80"), Ok(("rov-7.local".to_owned(), 80)));
        assert_eq!(of("ws://[::1]:9090"), Ok(("::1".to_owned(), 9090)));
        for url in [
            "",
            "127.0.0.1:9090",
            "wss://127.0.0.1:9090",
            "http://127.0.0.1:9090",
            "ws://127.0.0.1",
            "ws://:9090",
            "ws://a:0",
            "ws://a:65536",
            "ws://a:+9",
            "ws://a:9090/",
            "ws://a@b:9090",
            "ws://a\r\nX: b:9090",
            "ws://::1:9090",
            "ws://[a]:9090",
        ] {
            assert!(of(url).is_err_and(|problem| problem.contains("ws://HOST:PORT")), "{url}");
        }
    }
}
