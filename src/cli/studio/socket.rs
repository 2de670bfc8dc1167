//! The socket of a page: its requests, done side by side, their answers, and events.

use super::answer::{Frame, frame};
use super::desk::Desk;
use super::protocol::{self, Request};
use axum::extract::ws::{Message, WebSocket};
use futures_util::{SinkExt, StreamExt};
use serde_json::json;
use std::sync::Arc;
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::{Semaphore, mpsc};

/// The most requests of a page that are being done; further ones wait.
const AT_ONCE: usize = 8;
/// The most frames that wait to be sent to a slow page.
const WAITING: usize = 64;

/// Serves a page until it leaves.
pub async fn serve(socket: WebSocket, desk: Arc<Desk>) {
    let (mut out, mut from) = socket.split();
    let (send, mut frames) = mpsc::channel::<Frame>(WAITING);
    let mut events = desk.events.subscribe();
    let sender = tokio::spawn(async move {
        loop {
            let message = tokio::select! {
                frame = frames.recv() => match frame {
                    Some(Frame::Text(text)) => Message::Text(text.into()),
                    Some(Frame::Binary(bytes)) => Message::Binary(bytes),
                    None => break,
                },
                event = events.recv() => match event {
                    Ok(text) => Message::Text(text.into()),
                    // A page that is too slow misses some events; the next ones are newer.
                    Err(RecvError::Lagged(_)) => continue,
                    Err(RecvError::Closed) => break,
                },
            };
            if out.send(message).await.is_err() {
                break;
            }
        }
    });
    let places = Arc::new(Semaphore::new(AT_ONCE));
    while let Some(Ok(message)) = from.next().await {
        let request = match &message {
            Message::Text(text) => Request::read(text),
            Message::Binary(_) => Err(protocol::Misunderstood {
                id: None,
                message: "requests are text frames".to_owned(),
                hint: None,
            }),
            Message::Close(_) => break,
            Message::Ping(_) | Message::Pong(_) => continue,
        };
        let request = match request {
            Ok(request) => request,
            Err(m) => {
                let said = protocol::error(m.id, &m.message, m.hint.as_deref(), json!([]));
                if send.send(Frame::Text(said)).await.is_err() {
                    break;
                }
                continue;
            }
        };
        let Ok(place) = Arc::clone(&places).acquire_owned().await else { break };
        let (desk, send) = (Arc::clone(&desk), send.clone());
        // What a session or a run does is not asynchronous, and may take long.
        tokio::task::spawn_blocking(move || {
            let done = frame(request.id, desk.answer(request.call));
            drop(place);
            let _ = send.blocking_send(done);
        });
    }
    drop(send);
    sender.abort();
}
