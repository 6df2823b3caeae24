//! Accepts only requests from the page of this server on this machine.
//!
//! Every page that is open in the user's browser can reach a server on loopback. `Host` reveals names that an attacker
//! resolves to loopback; `Origin` and `Sec-Fetch-Site` reveal requests from other pages.

/// Headers of a request that identify its sender.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Asked<'a> {
    pub(crate) host: Option<&'a str>,
    pub(crate) origin: Option<&'a str>,
    pub(crate) site: Option<&'a str>,
}

/// Why a request is refused, if it is. `port` is the one the server listens on.
pub(crate) fn refusal(asked: &Asked, port: u16) -> Option<&'static str> {
    let names = ["localhost", "127.0.0.1", "[::1]"].map(|name| format!("{name}:{port}"));
    let host = asked.host.unwrap_or("").to_ascii_lowercase();
    if !names.contains(&host) {
        return Some("the Host header is not this server's");
    }
    let own = format!("http://{host}");
    if asked.origin.is_some_and(|o| !o.eq_ignore_ascii_case(&own)) {
        return Some("the request comes from another origin");
    }
    if asked.site.is_some_and(|s| s != "same-origin" && s != "none") {
        return Some("the request comes from another site");
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_loopback_names_and_their_own_origin() {
        let ask = |host, origin, site| refusal(&Asked { host, origin, site }, 8765).is_none();
        assert!(ask(Some("localhost:8765"), None, None));
        assert!(ask(Some("127.0.0.1:8765"), Some("http://127.0.0.1:8765"), Some("same-origin")));
        assert!(ask(Some("[::1]:8765"), None, Some("none")));
        assert!(!ask(None, None, None));
        assert!(!ask(Some("127.0.0.1"), None, None));
        assert!(!ask(Some("127.0.0.1:80"), None, None));
        assert!(!ask(Some("evil.example:8765"), Some("http://evil.example:8765"), None));
        assert!(!ask(Some("localhost:8765.evil.example"), None, None));
        assert!(!ask(Some("localhost:8765"), Some("http://127.0.0.1:8765"), None));
        assert!(!ask(Some("localhost:8765"), Some("https://localhost:8765"), None));
        assert!(!ask(Some("localhost:8765"), Some("null"), None));
        assert!(!ask(Some("localhost:8765"), None, Some("cross-site")));
        assert!(!ask(Some("localhost:8765"), None, Some("same-site")));
    }
}
