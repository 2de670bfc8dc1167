//! What a front end gets from a session: help, completion, requests, files, pictures.

use super::{line, refuses, says, session, state};
use crate::common::folder::Folder;
use pcadlang::Program;
use pcadlang_engine::trace::Stop;
use pcadlang_workbench::session::Session;

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
    use pcadlang_workbench::session::Request;
    let folder = Folder::new("session_asks");
    std::fs::create_dir_all(folder.path().join("run")).unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
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
    std::fs::write(folder.path().join("run/run.json"), "{}").unwrap();
    assert_eq!(
        asked(&mut s, &format!(":load {}", at("run"))),
        Some(Request::Open(folder.path().join("run")))
    );

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
    let folder = Folder::new("session_complete");
    std::fs::create_dir_all(folder.path().join("inner")).unwrap();
    for name in ["one.pcad", "two.png", "three.csv"] {
        std::fs::write(folder.path().join(name), "").unwrap();
    }
    let at = folder.path().display().to_string();
    assert_eq!(
        words(&s, &format!(":load {at}/")).1,
        [format!("{at}/inner/"), format!("{at}/one.pcad")]
    );
    assert_eq!(
        words(&s, &format!("data d = csv(\"{at}/t")).1,
        [format!("{at}/three.csv"), format!("{at}/two.png")]
    );
    assert_eq!(words(&s, &format!("include \"{at}/o")).1, [format!("{at}/one.pcad")]);
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
    let folder = Folder::new("session_saved");
    let at = |name: &str| folder.path().join(name).display().to_string();
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
}

/// Data files are read and prepared once.
#[test]
fn files_are_read_once() {
    let folder = Folder::new("session_files");
    let path = folder.path().join("d.csv");
    std::fs::write(&path, "y\n1\n2\n").unwrap();
    let program = Program::named(folder.path().join("session.pcad").to_str().unwrap(), "").unwrap();
    let mut s = Session::open(program, 1, Stop::default()).unwrap_or_else(|e| panic!("{e}")).0;
    says(&mut s, "data d = csv(\"d.csv\")");
    std::fs::remove_dir_all(folder.path()).unwrap();
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
