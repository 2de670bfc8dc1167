//! The language server of `pcadlang lsp`, for the editor of the page: the same messages over
//! a WebSocket. Documents are those of the opened folder, as `file:///studio/NAME`.

use super::app::App;
use axum::extract::ws::{self, WebSocket};
use futures_util::{SinkExt, StreamExt};
use lsp_server::{Connection, Message};
use pcadlang_engine::lang::reach::path_within;
use pcadlang_workbench::lsp;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tokio::sync::mpsc;

/// How the page calls the opened folder.
const FOLDER: &str = "file:///studio/";

/// The two ends of a language server that runs on a thread of its own.
pub struct Language {
    connection: Connection,
    folder: PathBuf,
}

impl Language {
    /// Starts a language server. Each of its messages is passed to `answer`, until the
    /// page leaves.
    pub fn start(
        folder: &Path,
        answer: impl Fn(String) + Send + 'static,
    ) -> std::io::Result<Language> {
        let (server, client) = Connection::memory();
        let name = || std::thread::Builder::new().name("language".to_owned());
        name().spawn(move || {
            // The page sees an error as a lost connection, and begins anew.
            let _ = lsp::serve(&server);
        })?;
        let (received, own) = (client.receiver.clone(), file_address(folder));
        name().spawn(move || {
            for message in received {
                let mut value = serde_json::to_value(&message).unwrap_or_default();
                value["jsonrpc"] = "2.0".into();
                answer(value.to_string().replace(&own, FOLDER));
            }
        })?;
        Ok(Language { connection: client, folder: folder.to_owned() })
    }

    /// Passes on a message of the page. One that is not a message, or is about a document
    /// outside the folder, is ignored. Returns whether the server is still there.
    pub fn send(&self, text: &str) -> bool {
        let Some(message) = self.message(text) else { return true };
        self.connection.sender.send(message).is_ok()
    }

    fn message(&self, text: &str) -> Option<Message> {
        let mut value: Value = serde_json::from_str(text).ok()?;
        if let Some(uri) = value.pointer_mut("/params/textDocument/uri") {
            let name = uri.as_str()?.strip_prefix(FOLDER)?;
            let path = path_within(&self.folder, name).ok()?;
            *uri = format!("file://{}", path.display()).into();
        }
        serde_json::from_value(value).ok()
    }
}

fn file_address(folder: &Path) -> String {
    format!("file://{}/", folder.display())
}

/// Maximum messages queued for a slow page.
const WAITING: usize = 256;

/// Serves an editor until it leaves.
pub async fn serve(socket: WebSocket, app: Arc<App>) {
    let (mut out, mut from) = socket.split();
    let (send, mut answers) = mpsc::channel::<String>(WAITING);
    let started = Language::start(app.folder.path(), move |text| {
        let _ = send.blocking_send(text);
    });
    let Ok(server) = started else { return };
    let server = Arc::new(server);
    loop {
        tokio::select! {
            answer = answers.recv() => match answer {
                Some(text) => {
                    if out.send(ws::Message::Text(text.into())).await.is_err() {
                        break;
                    }
                }
                None => break,
            },
            message = from.next() => match message {
                Some(Ok(ws::Message::Text(text))) => {
                    let server = Arc::clone(&server);
                    let sent = tokio::task::spawn_blocking(move || server.send(&text));
                    if !sent.await.unwrap_or(false) {
                        break;
                    }
                }
                Some(Ok(ws::Message::Ping(_) | ws::Message::Pong(_) | ws::Message::Binary(_))) => {}
                _ => break,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::channel;
    use std::time::Duration;

    #[test]
    fn the_page_speaks_with_the_language_server() {
        let folder = std::env::temp_dir();
        let (tell, told) = channel();
        let server =
            Language::start(&folder, move |text| tell.send(text).unwrap_or_default()).unwrap();
        let next = || -> Value {
            serde_json::from_str(&told.recv_timeout(Duration::from_secs(20)).unwrap()).unwrap()
        };
        assert!(server.send("no message") && server.send("{}"));
        server
            .send(r#"{"jsonrpc":"2.0","id":1,"method":"initialize","params":{"capabilities":{}}}"#);
        assert_eq!(next()["result"]["serverInfo"]["name"], "pcadlang");
        server.send(r#"{"jsonrpc":"2.0","method":"initialized","params":{}}"#);
        let open = |uri: &str, text: &str| {
            let document =
                serde_json::json!({ "uri": uri, "languageId": "pcad", "version": 1, "text": text });
            serde_json::json!({ "jsonrpc": "2.0", "method": "textDocument/didOpen", "params": { "textDocument": document } }).to_string()
        };
        server.send(&open("file:///etc/x.pcad", "assume"));
        server.send(&open("file:///studio/../x.pcad", "assume"));
        server.send(&open("file:///studio/a.pcad", "assume x ~ norml(0, 1);"));
        let said = next();
        assert_eq!(said["params"]["uri"], "file:///studio/a.pcad");
        assert!(said["params"]["diagnostics"][0]["message"].as_str().unwrap().contains("norml"));
    }
}
