//! The web server: the page, its sockets with requests, answers and events, photographs that
//! are sent, files of the opened folder.

use super::advice::on_page;
use super::app::App;
use super::guard::{Guard, Refusal};
use super::language;
use super::protocol::{self, Call};
use axum::Router;
use axum::body::{Body, Bytes};
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::extract::{DefaultBodyLimit, Path, Query, Request, State};
use axum::http::StatusCode;
use axum::http::header::{
    CACHE_CONTROL, CONTENT_DISPOSITION, CONTENT_SECURITY_POLICY, CONTENT_TYPE, HeaderName,
    HeaderValue, REFERRER_POLICY, X_CONTENT_TYPE_OPTIONS, X_FRAME_OPTIONS,
};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use futures_util::{SinkExt, StreamExt};
use pcadlang_runs::failure::{Failure, STOPPED};
use pcadlang_syntax::diag::{Diagnostic, Severity, SourceMap};
use pcadlang_workbench::lsp::positions::Encoding;
use serde_json::{Map, Value, json};
use std::borrow::Cow;
use std::collections::HashMap;
use std::future::Future;
use std::sync::Arc;
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::{Semaphore, mpsc};

/// The largest photograph, in bytes.
pub const PHOTOGRAPH: usize = 64 << 20;
/// The largest file of the folder that is sent, in bytes.
const FILE: u64 = 256 << 20;
/// The largest text frame, in bytes.
pub const FRAME: usize = 16 << 20;
/// Maximum open sockets.
const SOCKETS: usize = 64;
/// Maximum concurrent uploads of photographs.
const UPLOADS: usize = 4;

/// The content security policy: the page may load its own files and pictures that it made.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; \
     img-src 'self' blob: data:; connect-src 'self'; base-uri 'none'; form-action 'none'; \
     frame-ancestors 'none'";

/// The state that all handlers share.
#[derive(Clone)]
pub struct Server {
    /// Does what is asked.
    pub app: Arc<App>,
    guard: Arc<Guard>,
    /// Where the files of the page are, if not in this program.
    page: Option<Arc<std::path::Path>>,
    sockets: Arc<Semaphore>,
    uploads: Arc<Semaphore>,
}

/// The part of an address after the question mark.
type Asked = Query<HashMap<String, String>>;

/// Makes the routes of the server.
pub fn router(app: Arc<App>, guard: Arc<Guard>, page: Option<Arc<std::path::Path>>) -> Router {
    let server = Server {
        app,
        guard,
        page,
        sockets: Arc::new(Semaphore::new(SOCKETS)),
        uploads: Arc::new(Semaphore::new(UPLOADS)),
    };
    let user = Router::new()
        .route("/socket", get(open_socket))
        .route("/language", get(open_language))
        .route("/pictures", post(take_picture).layer(DefaultBodyLimit::max(PHOTOGRAPH)))
        .route("/files/{*path}", get(send_file))
        .route_layer(from_fn_with_state(server.clone(), with_token));
    let page = Router::new()
        .route("/", get(|State(s): State<Server>| async move { asset(&s, "index.html").await }))
        .route(
            "/{name}",
            get(|State(s): State<Server>, Path(name): Path<String>| async move {
                asset(&s, &name).await
            }),
        );
    user.merge(page)
        .fallback(|| async { refused((StatusCode::NOT_FOUND, "there is nothing at this address")) })
        .layer(from_fn_with_state(server.clone(), guarded))
        .with_state(server)
}

fn refused((status, text): Refusal) -> Response {
    (status, format!("{text}\n")).into_response()
}

/// Refuses requests of other pages, and adds the headers that every answer has.
async fn guarded(State(server): State<Server>, request: Request, next: Next) -> Response {
    let mut response = match server.guard.check_origin(request.headers()) {
        Ok(()) => next.run(request).await,
        Err(refusal) => refused(refusal),
    };
    let mut add = |name: HeaderName, value: &'static str| {
        response.headers_mut().entry(name).or_insert(HeaderValue::from_static(value));
    };
    add(CONTENT_SECURITY_POLICY, POLICY);
    add(X_CONTENT_TYPE_OPTIONS, "nosniff");
    add(X_FRAME_OPTIONS, "DENY");
    add(REFERRER_POLICY, "no-referrer");
    add(CACHE_CONTROL, "no-store");
    response
}

