//! `pcadlang studio`: a web application on this machine, for a program, a photograph and
//! the runs over it. Its sessions are those of the prompt, its runs those of `run`; the
//! protocol is described in docs/reference/studio.md.
#![forbid(unsafe_code)]
#![warn(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

#[macro_use]
extern crate pcadlang_runs;

mod advice;
mod app;
mod args;
mod examples;
mod folder;
mod guard;
mod guess;
mod hint;
mod language;
mod listener;
mod protocol;
mod results;
mod run;
mod runs;
mod server;
mod sessions;
mod states;
mod ticker;

use app::App;
pub use args::Studio;
use folder::Folder;
use guard::Guard;
use listener::Bounded;
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_runs::job::{Interrupt, machine_threads};
use pcadlang_runs::reopening::reopened::Reopened;
use runs::Runs;
use sessions::{Sessions, job_of};
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::sync::broadcast;

/// Minimum of the default number of concurrent runs.
const WORKING: usize = 4;
/// Maximum events queued for a slow page.
const EVENTS: usize = 256;
/// How long runs may take to write their files when the studio ends.
const FAREWELL: Duration = Duration::from_secs(60);

/// Serves the studio until Ctrl-C.
pub fn studio(a: &Studio) -> Result<(), Failure> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .map_err(|e| plain(format!("the server cannot start: {e}")))?;
    runtime.block_on(serve(a))
}

async fn serve(a: &Studio) -> Result<(), Failure> {
    let host = a.listen.unwrap_or(IpAddr::V4(Ipv4Addr::LOCALHOST));
    let address = SocketAddr::new(host, a.port);
    let listener = TcpListener::bind(address).await.map_err(|e| {
        Failure::Plain(format!("{address}: {e}"), Some("another port: --port N".into()))
    })?;
    let bound = listener.local_addr().map_err(|e| plain(e.to_string()))?;
    let is_open = !host.is_loopback();
    let guard = Guard::new(bound.port(), is_open).map_err(plain)?;

    let path = std::env::current_dir().map_err(|e| plain(format!("the folder: {e}")))?;
    let interrupt = Interrupt::listen();
    let working = a.jobs.map_or(machine_threads().max(WORKING), |n| n as usize);
    let app = Arc::new(App {
        runs: Runs::new(&path, working, Arc::clone(&interrupt)),
        folder: Folder::new(path),
        sessions: Sessions::default(),
        events: broadcast::channel(EVENTS).0,
    });
    let session = a.program.as_ref().map(|p| open(&app, p, a)).transpose()?;

    let shown =
        if is_open { bound } else { SocketAddr::new(Ipv4Addr::LOCALHOST.into(), bound.port()) };
    let at = session.map_or(String::new(), |id| format!("&session={id}"));
    if is_open {
        error_line!(
            "warning: other machines can reach this server; whoever has its address can run programs and \
             write files in this folder, and what is sent is not encrypted"
        );
    }
    print_line!("http://{shown}/#token={}{at}", guard.token());
    print_line!(
        "Open this address in a browser; Ctrl-C ends the studio, and its runs can be resumed."
    );
    ticker::start(&app)?;
    let routes =
        server::router(Arc::clone(&app), Arc::new(guard), a.page.as_deref().map(Arc::from));
    let ended = Arc::clone(&interrupt);
    let over = async move {
        while !ended.asked() {
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
    };
    tokio::select! {
        served = async { axum::serve(Bounded::new(listener), routes).await } => {
            served.map_err(|e| plain(format!("the server stopped: {e}")))?;
        }
        () = over => {}
    }
    // The interrupt has reached the runs; they write their last checkpoints.
    let begun = std::time::Instant::now();
    while app.runs.all().iter().any(|r| r.is_active()) && begun.elapsed() < FAREWELL {
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    Ok(())
}

/// Opens the program or the run of the command line. Returns the number of its session.
fn open(app: &App, program: &str, a: &Studio) -> Result<u64, Failure> {
    let sets = a.sets.iter().cloned().collect();
    let mut job = job_of(program, &sets, &a.observe);
    job.inputs.allowed = a.allowed.clone();
    let run = match Path::new(program).join("run.json").is_file() {
        true => Some(Reopened::open(Path::new(program))?),
        false => None,
    };
    let job = run.as_ref().map_or(job, |r| r.job.clone());
    Ok(app.sessions.open(job, run)?.id)
}
