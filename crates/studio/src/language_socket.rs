//! The socket of the page's editor: messages of the Language Server Protocol.

use super::app::App;
use super::language::Language;
use axum::extract::ws::{Message, WebSocket};
use futures_util::{SinkExt, StreamExt};
use std::sync::Arc;
use tokio::sync::mpsc;

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
                    if out.send(Message::Text(text.into())).await.is_err() {
                        break;
                    }
                }
                None => break,
            },
            message = from.next() => match message {
                Some(Ok(Message::Text(text))) => {
                    let server = Arc::clone(&server);
                    let sent = tokio::task::spawn_blocking(move || server.send(&text));
                    if !sent.await.unwrap_or(false) {
                        break;
                    }
                }
                Some(Ok(Message::Ping(_) | Message::Pong(_) | Message::Binary(_))) => {}
                _ => break,
            },
        }
    }
}
