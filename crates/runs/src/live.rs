//! `--live`: the best state so far for a viewer of the user's own, as files in a folder or
//! sent to an address.

use crate::args::Live;
use crate::drawing_budget::DrawingBudget;
use crate::failure::{Failure, plain};
use crate::inputs::Ready;
use crate::progress::Ending;
use crate::scene;
use crate::watched::Watched;
use pcadlang_inference::BestState;
use pcadlang_report::pictures::png;
use pcadlang_report::write_file;
use pcadlang_scene::geom::glb;
use pcadlang_workbench::session::Layer;
use serde_json::json;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// The time between two looks whether the best state has improved.
const LOOK: Duration = Duration::from_millis(200);
/// The longer side of the picture, in pixels.
const SIDE: u32 = 512;
/// How long a viewer may take to answer.
const PATIENCE: Duration = Duration::from_secs(2);

impl Live {
    /// Checks that states can be sent there, before the run begins.
    ///
    /// # Errors
    /// If the folder cannot be made, or nobody listens at the address.
    pub fn check(&self) -> Result<(), Failure> {
        match self {
            Live::Folder(path) => {
                std::fs::create_dir_all(path).map_err(|e| plain(format!("{}: {e}", path.display())))
            }
            Live::Server(host, _) => TcpStream::connect(host)
                .map(|_| ())
                .map_err(|e| plain(format!("--live: {host}: {e}"))),
        }
    }

    /// Sends the best state whenever it has improved, until the chains end, and once more
    /// then. A viewer that cannot be reached misses states; the run goes on.
    pub fn follow(&self, ready: &Ready, watched: &Watched, ending: &Ending) {
        let (mut sent, mut drawing_budget, mut ended) =
            (f64::NEG_INFINITY, DrawingBudget::default(), false);
        while !ended {
            ended = ending.within(drawing_budget.rest().max(LOOK));
            let Some(best) = watched.best.state().filter(|b| b.log_joint > sent) else { continue };
            let begun = Instant::now();
            // What cannot be drawn now may be drawable later.
            let _ = self.show(ready, watched, &best);
            sent = best.log_joint;
            drawing_budget.took(begun.elapsed());
        }
    }

    fn show(&self, ready: &Ready, watched: &Watched, best: &BestState) -> Result<(), Failure> {
        let draws = scene::predictive(0, 0);
        let mut trace = scene::rebuilt(&ready.model, &best.choices, draws)?;
        if let Some(view) = scene::view(&mut trace, draws, None) {
            let picture = Layer::Overlay.draw(&view, ready.image(), &trace.located(), SIDE)?;
            self.send(
                "overlay.png",
                "image/png",
                &png(&picture).map_err(|e| plain(e.to_string()))?,
            )?;
            if let Ok(objects) = view.solid_in_files().objects() {
                self.send("best.glb", "model/gltf-binary", &glb::write(&objects))?;
            }
        }
        let state = json!({
            "log_joint": best.log_joint, "step": best.step,
            "steps": watched.progress.steps.load(Ordering::Relaxed),
        });
        // The last one: who has read it finds the others there.
        self.send("state.json", "application/json", state.to_string().as_bytes())
    }

    fn send(&self, name: &str, kind: &str, bytes: &[u8]) -> Result<(), Failure> {
        match self {
            Live::Folder(path) => {
                write_file(&path.join(name), bytes).map_err(|e| plain(e.to_string()))
            }
            Live::Server(host, path) => {
                post(host, &format!("{path}/{name}"), kind, bytes).map_err(|e| plain(e.to_string()))
            }
        }
    }
}

/// Sends a file with HTTP/1.1 (RFC 9112), and reads the answer to its end.
fn post(host: &str, path: &str, kind: &str, bytes: &[u8]) -> std::io::Result<()> {
    let mut stream = TcpStream::connect(host)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    write!(
        stream,
        "POST {path} HTTP/1.1\r\nHost: {host}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\nConnection: close\r\n\r\n",
        bytes.len()
    )?;
    stream.write_all(bytes)?;
    // At most a few lines: the answer itself does not matter.
    let mut answer = Vec::new();
    stream.take(1 << 16).read_to_end(&mut answer).map(|_| ())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{BufRead, BufReader};
    use std::net::TcpListener;

    #[test]
    fn files_are_posted() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let host = listener.local_addr().unwrap().to_string();
        let server = std::thread::spawn(move || {
            let (stream, _) = listener.accept().unwrap();
            let mut lines = BufReader::new(stream);
            let mut head = String::new();
            while !head.ends_with("\r\n\r\n") {
                lines.read_line(&mut head).unwrap();
            }
            let mut body = [0; 3];
            lines.read_exact(&mut body).unwrap();
            lines.get_mut().write_all(b"HTTP/1.1 204 No Content\r\n\r\n").unwrap();
            (head, body)
        });
        post(&host, "/live/a.bin", "application/x", &[1, 2, 3]).unwrap();
        let (head, body) = server.join().unwrap();
        assert!(
            head.starts_with("POST /live/a.bin HTTP/1.1\r\n")
                && head.contains("Content-Length: 3\r\n")
        );
        assert_eq!(body, [1, 2, 3]);
    }
}
