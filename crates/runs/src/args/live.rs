//! The argument of `--live`.

use std::path::PathBuf;
use std::str::FromStr;

/// Where states are sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Live {
    /// A folder.
    Folder(PathBuf),
    /// A server, `HOST:PORT`, and a path on it.
    Server(String, String),
}

impl FromStr for Live {
    type Err = String;

    fn from_str(text: &str) -> Result<Live, String> {
        if text.starts_with("https://") {
            return Err("only http:// addresses can be reached".to_owned());
        }
        let Some(rest) = text.strip_prefix("http://") else {
            return Ok(Live::Folder(PathBuf::from(text)));
        };
        let (host, path) = rest.split_once('/').unwrap_or((rest, ""));
        if host.is_empty() || host.contains(|c: char| c.is_whitespace() || c == '@') {
            return Err(format!("`{text}` has no host"));
        }
        let port = host.rsplit_once(':').is_some_and(|(_, p)| p.parse::<u16>().is_ok());
        let host = if port { host.to_owned() } else { format!("{host}:80") };
        let path = path.trim_end_matches('/');
        let path = if path.is_empty() { String::new() } else { format!("/{path}") };
        Ok(Live::Server(host, path))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_or_an_address() {
        let of = |text: &str| text.parse::<Live>();
        let server = |host: &str, path: &str| Ok(Live::Server(host.into(), path.into()));
        assert_eq!(of("out/live"), Ok(Live::Folder("out/live".into())));
        assert_eq!(of("http://127.0.0.1:9000"), server("127.0.0.1:9000", ""));
        assert_eq!(of("http://viewer/a/b/"), server("viewer:80", "/a/b"));
        assert!(
            of("https://viewer").is_err() && of("http:///x").is_err() && of("http://a b").is_err()
        );
    }
}