async fn asset(server: &Server, name: &str) -> Response {
    match find(name, server.page.as_deref()) {
        Some((kind, bytes)) => {
            ([(CONTENT_TYPE, kind)], Body::from(Bytes::from_owner(bytes))).into_response()
        }
        None => refused((StatusCode::NOT_FOUND, "there is nothing at this address")),
    }
}

/// Refuses requests without the token, before anything of them is read.
async fn with_token(
    State(server): State<Server>,
    asked: Asked,
    request: Request,
    next: Next,
) -> Response {
    match server.guard.check_token(asked.get("token").map(String::as_str)) {
        Ok(()) => next.run(request).await,
        Err(refusal) => refused(refusal),
    }
}

const BUSY: Refusal =
    (StatusCode::SERVICE_UNAVAILABLE, "too many pages are open: close some of them");

/// Opens a socket, if there is a place, and holds that until it has been served.
fn opened<F>(
    server: Server,
    upgrade: WebSocketUpgrade,
    serve: impl FnOnce(WebSocket, Arc<App>) -> F + Send + 'static,
) -> Response
where
    F: Future<Output = ()> + Send,
{
    let Ok(place) = server.sockets.try_acquire_owned() else { return refused(BUSY) };
    let upgrade = upgrade.max_message_size(FRAME).max_frame_size(FRAME);
    upgrade.on_upgrade(move |socket| async move {
        serve(socket, server.app).await;
        drop(place);
    })
}

async fn open_socket(State(server): State<Server>, upgrade: WebSocketUpgrade) -> Response {
    opened(server, upgrade, serve)
}

async fn open_language(State(server): State<Server>, upgrade: WebSocketUpgrade) -> Response {
    opened(server, upgrade, language::serve)
}

fn problem(status: StatusCode, problem: &Failure) -> Response {
    (status, format!("{problem}\n")).into_response()
}

async fn take_picture(State(server): State<Server>, asked: Asked, request: Request) -> Response {
    let name = asked.get("name").cloned().unwrap_or_default();
    let Ok(_place) = Arc::clone(&server.uploads).acquire_owned().await else {
        return refused(BUSY);
    };
    let told = request.headers().get(axum::http::header::CONTENT_LENGTH);
    let length = told.and_then(|l| l.to_str().ok()?.parse::<usize>().ok());
    let large = (StatusCode::PAYLOAD_TOO_LARGE, "a photograph may have at most 64 MiB");
    if length.is_some_and(|n| n > PHOTOGRAPH) {
        return refused(large);
    }
    let bytes: Bytes = match axum::body::to_bytes(request.into_body(), PHOTOGRAPH).await {
        Ok(bytes) => bytes,
        Err(_) => return refused(large),
    };
    let app = Arc::clone(&server.app);
    let stored = tokio::task::spawn_blocking(move || {
        let file = app.folder.store_picture(&name, &bytes)?;
        app.tell(serde_json::json!({ "event": "folder" }));
        Ok::<_, Failure>(file)
    });
    match stored.await {
        Ok(Ok(file)) => axum::Json(serde_json::json!({ "file": file })).into_response(),
        Ok(Err(e)) => problem(StatusCode::BAD_REQUEST, &e),
        Err(_) => refused((StatusCode::INTERNAL_SERVER_ERROR, "an internal error")),
    }
}

async fn send_file(State(server): State<Server>, Path(path): Path<String>) -> Response {
    let file = match server.app.folder.file(&path) {
        Ok(file) => file,
        Err(e) => return problem(StatusCode::FORBIDDEN, &e),
    };
    let read = tokio::task::spawn_blocking(move || {
        let known = std::fs::metadata(&file).is_ok_and(|m| m.is_file() && m.len() <= FILE);
        known.then(|| std::fs::read(&file).ok()).flatten()
    });
    let Ok(Some(bytes)) = read.await else {
        return refused((StatusCode::NOT_FOUND, "there is no such file"));
    };
    let end = path.rsplit('.').next().unwrap_or_default().to_lowercase();
    let kind = match end.as_str() {
        "png" => "image/png",
        "jpg" | "jpeg" => "image/jpeg",
        "json" => "application/json",
        _ => "application/octet-stream",
    };
    let mut response = ([(CONTENT_TYPE, kind)], Body::from(bytes)).into_response();
    // A file is never run as a page of this origin.
    if !kind.starts_with("image/") {
        let value = HeaderValue::from_static("attachment");
        response.headers_mut().insert(CONTENT_DISPOSITION, value);
    }
    response
}

