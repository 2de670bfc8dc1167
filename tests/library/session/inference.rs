//! Inference in a session: plans, runs in the background, what is stopped.

use super::{LINE, line, refuses, says, state};
use pcadlang::Program;
use pcadlang_engine::trace::Stop;
use pcadlang_workbench::session::{Failure, Session};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

#[test]
fn inference_in_the_background_leaves_the_state_until_it_is_asked_for() {
    let mut s = line();
    let before = state(&s);
    assert_eq!(
        says(&mut s, ":infer mh(one(@**)) 400 &"),
        "run 1 in the background: mh(one(@**))\n"
    );
    assert_eq!(state(&s), before);
    assert!(says(&mut s, ":trace").contains("@slope"));
    assert!(refuses(&mut s, ":infer 10").contains("run 1"));
    let done = says(&mut s, ":wait");
    assert!(done.contains("400 steps, 400 draws") && done.contains("done"), "{done}");
    assert_eq!(says(&mut s, ":status"), done);
    assert_eq!(s.background(), Some((1, true)));
    assert_eq!(state(&s), before, "waiting is not taking over");
    let stopped = says(&mut s, ":stop");
    assert!(
        stopped.starts_with("run 1 is the state now") && stopped.contains("accepted"),
        "{stopped}"
    );
    assert_ne!(state(&s), before);
    assert!(says(&mut s, ":plot slope").starts_with("slope: 400 draws, mean "));
    assert!(refuses(&mut s, ":plot slop").contains("did you mean `slope`?"));
    assert!(says(&mut s, ":profile").contains("mh(one(@**))"));
    says(&mut s, ":undo");
    assert_eq!(state(&s), before);

    // An endless run is stopped; its draws can be inspected while it runs.
    says(&mut s, ":infer drift(one($continuous)) 1000000000 &");
    while !says(&mut s, ":status").contains("draws") {
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(says(&mut s, ":plot log_joint").contains("draws"));
    assert!(says(&mut s, ":stop").starts_with("run 2 is the state now"));
    let last = state(&s);
    says(&mut s, ":infer drift(one($continuous)) 1000000000 &");
    assert_eq!(says(&mut s, ":drop"), "run 3 was discarded\n");
    assert_eq!(state(&s), last);
}

#[test]
fn what_belongs_to_another_program_is_not_taken_over() {
    let mut s = line();
    says(&mut s, ":infer mh(one(@**)) 50 &");
    says(&mut s, "let more = slope + 1");
    says(&mut s, ":wait");
    let before = state(&s);
    let why = refuses(&mut s, ":stop");
    assert!(why.contains("the program has changed since run 1 started"), "{why}");
    assert_eq!(state(&s), before);
    // After a return to the same program, the run can be used.
    says(&mut s, ":undo");
    says(&mut s, ":infer mh(one(@**)) 50 &");
    says(&mut s, "let more = slope + 1");
    says(&mut s, ":undo");
    assert!(says(&mut s, ":stop").starts_with("run 2"));
}

/// The same lines with the same seed give the same session; no stream of random numbers
/// is used twice.
#[test]
fn sessions_replay() {
    let lines = [
        ":flip @slope",
        ":infer mh(one(@**)) 100",
        ":infer mh(one(@**)) 100",
        ":trace",
        "next",
        ":draw",
        ":trace",
    ];
    let run = || {
        let mut s = line();
        lines.map(|l| says(&mut s, l))
    };
    let first = run();
    assert_eq!(first, run());
    assert_ne!(first[1], first[2]);
}

#[test]
fn plans_of_all_kinds_run() {
    let mut s = line();
    assert!(says(&mut s, ":infer 30").contains("the default plan"), "as it has none of its own");
    says(&mut s, "infer quick { repeat 25 { mh(one(@**)); collect slope; } }");
    assert!(s.text().contains("infer quick"));
    assert!(says(&mut s, ":infer quick").starts_with("quick: 25 steps"));
    assert!(says(&mut s, ":infer quick 7").starts_with("quick: 7 steps"));
    let text = s.text().to_owned();
    assert!(
        says(&mut s, "infer { warmup 10 { drift(@slope); } repeat 12 { drift(@slope); } }")
            .contains("12 steps after 10 of warm-up")
    );
    assert_eq!(s.text(), text, "a block without a name is no part of the program");
    assert!(
        says(&mut s, ":infer { repeat 5 { gibbs(@wide); } }").starts_with("infer { … }: 5 steps")
    );
    says(&mut s, "kernel both() { mh(one(@**)); drift(one($continuous)); }");
    assert!(says(&mut s, ":infer both() 3").starts_with("both(): 6 steps"));
    assert!(says(&mut s, ":infer nuts($continuous, max_depth = 3) 4").contains("4 steps"));
}

#[test]
fn what_is_stopped_changes_nothing_but_inference_keeps_its_draws() {
    let stop = Arc::new(AtomicBool::new(false));
    let open =
        Session::open(Program::named("<session>", LINE).unwrap(), 1, Stop::when(Arc::clone(&stop)));
    let mut s = open.unwrap_or_else(|e| panic!("{e}")).0;
    let before = state(&s);
    let interrupted = |s: &mut Session, text: &str| {
        stop.store(false, Ordering::SeqCst);
        let later = Arc::clone(&stop);
        let ends = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(150));
            later.store(true, Ordering::SeqCst);
        });
        let done = s.enter(text);
        ends.join().unwrap();
        stop.store(false, Ordering::SeqCst);
        assert!(matches!(done, Err(Failure::Interrupted)), "{text}: {done:?}");
    };
    interrupted(&mut s, "let endless = fold(fn(a, i) { a + i }, 0, 0 .. 10000000)");
    assert_eq!(state(&s), before);
    // Background runs are not affected.
    says(&mut s, ":infer mh(one(@**)) 1000000000 &");
    interrupted(&mut s, ":wait");
    assert!(says(&mut s, ":status").contains("sampling"));
    assert!(says(&mut s, ":stop").contains("run 1"));
    // Inference in the foreground is stopped where it is.
    says(&mut s, ":undo");
    assert_eq!(state(&s), before);
    let later = Arc::clone(&stop);
    let ends = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(150));
        later.store(true, Ordering::SeqCst);
    });
    let said = says(&mut s, ":infer drift(one($continuous)) 1000000000");
    ends.join().unwrap();
    stop.store(false, Ordering::SeqCst);
    assert!(said.ends_with("stopped early; its draws are kept, and `:undo` goes back\n"), "{said}");
    assert!(said.lines().any(|l| l.starts_with("slope ")), "a table of means: {said}");
    assert_ne!(state(&s), before);
    assert!(says(&mut s, ":plot slope").contains(" draws, mean "));
    assert!(says(&mut s, "slope + 1").trim().parse::<f64>().is_ok(), "and the session goes on");
    says(&mut s, ":undo");
    assert_eq!(state(&s), before);
}

