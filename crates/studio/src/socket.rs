//! The socket of a page: its requests, done side by side, their answers, and events.

use super::app::App;
use super::protocol::{self, Call, Frame, Request, frame};
use axum::extract::ws::{Message, WebSocket};
use futures_util::{SinkExt, StreamExt};
use serde_json::json;
use std::sync::Arc;
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::{Semaphore, mpsc};

/// Maximum concurrent requests per page; the rest are queued.
const AT_ONCE: usize = 8;
/// Maximum concurrent and queued requests per page; the rest are refused.
const PENDING: usize = 256;
/// Maximum frames queued for a slow page.
const WAITING: usize = 64;

/// Serves a page until it leaves.
pub async fn serve(socket: WebSocket, app: Arc<App>) {
    let (mut out, mut from) = socket.split();
    let (send, mut frames) = mpsc::channel::<Frame>(WAITING);
    let mut events = app.events.subscribe();
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
    let (places, pending) = (Arc::new(Semaphore::new(AT_ONCE)), Arc::new(Semaphore::new(PENDING)));
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
        let Ok(held) = Arc::clone(&pending).try_acquire_owned() else {
            let said = "too many requests are waiting for their answers";
            let said = protocol::error(Some(request.id), said, None, json!([]));
            if send.send(Frame::Text(said)).await.is_err() {
                break;
            }
            continue;
        };
        let (app, send, places) = (Arc::clone(&app), send.clone(), Arc::clone(&places));
        // What ends the work of others does not wait for it.
        let ends = matches!(request.call, Call::Interrupt(_) | Call::Pause(_) | Call::Stop(_));
        tokio::spawn(async move {
            let place = match ends {
                true => None,
                false => places.acquire_owned().await.ok(),
            };
            // What a session or a run does is not asynchronous, and may take long.
            let done = tokio::task::spawn_blocking(move || {
                let done = frame(request.id, app.answer(request.call));
                drop(place);
                done
            });
            if let Ok(done) = done.await {
                let _ = send.send(done).await;
            }
            drop(held);
        });
    }
    drop(send);
    sender.abort();
}
