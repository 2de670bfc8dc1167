//! Sessions as a front end uses them: entries, replies, and that an error does not change
//! the state.

use pcadlang::Program;
use pcadlang::session::{Reply, Session, Trouble};
use pcadlang::trace::Stop;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

const LINE: &str = "let x = [0, 1, 2, 3];
assume slope ~ normal(0, 5) #line;
assume intercept ~ normal(0, 5) #line;
assume wide ~ flip(0.2);
assume noise = if wide { n ~ uniform(1, 3); n } else { 1 };
observe normal(slope * x + intercept, noise) = [0.9, 3.2, 4.8, 7.1] as y;
predict next ~ normal(slope * 4 + intercept, noise);
";

fn session(text: &str) -> Session {
    Session::open(Program::named("<session>", text).unwrap(), 1, Stop::default())
        .unwrap_or_else(|e| panic!("{e}"))
        .0
}

fn line() -> Session {
    session(LINE)
}

fn says(s: &mut Session, text: &str) -> String {
    match s.enter(text) {
        Ok(Reply { text, .. }) => text,
        Err(e) => panic!("{text}: {e}"),
    }
}

fn refuses(s: &mut Session, text: &str) -> String {
    match s.enter(text) {
        Ok(reply) => panic!("{text}: {}", reply.text),
        Err(e) => e.to_string(),
    }
}

/// Returns the program, the choices and the log joint density, to the last bit.
fn state(s: &Session) -> (String, Vec<String>, u64) {
    let choices = s
        .trace()
        .choices()
        .into_iter()
        .map(|(a, v, p)| format!("{a} {v:?} {:x}", p.to_bits()))
        .collect();
    (s.text().to_owned(), choices, s.trace().log_joint().to_bits())
}

#[test]
fn what_people_type_is_understood() {
    let mut s = line();
    assert_eq!(says(&mut s, ":why slope"), says(&mut s, ":why @slope"));
    says(&mut s, ":set slope 1.5");
    assert_eq!(says(&mut s, "slope").trim(), "1.5");
    assert!(says(&mut s, ":flip intercept").contains("@intercept: "));
    // Each listed address can be queried.
    says(&mut s, "for k in [\"a\", \"b\"] { t[k] ~ normal(0, 1); observe normal(t[k], 1) = 2; }");
    for (address, ..) in s.trace().choices() {
        assert!(says(&mut s, &format!(":why {address}")).starts_with(&format!("{address} = ")));
        says(
            &mut s,
            &format!(
                ":set {address} {}",
                if address.to_string() == "@wide" { "true" } else { "0.5" }
            ),
        );
    }
    let help = says(&mut s, ":help");
    for word in ["help", "?", ":?", ":h"] {
        assert_eq!(says(&mut s, word), help, "{word}");
    }
    for word in ["exit", "quit", "q", ":q", ":exit"] {
        assert!(s.enter(word).is_ok_and(|r| r.ends), "{word}");
    }
    assert!(s.enter("clear").is_ok_and(|r| r.clears));
    // A name of the program takes precedence over a command.
    says(&mut s, "let q = 7");
    assert_eq!(says(&mut s, "q").trim(), "7");
}