#[test]
fn inference_says_how_far_it_is_and_what_it_found() {
    let mut s = line();
    let said = says(&mut s, ":infer drift(one($continuous)) 200");
    let head = said.lines().nth(1).unwrap();
    assert_eq!(
        head.split_whitespace().collect::<Vec<_>>(),
        ["quantity", "mean", "sd", "5%", "95%", "ess"]
    );
    assert!(said.lines().any(|l| l.starts_with("slope ")) && said.contains("log joint "), "{said}");
    // An endless warm-up: there are no draws, and both replies give the reason.
    says(&mut s, ":infer { warmup 1000000000 { drift(@slope); } repeat 5 { drift(@slope); } } &");
    let status = |s: &mut Session| loop {
        let said = says(s, ":status");
        if said.contains("warm-up") {
            return said;
        }
    };
    let said = status(&mut s);
    assert!(said.contains("warm-up, ") && said.contains(" of 1000000000"), "{said}");
    let said = refuses(&mut s, ":plot slope");
    assert!(said.contains("run 2 has no draws yet: warm-up, "), "{said}");
    says(&mut s, ":drop");
    // The progress of sampling is reported in steps.
    says(&mut s, ":infer drift(one($continuous)) 1000000000 &");
    while !says(&mut s, ":status").contains("draws") {
        std::thread::sleep(Duration::from_millis(5));
    }
    let said = says(&mut s, ":plot slope");
    assert!(
        said.starts_with("run 3: sampling, ") && said.contains(" of 1000000000\nslope: "),
        "{said}"
    );
    says(&mut s, ":drop");
}