/// Name, type and contents of each file.
const ASSETS: [(&str, &str, &[u8]); 4] = [
    ("index.html", "text/html; charset=utf-8", include_bytes!("../../../web/dist/index.html")),
    ("studio.js", "text/javascript; charset=utf-8", include_bytes!("../../../web/dist/studio.js")),
    ("studio.css", "text/css; charset=utf-8", include_bytes!("../../../web/dist/studio.css")),
    ("licences.txt", "text/plain; charset=utf-8", include_bytes!("../../../web/dist/licences.txt")),
];

/// Returns the type and the contents of a file of the page. They are read from `folder`
/// if one is given, for those who work on the page.
pub fn find(
    name: &str,
    folder: Option<&std::path::Path>,
) -> Option<(&'static str, Cow<'static, [u8]>)> {
    let (name, kind, bytes) = ASSETS.iter().find(|(n, ..)| *n == name)?;
    let read = folder.and_then(|f| std::fs::read(f.join(name)).ok());
    Some((kind, read.map_or(Cow::Borrowed(*bytes), Cow::Owned)))
}

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
            Message::Text(text) => protocol::Request::read(text),
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

/// An answer to a request.
pub enum Answer {
    /// JSON.
    Json(Value),
    /// Data with a header.
    Bytes(Map<String, Value>, Arc<Vec<u8>>),
}

/// A frame for the page.
#[derive(Clone, Debug)]
pub enum Frame {
    /// JSON.
    Text(String),
    /// A binary frame.
    Binary(Bytes),
}

/// Returns the frame of an answer to the request with this number.
pub fn frame(id: u64, done: Result<Answer, Failure>) -> Frame {
    match done {
        Ok(Answer::Json(value)) => Frame::Text(protocol::result(id, &value)),
        Ok(Answer::Bytes(header, data)) => {
            Frame::Binary(protocol::binary(id, header, &data).into())
        }
        Err(failure) => Frame::Text(refusal(id, &failure)),
    }
}

fn refusal(id: u64, failure: &Failure) -> String {
    let error = |message: &str, hint: Option<&str>, diagnostics| {
        protocol::error(Some(id), message, hint, diagnostics)
    };
    match failure {
        Failure::Plain(message, hint) => error(message, hint.as_deref().map(on_page), json!([])),
        Failure::Interrupted => error(STOPPED, None, json!([])),
        Failure::Program(e) => {
            let first = e.diagnostics.first();
            let message = first.map_or("", |d| &d.message);
            let hint = first.and_then(|d| d.hints.first()).map(|h| on_page(h));
            let all: Vec<Value> = e.diagnostics.iter().map(|d| place(d, &e.sources)).collect();
            error(message, hint, json!(all))
        }
    }
}

impl From<Value> for Answer {
    fn from(value: Value) -> Answer {
        Answer::Json(value)
    }
}

/// Returns a diagnostic with its place as the page counts: lines and columns from 0,
/// columns in UTF-16 units.
fn place(d: &Diagnostic, sources: &SourceMap) -> Value {
    let label = d.labels.iter().find(|l| l.primary).or(d.labels.first());
    let mut said = d.message.clone();
    if let Some(text) = label.map(|l| &l.text).filter(|t| !t.is_empty()) {
        said = format!("{said}: {text}");
    }
    let severity = match d.severity {
        Severity::Error => "error",
        Severity::Warning => "warning",
        Severity::Note => "note",
    };
    let mut out = json!({ "severity": severity, "message": said, "hint": d.hints.first().map(|h| on_page(h)) });
    if let Some((label, file)) = label.and_then(|l| Some((l, sources.get(l.span.file)?))) {
        let range = Encoding::Utf16.range(file, label.span);
        out["file"] = json!(file.name());
        out["line"] = json!(range.start.line);
        out["column"] = json!(range.start.character);
        out["end_line"] = json!(range.end.line);
        out["end_column"] = json!(range.end.character);
    }
    out
}
