//! A studio in a folder of its own, and pages that speak with it.

use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};
use tungstenite::client::IntoClientRequest;
use tungstenite::handshake::client::Response;
use tungstenite::{Message, WebSocket};

static FOLDERS: AtomicU32 = AtomicU32::new(0);

/// A server, killed when it is dropped.
pub struct Studio {
    server: Child,
    pub port: u16,
    pub token: String,
    pub folder: PathBuf,
}

impl Studio {
    /// Starts one in a new folder.
    pub fn new(arguments: &[&str]) -> Studio {
        let n = FOLDERS.fetch_add(1, Ordering::Relaxed);
        let folder =
            std::env::temp_dir().join(format!("pcadlang-studio-{}-{n}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).unwrap();
        Studio::within(folder, arguments)
    }

    /// Starts one in a folder that is there.
    pub fn within(folder: PathBuf, arguments: &[&str]) -> Studio {
        let mut server = Command::new(env!("CARGO_BIN_EXE_pcadlang"))
            .args(["studio", "--port", "0"])
            .args(arguments)
            .current_dir(&folder)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(server.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let (address, rest) = line.trim().split_once("/#token=").unwrap();
        let token = rest.split('&').next().unwrap().to_owned();
        let port = address.rsplit(':').next().unwrap().parse().unwrap();
        Studio { server, port, token, folder }
    }

    /// Opens a page's socket.
    pub fn page(&self) -> Page {
        Page::connect(self.port, &format!("/socket?token={}", self.token), None).unwrap()
    }

    /// Kills the server, as `kill -9` would; its folder stays.
    pub fn kill(mut self) -> PathBuf {
        self.server.kill().unwrap();
        self.server.wait().unwrap();
        std::mem::take(&mut self.folder)
    }

    /// The memory that the server holds, in MiB.
    #[cfg(target_os = "linux")]
    pub fn memory(&self) -> u64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.server.id())).unwrap();
        let line = status.lines().find(|l| l.starts_with("VmRSS:")).unwrap();
        line.split_whitespace().nth(1).unwrap().parse::<u64>().unwrap() / 1024
    }

    /// Sends a request as it is, and returns the whole answer.
    pub fn raw(&self, request: &str) -> String {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        String::from_utf8_lossy(&answer).into_owned()
    }

    /// Gets an address of this server and closes.
    pub fn get(&self, path: &str) -> String {
        let port = self.port;
        self.raw(&format!(
            "GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nConnection: close\r\n\r\n"
        ))
    }
}

impl Drop for Studio {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
        if !self.folder.as_os_str().is_empty() {
            let _ = std::fs::remove_dir_all(&self.folder);
        }
    }
}

/// The socket of a page.
pub struct Page {
    socket: WebSocket<TcpStream>,
    sent: u64,
    /// Events so far.
    pub events: Vec<Value>,
}

impl Page {
    /// Connects; the error is the status of a refusal.
    pub fn connect(port: u16, path: &str, origin: Option<&str>) -> Result<Page, u16> {
        let stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        let mut request = format!("ws://127.0.0.1:{port}{path}").into_client_request().unwrap();
        if let Some(origin) = origin {
            request.headers_mut().insert("origin", origin.parse().unwrap());
        }
        match tungstenite::client(request, stream) {
            Ok((socket, _)) => Ok(Page { socket, sent: 0, events: Vec::new() }),
            Err(tungstenite::HandshakeError::Failure(tungstenite::Error::Http(response))) => {
                let response: Response = *response;
                Err(response.status().as_u16())
            }
            Err(e) => panic!("{e}"),
        }
    }

    /// Sends a frame as it is.
    pub fn send(&mut self, message: Message) {
        self.socket.send(message).unwrap();
    }

    /// Returns the next frame; `None` if the server has closed the socket.
    pub fn next(&mut self) -> Option<Message> {
        self.socket.read().ok().filter(|m| !m.is_close())
    }

    /// Asks, and returns the whole answer: `result` or `error`.
    pub fn answer(&mut self, method: &str, params: Value) -> Value {
        self.sent += 1;
        let id = self.sent;
        self.send(Message::text(
            json!({ "id": id, "method": method, "params": params }).to_string(),
        ));
        loop {
            match self.next().expect("the server closed the socket") {
                Message::Text(text) => {
                    let value: Value = serde_json::from_str(&text).unwrap();
                    if value["id"] == id {
                        return value;
                    }
                    assert!(value["event"].is_string(), "{value}");
                    self.events.push(value);
                }
                Message::Binary(bytes) => {
                    let (header, data) = parts(&bytes);
                    assert_eq!(header["id"], id);
                    let mut header = header;
                    header["bytes"] = json!(data.len());
                    header["begin"] = json!(data[..8.min(data.len())]);
                    return json!({ "result": header });
                }
                other => panic!("{other:?}"),
            }
        }
    }

    /// Asks for something that is done.
    pub fn ask(&mut self, method: &str, params: Value) -> Value {
        let mut answer = self.answer(method, params);
        assert!(answer.get("error").is_none(), "{method}: {answer}");
        answer["result"].take()
    }

    /// Asks for something that is refused, and returns the message.
    pub fn refused(&mut self, method: &str, params: Value) -> String {
        let answer = self.answer(method, params);
        answer["error"]["message"]
            .as_str()
            .unwrap_or_else(|| panic!("{method}: {answer}"))
            .to_owned()
    }

    /// Waits until a run is in one of some states.
    pub fn wait(&mut self, run: &str, states: &[&str]) -> Value {
        let begun = Instant::now();
        loop {
            let runs = self.ask("runs", json!({}));
            let all = runs["runs"].as_array().unwrap();
            let found = all.iter().find(|r| r["run"] == run).expect("the run is listed");
            if states.iter().any(|s| found["state"] == *s) {
                return found.clone();
            }
            assert!(begun.elapsed() < Duration::from_secs(120), "{found}");
            std::thread::sleep(Duration::from_millis(30));
        }
    }
}

/// The header and the data of a binary frame.
pub fn parts(frame: &[u8]) -> (Value, &[u8]) {
    let length = u32::from_le_bytes([frame[0], frame[1], frame[2], frame[3]]) as usize;
    (serde_json::from_slice(&frame[4..4 + length]).unwrap(), &frame[4 + length..])
}
