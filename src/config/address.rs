//! Comparison of the addresses in a file, without a look at the network.

/// True if a server at `one` and a server at `other` would need the same port of this machine, or if both name one server.
///
/// Loopback addresses are one machine. An address for all interfaces (`0.0.0.0`, `[::]`) includes them.
#[must_use]
pub(crate) fn share_a_port(one: &str, other: &str) -> bool {
    let parts = |address: &str| -> Option<(String, u16)> {
        let (host, port) = address.rsplit_once(':')?;
        let host = host.trim_matches(['[', ']']).to_ascii_lowercase();
        let host = match host.as_str() {
            "localhost" | "127.0.0.1" | "::1" | "0.0.0.0" | "::" => "this machine".to_owned(),
            _ => host,
        };
        Some((host, port.parse().ok()?))
    };
    match (parts(one), parts(other)) {
        // Port 0 is any free port.
        (Some(one), Some(other)) => one == other && one.1 != 0,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::share_a_port;

    #[test]
    fn loopback_names_are_one_machine() {
        assert!(share_a_port("127.0.0.1:4824", "localhost:4824"));
        assert!(share_a_port("[::1]:4824", "0.0.0.0:4824"));
        assert!(share_a_port("Rig.lab:4824", "rig.lab:4824"));
        assert!(!share_a_port("127.0.0.1:4824", "127.0.0.1:4823"));
        assert!(!share_a_port("rig.lab:4824", "127.0.0.1:4824"));
        assert!(!share_a_port("127.0.0.1:0", "127.0.0.1:0"));
        assert!(!share_a_port("127.0.0.1", "127.0.0.1"));
    }
}
