//! Who may use the studio: the token of the address, the `Host` and `Origin` of a request.

use axum::http::header::{HOST, ORIGIN};
use axum::http::{HeaderMap, StatusCode};
use std::fmt::Write;

/// The bytes of a token.
const TOKEN: usize = 16;

/// The credentials that a request must have.
#[derive(Debug)]
pub struct Guard {
    token: String,
    /// The names and ports by which the server is reached, such as `127.0.0.1:7878`; none
    /// if it listens to other machines, which know it by names of their own.
    hosts: Vec<String>,
}

impl Guard {
    /// Makes a guard with a random token for a server at a port. `open`: whether it serves
    /// other machines.
    ///
    /// # Errors
    /// If the system has no random numbers.
    pub fn new(port: u16, open: bool) -> Result<Guard, String> {
        let mut bytes = [0; TOKEN];
        getrandom::fill(&mut bytes).map_err(|e| format!("no random token: {e}"))?;
        let token = bytes.iter().fold(String::new(), |mut s, b| {
            let _ = write!(s, "{b:02x}");
            s
        });
        let names = ["127.0.0.1", "localhost", "[::1]"];
        let hosts = match open {
            true => Vec::new(),
            false => names.iter().map(|n| format!("{n}:{port}")).collect(),
        };
        Ok(Guard { token, hosts })
    }

    /// Returns the token.
    pub fn token(&self) -> &str {
        &self.token
    }

    /// Checks `Host`, against names that were made to point here (DNS rebinding), and
    /// `Origin`, against other pages of the same browser.
    ///
    /// # Errors
    /// The status and the text of the refusal.
    pub fn check_origin(&self, headers: &HeaderMap) -> Result<(), Refusal> {
        let text = |name| headers.get(name).and_then(|v| v.to_str().ok());
        let host = text(HOST).unwrap_or_default();
        if !self.hosts.is_empty() && !self.hosts.iter().any(|h| h == host) {
            return Err((StatusCode::FORBIDDEN, "this server is not known by that name"));
        }
        match headers.contains_key(ORIGIN) {
            true if text(ORIGIN) != Some(&format!("http://{host}")) => {
                Err((StatusCode::FORBIDDEN, "a page of another origin may not use the studio"))
            }
            _ => Ok(()),
        }
    }

    /// Checks a token, in a time that does not tell how much of it is right.
    ///
    /// # Errors
    /// The status and the text of the refusal.
    pub fn check_token(&self, given: Option<&str>) -> Result<(), Refusal> {
        let given = given.unwrap_or_default().as_bytes();
        let differences = self.token.bytes().zip(given).fold(0, |d, (a, b)| d | (a ^ b));
        match given.len() == self.token.len() && differences == 0 {
            true => Ok(()),
            false => Err((
                StatusCode::UNAUTHORIZED,
                "the token is missing or wrong: open the address that `pcadlang studio` printed",
            )),
        }
    }
}

/// Why a request is refused.
pub type Refusal = (StatusCode, &'static str);

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    fn headers(host: &'static str, origin: Option<&'static str>) -> HeaderMap {
        let mut h = HeaderMap::new();
        h.insert(HOST, HeaderValue::from_static(host));
        origin.map(|o| h.insert(ORIGIN, HeaderValue::from_static(o)));
        h
    }

    #[test]
    fn only_the_servers_own_page_with_the_token_is_served() {
        let g = Guard::new(7000, false).unwrap();
        assert!(g.check_token(Some(g.token())).is_ok() && g.token().len() == 2 * TOKEN);
        let mut wrong = g.token().to_owned();
        wrong.pop();
        assert!(g.check_token(Some(&wrong)).is_err());
        wrong.push(if g.token().ends_with('0') { '1' } else { '0' });
        assert!(g.check_token(Some(&wrong)).is_err() && g.check_token(None).is_err());
        assert_ne!(g.token(), Guard::new(7000, false).unwrap().token());

        let ok = |host, origin| g.check_origin(&headers(host, origin)).is_ok();
        assert!(ok("127.0.0.1:7000", None) && ok("localhost:7000", Some("http://localhost:7000")));
        assert!(!ok("evil.example:7000", None), "a name that points here");
        assert!(!ok("127.0.0.1:7000", Some("http://evil.example")), "another page");
        assert!(!ok("127.0.0.1:7000", Some("http://127.0.0.1:8000")), "another port");
        assert!(!ok("127.0.0.1:7000", Some("null")) && !ok("127.0.0.1", None));
        let open = Guard::new(7000, true).unwrap();
        assert!(open.check_origin(&headers("studio.lan:7000", None)).is_ok());
        assert!(open.check_origin(&headers("studio.lan:7000", Some("http://other"))).is_err());
    }
}