#[test]
fn an_error_leaves_everything_as_it_was() {
    let mut s = line();
    let before = state(&s);
    let mut wrong = String::new();
    for (text, why) in [
        ("assume z ~ nomal(0, 1)", "normal"),
        ("assume slope ~ nomal(0, 1)", "normal"),
        ("let x = slope * 2", "not bound here"),
        ("forget slop", "did you mean `slope`?"),
        ("forget noise", "`y` uses `noise`"),
        (":redo", "nothing to redo"),
        (":help qqqq", "no statement, built-in or command"),
        ("let a = [1, 2][7]", "7"),
        ("assume z ~ normal(0, -1)", "sd"),
        ("let = 3", "expected"),
        ("observe normal(slope, 1) = ", "expected"),
        ("data d = csv(\"nowhere.csv\")", "no such file"),
        ("let deep = f(1); fn f(n) { f(n + 1) }", "nested"),
        ("1 + ", "expected"),
        ("slope + nothing_such", "nothing_such"),
        (":flip @slop", "@slope"),
        (":flip normal(0, 1)", "selection"),
        (":set @slope \"steep\"", "does not fit"),
        (":set @slope 1e400", "large"),
        (":set @slope inf", "finite"),
        (":set @wide 3", "does not fit"),
        (":set size 3", "@size"),
        (":why $line", "2 choices"),
        (":infer mh(one(@nothing))", "nothing"),
        (":infer { repeat 10 { jump(@slope); } }", "jump"),
        (":infer { let k = 1 / [1, 2][5]; }", "5"),
        (":stop", "nothing runs"),
        (":plot slope", "nothing has run"),
        (":undo", "nothing to undo"),
        (":load nowhere", "nowhere.pcad"),
        (":save no/such/folder/x", "no/such/folder/x"),
        (":trce", ":trace"),
        (":draw @slope", "takes no arguments"),
        ("sample [1][3]", "3"),
        ("export slope to \"no/such/folder/x.txt\"", "x.txt"),
        ("let fine = 2; sample [1][3];", "3"),
    ] {
        let said =
            s.enter(text).map_or_else(|e| e.to_string(), |r| format!("(accepted) {}", r.text));
        if !said.contains(why) || said.starts_with("(accepted)") || state(&s) != before {
            wrong += &format!("{text}: {why:?} is not in\n{said}\n");
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
    assert!(says(&mut s, "slope").trim().parse::<f64>().is_ok(), "and the session goes on");
}

#[test]
fn looking_changes_nothing() {
    let mut s = line();
    let before = state(&s);
    for text in [
        ":trace",
        "@slope",
        "$line",
        ":why @wide",
        ":list",
        ":help",
        ":doc normal",
        ":doc :flip",
        ":status",
        "slope * 2",
        "next",
    ] {
        assert!(!says(&mut s, text).is_empty(), "{text}");
    }
    assert!(says(&mut s, "fn(x) { x + slope }").contains("function"));
    assert_eq!(state(&s), before);
    assert_eq!(says(&mut s, "noise"), says(&mut s, "noise"), "a name has one value");
    assert_ne!(says(&mut s, "next"), says(&mut s, "next"), "a prediction is drawn each time");
}

/// Assumed choices are drawn at once, even without an observation, and are kept while the
/// program grows.
#[test]
fn a_program_grows_and_its_choices_stay() {
    let mut s = Session::new(7, Stop::default()).unwrap();
    let a = says(&mut s, "assume a ~ normal(0, 1)");
    assert!(a.starts_with("a = ") && a.contains("log joint"), "{a}");
    let value = says(&mut s, "a");
    assert_eq!(says(&mut s, "a"), value);
    says(&mut s, "fn twice(x) {\n  2 * x\n}");
    says(&mut s, "let t = twice(a)");
    says(&mut s, "for i in 0 .. 3 { v[i] ~ normal(a, 1); }");
    assert_eq!(says(&mut s, "v"), says(&mut s, "v"));
    assert_eq!(says(&mut s, "a"), value);
    let observed = says(&mut s, "observe normal(a, 0.5) = 2 as y;");
    assert!(observed.starts_with("log joint "), "{observed}");
    assert_eq!(says(&mut s, "a"), value);
    assert_eq!(s.trace().choice_count(), 4);
    assert!(says(&mut s, ":trace").contains("@y"));
    let expected = "assume a ~ normal(0, 1);\nfn twice(x) {\n  2 * x\n}\nlet t = twice(a);\n";
    assert!(s.text().starts_with(expected), "{}", s.text());
    says(&mut s, "forget y");
    assert!(!says(&mut s, ":trace").contains("@y"));
    says(&mut s, "force @a = 3");
    assert_eq!(says(&mut s, "a"), "3\n");
}

#[test]
fn undo_restores_program_and_trace_to_the_last_bit() {
    let mut s = line();
    let mut states = vec![state(&s)];
    let steps = [
        "let double = 2 * slope",
        ":set @slope 2.25",
        ":set @y [1, 3, 5, 7]",
        ":draw",
        "observe normal(double, 1) = 4 as again",
        ":infer drift(one($continuous)) 50",
        "infer { repeat 20 { mh(one(@**)); } }",
        ":set @slope 1.125",
        "forget again",
    ];
    for text in steps {
        says(&mut s, text);
        assert_ne!(&state(&s), states.last().unwrap(), "{text}");
        states.push(state(&s));
    }
    states.pop();
    while let Some(before) = states.pop() {
        says(&mut s, ":undo");
        assert_eq!(state(&s), before);
    }
    assert!(refuses(&mut s, ":undo").contains("nothing to undo"));
}

/// The reply to a flip agrees with the trace, whether the flip is accepted or not.
#[test]
fn flips_say_what_they_do() {
    let mut s = line();
    let (mut kept, mut left) = (0, 0);
    for i in 0..60 {
        let before = state(&s);
        let said = says(&mut s, ["(none)", ":flip @slope", ":flip @wide", ":flip @**"][1 + i % 3]);
        let last = said.lines().last().unwrap();
        let change = said.lines().find(|l| l.starts_with("log joint")).unwrap();
        let [old, new] = [0, 1].map(|k| {
            change["log joint ".len()..].split([' ', '(']).filter(|w| *w != "->").nth(k).unwrap()
        });
        let shown = pcadlang::report::number;
        assert_eq!(old, shown(f64::from_bits(before.2)), "{said}");
        let ratio: f64 =
            last.split("log ratio ").nth(1).unwrap().split(')').next().unwrap().parse().unwrap();
        if last.starts_with("accepted") {
            assert_eq!(new, shown(s.trace().log_joint()), "{said}");
            kept += 1;
        } else {
            assert!(last.starts_with("rejected") && ratio < 0.0, "{said}");
            assert_eq!(state(&s), before);
            left += 1;
        }
        assert_eq!(
            s.trace().log_joint().to_bits(),
            s.trace().rerun().unwrap().log_joint().to_bits()
        );
    }
    assert!(kept > 3 && left > 3, "{kept} {left}");
}

#[test]
fn why_names_what_depends_on_a_choice() {
    let mut s = line();
    says(&mut s, ":set @wide true");
    let wide = says(&mut s, ":why @wide");
    assert!(
        wide.contains("@noise/n") && wide.contains("may appear or vanish") && wide.contains("@y"),
        "{wide}"
    );
    let n = says(&mut s, ":why @noise/n");
    assert!(n.contains("depends on @wide") && n.contains("used by noise"), "{n}");
}

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
        assert!(matches!(done, Err(Trouble::Stopped)), "{text}: {done:?}");
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

/// A name that is bound again replaces the old one, for everything that uses it.
#[test]
fn names_are_bound_again_and_forgotten() {
    let mut s = line();
    says(&mut s, ":set slope 2");
    let before = state(&s);
    let said = says(&mut s, "let x = [0, 2, 4, 6]");
    assert!(said.contains("`x` is replaced; used by `y`"), "{said}");
    assert!(s.text().starts_with("let x = [0, 2, 4, 6];\nassume slope"), "{}", s.text());
    assert_eq!(says(&mut s, "slope"), "2\n", "choices stay");
    says(&mut s, ":undo");
    assert_eq!(state(&s), before);
    // Values that depend on it are shown with their new values.
    says(&mut s, "let double = 2 * slope");
    says(&mut s, "fn f(a) { a + double }");
    says(&mut s, "let three = f(1)");
    let said = says(&mut s, "let double = 3 * slope");
    assert!(said.contains("double = 6\nthree = 7\n"), "{said}");
    // A definition that needs later ones is moved after them.
    says(&mut s, "let last = 1");
    says(&mut s, "let free = 1; let later = 2");
    says(&mut s, "let free = later + 1");
    assert_eq!(says(&mut s, "free"), "3\n");
    // An old value that is no longer possible is resampled, the others are kept.
    says(&mut s, ":set intercept 0.25");
    says(&mut s, "assume slope ~ uniform(5, 6)");
    assert!((5.0..6.0).contains(&says(&mut s, "slope").trim().parse::<f64>().unwrap()));
    assert_eq!(says(&mut s, "intercept"), "0.25\n");
    // Observations and kernels are replaced by name.
    says(&mut s, "observe normal(slope, 1) = [1, 2] as y");
    let observed = says(&mut s, ":trace");
    assert!(
        observed.matches("@y").count() == 1 && s.text().matches(" as y").count() == 1,
        "{observed}"
    );
    says(&mut s, "kernel both() { drift(@slope); }");
    says(&mut s, "kernel both() { drift(@intercept); }");
    assert_eq!(s.text().matches("kernel both").count(), 1);
    // Elements of a container do not replace the container.
    says(&mut s, "z[0] ~ normal(0, 1)");
    says(&mut s, "z[1] ~ normal(0, 1)");
    assert!(s.text().contains("z[0] ~") && s.text().contains("z[1] ~"));

    for name in ["y", "three", "@next", "last", "f"] {
        says(&mut s, &format!("forget {name};"));
    }
    assert!(!s.text().contains("three") && !s.text().contains("observe"), "{}", s.text());
    let why = refuses(&mut s, "forget slope");
    assert!(
        why.contains("`double` uses `slope`") && why.contains("forget `double` first"),
        "{why}"
    );
    says(&mut s, "forget double");
    says(&mut s, ":undo");
    assert!(s.text().contains("let double"));
}

#[test]
fn what_was_undone_is_done_again() {
    let mut s = line();
    let mut states = vec![state(&s)];
    for text in ["let double = 2 * slope", ":set @slope 2.25", ":infer drift(one($continuous)) 50"]
    {
        says(&mut s, text);
        states.push(state(&s));
    }
    for before in states.iter().rev().skip(1) {
        says(&mut s, ":undo");
        assert_eq!(&state(&s), before);
    }
    for after in &states[1..] {
        assert!(says(&mut s, ":redo").starts_with("redone: "));
        assert_eq!(&state(&s), after);
    }
    says(&mut s, ":undo");
    says(&mut s, ":set @slope 1");
    assert!(refuses(&mut s, ":redo").contains("nothing to redo"), "a change ends it");
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

#[test]
fn help_knows_statements_kernels_and_subjects() {
    let mut s = line();
    for (text, what) in [
        (":doc observe", "observe d = v as name;"),
        (":help observe", "Condition on"),
        (":doc infer", "The inference plan"),
        (":doc infer", ":infer [PLAN] [N] [&]"),
        (":help flip", "flip(p"),
        (":help flip", ":flip SEL"),
        (":doc :flip", ":flip SEL"),
        (":doc mh", "mh("),
        (":doc warmup", "step sizes adapt"),
        (":help logistic", "expit(x)"),
    ] {
        let said = says(&mut s, text);
        assert!(said.contains(what), "{text}: {said}");
    }
    assert!(refuses(&mut s, ":doc obsrve").contains("did you mean `observe`?"));
}

#[test]
fn a_front_end_is_asked_for_what_a_session_cannot_do() {
    use pcadlang::session::Request;
    let folder = std::env::temp_dir().join(format!("pcadlang-asks-{}", std::process::id()));
    std::fs::create_dir_all(folder.join("run")).unwrap();
    let at = |name: &str| folder.join(name).display().to_string();
    std::fs::write(at("other.pcad"), "assume theirs ~ normal(0, 1);").unwrap();
    let mut s = line();
    let asked =
        |s: &mut Session, text: &str| s.enter(text).unwrap_or_else(|e| panic!("{e}")).request;
    let Some(Request::Confirm { question, then }) =
        asked(&mut s, &format!(":save {}", at("other")))
    else {
        panic!("a file of somebody else is overwritten")
    };
    assert!(question.contains("other.pcad exists"), "{question}");
    assert_eq!(std::fs::read_to_string(at("other.pcad")).unwrap(), "assume theirs ~ normal(0, 1);");
    assert_eq!(asked(&mut s, &then), None);
    assert!(std::fs::read_to_string(at("other.pcad")).unwrap().contains("slope"));
    // The session overwrites its own files without asking.
    assert_eq!(asked(&mut s, &format!(":save {}", at("other"))), None);
    std::fs::write(folder.join("run/run.json"), "{}").unwrap();
    assert_eq!(
        asked(&mut s, &format!(":load {}", at("run"))),
        Some(Request::Open(folder.join("run")))
    );
    std::fs::remove_dir_all(&folder).unwrap();

    // An edited text replaces the program; choices are kept.
    assert_eq!(asked(&mut s, ":edit"), Some(Request::Edit));
    says(&mut s, ":set slope 1.5");
    let before = state(&s);
    let text = s.text().replace("normal(0, 5) #line", "normal(0, 9) #line");
    assert!(s.replace(&text).unwrap_or_else(|e| panic!("{e}")).text.contains("log joint"));
    assert!(s.text().contains("normal(0, 9)") && says(&mut s, "slope") == "1.5\n");
    assert!(s.replace("assume = ;").is_err() && s.text() == text);
    says(&mut s, ":undo");
    assert_eq!(state(&s), before);
    // The state of another session is adopted.
    let mut other = session("assume b ~ normal(0, 1);");
    says(&mut other, ":set b 0.5");
    s.take_over(other, ":load b");
    assert_eq!(says(&mut s, "b"), "0.5\n");
    says(&mut s, ":undo");
    assert_eq!(state(&s), before);
}

/// Values that would print at any length take one line on the screen, and a value that
/// cannot be built is an error.
#[test]
fn huge_values_are_no_trouble() {
    let mut s = Session::new(1, Stop::default()).unwrap();
    says(&mut s, "let big = 0 .. 3000000");
    assert!(says(&mut s, "big").contains("3000000 in all"));
    says(&mut s, "let a = [\"x\", 1]");
    for (name, inner) in
        [("b", "a"), ("c", "b"), ("d", "c"), ("e", "d"), ("f", "e"), ("g", "f"), ("h", "g")]
    {
        says(
            &mut s,
            &format!(
                "let {name} = [{inner}, {inner}, {inner}, {inner}, {inner}, {inner}, {inner}, {inner}]"
            ),
        );
    }
    assert!(says(&mut s, "h").chars().count() < 2100);
    let before = state(&s);
    refuses(&mut s, "fn f(n) { a ~ normal(0, 1); a + f(n + 1) } let deep = f(0)");
    assert_eq!(state(&s), before);
    assert!(
        refuses(&mut s, "let many = map(fn(i) { i + 1 }, 0 .. 5000000)").contains("grew beyond")
    );
    assert!(refuses(&mut s, "let most = 0 .. 1000000000000").contains("too long"));
    assert_eq!(state(&s), before);
    assert!(says(&mut s, "1e300 * 1").contains("1e300"));
}

/// A state of probability zero is reported, and does not end the session.
#[test]
fn impossible_states_are_told() {
    let mut s = session("assume p ~ uniform(0, 1);");
    says(&mut s, ":set @p 0.5");
    let said = says(&mut s, "observe uniform(0, 0.1) = p as inside");
    assert!(said.contains("probability zero, by @inside"), "{said}");
    assert!(said.contains("log joint -inf"), "{said}");
    let said = says(&mut s, ":set @p 0.05");
    assert!(said.contains("log joint -inf ->"), "{said}");
    // If the program's density is undefined for the old choices, they are resampled.
    says(&mut s, ":set @p 0.01");
    let said = says(&mut s, "assume q ~ normal(0, log(p * 60))");
    assert!(said.contains("all were redrawn from the prior"), "{said}");
}

#[test]
fn params_are_set_in_the_text() {
    let mut s = session("param n: int = 3 \"how many\";\nassume xs ~ iid(normal(0, 1), n);\n");
    assert_eq!(s.trace().choice_count(), 3);
    says(&mut s, ":set n 5");
    assert_eq!(s.trace().choice_count(), 5);
    assert!(s.text().starts_with("param n: int = 5 \"how many\";"), "{}", s.text());
    let before = state(&s);
    assert!(refuses(&mut s, ":set n \"many\"").contains("whole number"));
    assert_eq!(state(&s), before);
}

#[test]
fn a_program_without_its_data_is_its_prior() {
    let program =
        Program::named("p", "data ys: csv; assume a ~ normal(0, 1); observe normal(a, 1) = ys.y;")
            .unwrap();
    let (mut s, said) = Session::open(program, 1, Stop::default()).unwrap();
    assert!(said.text.contains("`ys` is not given"), "{}", said.text);
    assert!(says(&mut s, ":trace").contains("@a"));
}

#[test]
fn words_are_completed_where_they_stand() {
    let mut s = session(
        "fn spin(angle, speed = 2) { angle * speed } assume xs ~ iid(normal(0, 1), 3) #fast; observe normal(xs[0], 1) = 1 as seen;",
    );
    let words = |s: &Session, line: &str| {
        let found = s.complete(line, line.len());
        (line[found.start..].to_owned(), found.words)
    };
    let has = |s: &Session, line: &str, word: &str| words(s, line).1.iter().any(|w| w == word);
    assert_eq!(words(&s, ":fl"), (":fl".into(), vec![":flip".into()]));
    // Only valid arguments of the command are completed.
    for line in [":list ", ":status ", ":undo ", ":quit x"] {
        assert!(words(&s, line).1.is_empty(), "{line}");
    }
    assert_eq!(words(&s, ":why xs").1, ["xs[0]", "xs[1]", "xs[2]"]);
    assert!(
        !has(&s, ":flip ", "let")
            && !has(&s, ":flip ", "exp")
            && has(&s, ":flip ", "one")
            && has(&s, ":flip ", "$fast")
    );
    assert!(
        has(&s, ":set xs[0] ex", "exp") && !has(&s, ":set ", "exp") && !has(&s, ":why ", "exp")
    );
    assert!(
        has(&s, ":help obs", "observe") && has(&s, ":doc :fl", ":flip") && has(&s, ":doc m", "mh")
    );
    assert_eq!(words(&s, ":flip @xs[").1, ["@xs[0]", "@xs[1]", "@xs[2]"]);
    assert_eq!(words(&s, "force @se").1, ["@seen"]);
    assert_eq!(words(&s, ":trace $fa").1, ["$fast"]);
    assert!(
        has(&s, "let y = sp", "spin")
            && has(&s, "obs", "observe")
            && has(&s, "let v = scene.ren", "scene.render")
    );
    assert!(
        has(&s, "spin(1, sp", "speed = ")
            && has(&s, "spin(1, sp", "spin")
            && !has(&s, "spin(1); sp", "speed = ")
    );
    assert!(
        has(&s, "assume z ~ normal(0, ", "sd = ")
            && has(&s, ":infer nuts($continuous, max", "max_depth = ")
    );
    assert!(has(&s, ":doc norm", "normal") && !has(&s, "f(\"norm", "normal"));
    assert!(has(&s, ":infer mh", "mh"));
    let folder = std::env::temp_dir().join(format!("pcadlang-complete-{}", std::process::id()));
    std::fs::create_dir_all(folder.join("inner")).unwrap();
    for name in ["one.pcad", "two.png", "three.csv"] {
        std::fs::write(folder.join(name), "").unwrap();
    }
    let at = folder.display().to_string();
    assert_eq!(
        words(&s, &format!(":load {at}/")).1,
        [format!("{at}/inner/"), format!("{at}/one.pcad")]
    );
    assert_eq!(
        words(&s, &format!("data d = csv(\"{at}/t")).1,
        [format!("{at}/three.csv"), format!("{at}/two.png")]
    );
    assert_eq!(words(&s, &format!("include \"{at}/o")).1, [format!("{at}/one.pcad")]);
    std::fs::remove_dir_all(&folder).unwrap();
    says(&mut s, ":infer mh(one(@**)) 5");
    assert!(has(&s, ":plot xs", "xs[1]"));
    for line in ["", ":", "@", "\"", "é", "f(", "1.", ":load ", "let é = \"ü"] {
        for at in 0..=line.len() {
            s.complete(line, at);
        }
    }
}

#[test]
fn sessions_are_saved_and_loaded() {
    let folder = std::env::temp_dir().join(format!("pcadlang-session-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let at = |name: &str| folder.join(name).display().to_string();
    let mut s = line();
    says(&mut s, "let double = 2 * slope // twice");
    says(&mut s, ":infer mh(one(@**)) 100");
    let saved = state(&s);
    let said = says(&mut s, &format!(":save {}", at("cup")));
    assert!(said.contains("cup.pcad") && said.contains("cup.trace.json"), "{said}");
    let mut other = Session::new(5, Stop::default()).unwrap();
    let said = says(&mut other, &format!(":load {}", at("cup.pcad")));
    assert!(said.contains("with the trace of"), "{said}");
    assert_eq!(state(&other), saved);
    says(&mut other, ":undo");
    assert_eq!(other.text(), "");
    // A trace of another program, and a file that is not a trace.
    std::fs::write(at("cup.pcad"), "assume other ~ normal(0, 1);").unwrap();
    let before = state(&s);
    let why = refuses(&mut s, &format!(":load {}", at("cup")));
    assert!(why.contains("belongs to another program"), "{why}");
    std::fs::write(at("cup.trace.json"), "{").unwrap();
    assert!(refuses(&mut s, &format!(":load {}", at("cup"))).contains("not a saved trace"));
    assert_eq!(state(&s), before);
    std::fs::remove_file(at("cup.trace.json")).unwrap();
    says(&mut s, &format!(":load {}", at("cup")));
    assert_eq!(s.trace().choice_count(), 1);
    std::fs::remove_dir_all(&folder).unwrap();
}

/// Data files are read and prepared once.
#[test]
fn files_are_read_once() {
    let folder = std::env::temp_dir().join(format!("pcadlang-files-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("d.csv");
    std::fs::write(&path, "y\n1\n2\n").unwrap();
    let program = Program::named(folder.join("session.pcad").to_str().unwrap(), "").unwrap();
    let mut s = Session::open(program, 1, Stop::default()).unwrap_or_else(|e| panic!("{e}")).0;
    says(&mut s, "data d = csv(\"d.csv\")");
    std::fs::remove_dir_all(&folder).unwrap();
    says(&mut s, "observe normal(0, 1) = d.y");
    assert_eq!(says(&mut s, "d.y"), "[1, 2]\n");
}

#[test]
fn scenes_are_seen() {
    let text = "include \"std/scene.pcad\" as scene;\nlet ball = scene.sphere(radius = 1);\nlet view = scene.render(ball);\nassume a ~ normal(0, 1);\n";
    let mut s = session(text);
    let reply = s.enter(":render").unwrap_or_else(|e| panic!("{e}"));
    let picture = reply.picture.expect("a picture");
    let pixels = picture.pixels();
    let (w, h) = pixels.dimensions();
    assert!(w >= 256 && h >= 256 && picture.file.is_none());
    assert_ne!(pixels.get_pixel(w / 2, h / 2), pixels.get_pixel(2, 2), "the ball is in the middle");
    let named = s.enter(":render ball out.png").unwrap_or_else(|e| panic!("{e}")).picture.unwrap();
    assert_eq!(named.file.as_deref(), Some(std::path::Path::new("out.png")));
    assert!(refuses(&mut s, ":render a").contains("a number"));
    assert!(refuses(&mut s, ":render bal").contains("did you mean `ball`?"));
    assert!(refuses(&mut Session::new(1, Stop::default()).unwrap(), ":render").contains("no view"));
}

/// Names on which only the session depends are kept up to date like observations.
#[test]
fn shipped_programs_are_at_home() {
    for name in [
        "coin.pcad",
        "linreg.pcad",
        "mixture.pcad",
        "crp.pcad",
        "geometric.pcad",
        "scene.pcad",
        "lathe.pcad",
        "human_kth.pcad",
    ] {
        let program = Program::open(name).unwrap_or_else(|e| panic!("{e}"));
        let mut s =
            Session::open(program, 1, Stop::default()).unwrap_or_else(|e| panic!("{name}: {e}")).0;
        let addresses: Vec<String> =
            s.trace().choices().iter().map(|(a, ..)| a.to_string()).collect();
        assert!(!addresses.is_empty(), "{name} has no choices");
        for (i, a) in addresses.iter().cycle().step_by(7).take(12).enumerate() {
            if s.trace().find(&a.parse().unwrap()).is_some() {
                says(&mut s, &format!(":why {a}"));
                says(&mut s, &format!(":flip {}", if i % 5 == 4 { "@**" } else { a }));
            }
            let (now, anew) = (s.trace().log_joint(), s.trace().rerun().unwrap().log_joint());
            assert_eq!(now.to_bits(), anew.to_bits(), "{name} {a}: {now} {anew}");
        }
        says(&mut s, ":infer mh(one(@**)) 30");
        assert_eq!(
            s.trace().log_joint().to_bits(),
            s.trace().rerun().unwrap().log_joint().to_bits(),
            "{name}"
        );
    }
}
