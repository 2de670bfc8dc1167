//! Tells the pages how the runs go on: each run that changed, at most five times a second,
//! and less often if there are many.

use super::app::App;
use pcadlang_runs::failure::{Failure, plain};
use serde_json::{Value, json};
use std::collections::HashMap;
use std::sync::{Arc, Weak};
use std::time::{Duration, Instant};

/// The time between two events of a run.
const TICK: Duration = Duration::from_millis(200);
/// With more runs than this, the time grows, so that the number of events does not.
const RUNS: usize = 5;
/// The time between two looks at the folder.
const LOOK: Duration = Duration::from_secs(3);

/// Starts to tell the pages, until the app is gone.
pub fn start(app: &Arc<App>) -> Result<(), Failure> {
    let app = Arc::downgrade(app);
    let thread = std::thread::Builder::new().name("ticker".to_owned());
    let started = thread.spawn(move || run(&app));
    started.map(|_| ()).map_err(|e| plain(format!("no thread can be started: {e}")))
}

fn run(app: &Weak<App>) {
    let (mut told, mut folder, mut looked) = (HashMap::new(), Value::Null, Instant::now());
    loop {
        let Some(app) = app.upgrade() else { return };
        let mut active = 0;
        if app.events.receiver_count() > 0 {
            active = tell_runs(&app, &mut told);
            if looked.elapsed() > LOOK {
                looked = Instant::now();
                app.runs.look();
                let now = app.folder.described();
                if folder != Value::Null && now != folder {
                    app.tell(json!({ "event": "folder" }));
                }
                folder = now;
            }
        }
        drop(app);
        std::thread::sleep(TICK * (active.div_ceil(RUNS).max(1) as u32));
    }
}

/// Returns the number of runs that are under way.
fn tell_runs(app: &App, told: &mut HashMap<String, Value>) -> usize {
    let mut active = 0;
    for run in app.runs.all() {
        let is_active = run.is_active();
        active += usize::from(is_active);
        // Runs that have ended stay as they are.
        if !is_active && told.get(&run.name).is_some_and(|t| t["state"] == json!(run.status())) {
            continue;
        }
        let now = run.described();
        if told.get(&run.name) != Some(&now) {
            app.tell(json!({ "event": "run", "run": now }));
            told.insert(run.name.clone(), now);
        }
    }
    active
}
