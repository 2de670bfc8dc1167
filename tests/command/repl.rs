//! The prompt: the recording in docs/reference/prompt.md word for word, piped scripts,
//! and a pseudo-terminal.
//!
//! `REGENERATE=1 cargo test --release --test command -- repl::` writes the present output
//! of the recorded session to the page: read it first.

use crate::common::folder::{Done, Folder, disc, png};
use assert_cmd::Command;
use std::path::Path;
use std::time::Duration;

/// Pipes a script into a session.
fn piped(f: &Folder, args: &[&str], script: &str) -> Done {
    let mut c = Command::cargo_bin("pcadlang").unwrap();
    c.current_dir(f.path()).env("NO_COLOR", "1").timeout(Duration::from_secs(120));
    let o = c.arg("repl").args(args).write_stdin(script).output().unwrap();
    let text = |b: &[u8]| String::from_utf8_lossy(b).into_owned();
    let d =
        Done { code: o.status.code().unwrap_or(-1), out: text(&o.stdout), err: text(&o.stderr) };
    assert!(!d.err.contains("panicked"), "{}", d.err);
    d
}

const PROMPT: &str = "pcad> ";
const CONTINUED: &str = "    > ";

/// Returns the lines typed in a recording.
fn typed(recording: &str) -> String {
    let line = |l: &str| {
        let text = l
            .strip_prefix(PROMPT)
            .or_else(|| l.strip_prefix(CONTINUED))
            .or(Some("").filter(|_| l == "pcad>"))?;
        Some(format!("{text}\n"))
    };
    recording.lines().filter_map(line).collect()
}

/// Splits the page into text and recordings.
fn parts(page: &str) -> Vec<(bool, String)> {
    let mut parts = Vec::new();
    for (i, part) in page.split("```").enumerate() {
        let recorded = i % 2 == 1 && part.starts_with("text\npcad> ");
        parts.push((recorded, part.to_owned()));
    }
    parts
}

#[test]
fn the_recorded_session_replays() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/reference/prompt.md");
    let text = std::fs::read_to_string(&page).unwrap();
    let parts = parts(&text);
    let recorded: Vec<&str> =
        parts.iter().filter(|(r, _)| *r).map(|(_, p)| p["text\n".len()..].trim_end()).collect();
    assert!(recorded.len() > 3, "the page has {} recordings", recorded.len());
    let f = Folder::new("repl_recorded");
    let d = piped(
        &f,
        &["--transcript", "--graphics", "file", "--seed", "1"],
        &typed(&recorded.join("\n")),
    );
    assert_eq!(d.code, 0, "{}", d.err);
    // Each part gets as many entries as it had.
    let mut said = d.out.lines().peekable();
    let mut now = Vec::new();
    for part in &recorded {
        let mut entries = part.lines().filter(|l| l.starts_with("pcad>")).count();
        let mut lines: Vec<&str> = Vec::new();
        while let Some(line) = said.next_if(|l| entries > 0 || !l.starts_with("pcad>")) {
            entries -= usize::from(line.starts_with("pcad>"));
            lines.push(line);
        }
        now.push(lines.join("\n").trim_end().to_owned());
    }
    if std::env::var_os("REGENERATE").is_some() {
        let mut new = now.iter();
        let part = |(recorded, p): &(bool, String)| match recorded {
            true => format!("text\n{}\n", new.next().unwrap()),
            false => p.clone(),
        };
        let all: Vec<String> = parts.iter().map(part).collect();
        std::fs::write(&page, all.join("```")).unwrap();
        return;
    }
    for (was, is) in recorded.iter().zip(&now) {
        assert!(was == is, "the recording says\n{was}\n\nand the session\n{is}");
    }
    assert!(
        f.exists("vase.png") && f.exists("vase.pcad") && f.exists("vase.trace.json"),
        "{:?}",
        f.files()
    );
}

#[test]
fn scripts_end_at_the_first_error() {
    let f = Folder::new("repl_scripts");
    f.write("coin.pcad", "assume p ~ beta(1, 1); observe binomial(10, p) = 7 as heads;\n");
    let good = piped(
        &f,
        &["coin.pcad", "--seed", "3"],
        "let odds = p / (1 - p)\n:set @p 0.5\nodds\n:save better\n:quit\nnever",
    );
    assert_eq!((good.code, good.err.as_str()), (0, ""), "{}", good.out);
    assert!(good.out.lines().any(|l| l == "1") && !good.out.contains("pcad>"), "{}", good.out);
    let saved = f.read("better.pcad");
    assert_eq!(
        saved,
        "assume p ~ beta(1, 1); observe binomial(10, p) = 7 as heads;\nlet odds = p / (1 - p);\n"
    );
    let loaded = piped(&f, &[], ":load better\np\nodds");
    assert!(loaded.code == 0 && loaded.out.ends_with("0.5\n1\n"), "{}{}", loaded.out, loaded.err);
    assert!(f.run(&["check", "better.pcad"]).code == 0, "what is saved is a program");
    let bad = piped(&f, &["coin.pcad"], "p * 2\nq * 2\n:save never\n");
    assert_eq!(bad.code, 1);
    assert!(
        bad.err.contains("unknown name `q`") && bad.out.lines().count() == 1,
        "{}{}",
        bad.out,
        bad.err
    );
    assert!(!f.exists("never.pcad"));
    let open = piped(&f, &[], "fn f(x) {\n");
    assert!(open.code == 1 && open.err.contains("`{`"), "an entry that is cut off: {}", open.err);
    let wrong = piped(&f, &["coin.pcad", "--set", "n=3"], "");
    assert!(wrong.code == 1 && wrong.err.contains("--set n"), "{}", wrong.err);
    assert_eq!(piped(&f, &["--set", "n=3"], "").code, 2, "nothing to set without a program");
}

/// The program is edited in the user's editor and read back; obstacles to writing a file
/// are reported.
#[cfg(unix)]
#[test]
fn programs_are_edited_and_saved() {
    let f = Folder::new("repl_edited");
    let session = |editor: &str, script: &str| {
        let mut c = Command::cargo_bin("pcadlang").unwrap();
        c.current_dir(f.path()).env("NO_COLOR", "1").env_remove("VISUAL").env("EDITOR", editor);
        let o = c.args(["repl", "--transcript"]).write_stdin(script.to_owned()).output().unwrap();
        String::from_utf8_lossy(&o.stdout).into_owned()
    };
    let script = "assume a ~ normal(0, 1)\n:set a 2\n:edit\n:list\na\n";
    let said = session("sed -i s/normal(0,.1)/normal(0,3)/", script);
    assert!(said.contains("1  assume a ~ normal(0,3);") && said.ends_with("2\n"), "{said}");
    let wrong = session("sed -i s/assume/asume/", &format!("{script}:edit\n"));
    assert!(wrong.contains("error") && wrong.contains("1  assume a ~ normal(0, 1);"), "{wrong}");
    let none = session("no-such-editor", script);
    assert!(none.contains("the editor `no-such-editor` cannot be started"), "{none}");
    f.write("theirs.pcad", "let x = 1;\n");
    let said = session("true", "let y = 2\n:save theirs\n:save! theirs\n:save theirs\n");
    assert!(said.contains("theirs.pcad exists\n  = hint: `:save! theirs` overwrites it"), "{said}");
    assert!(
        said.matches("theirs.pcad, theirs.trace.json").count() == 2
            && f.read("theirs.pcad").contains("y = 2")
    );
}

/// A run is opened by its folder, at the start and from another session; `:undo` reverts
/// that.
#[test]
fn runs_are_loaded() {
    let f = Folder::new("repl_runs");
    f.write("coin.pcad", "assume p ~ beta(1, 1); observe binomial(10, p) = 7 as heads;\n");
    let run = f.run(&["run", "coin.pcad", "--steps", "50", "--chains", "1", "--out", "runs/coin"]);
    assert_eq!(run.code, 0, "{}", run.err);
    let best = piped(&f, &["runs/coin"], "p\n");
    let said = piped(&f, &[], "let q = 1\n:load runs/coin\np\n:undo\nq\n");
    assert_eq!(said.code, 0, "{}", said.err);
    let p = best.out.lines().last().unwrap();
    assert!(
        said.out.contains(&format!("\n{p}\nundone: :load runs/coin\n"))
            && said.out.ends_with("1\n"),
        "{}",
        said.out
    );
}

/// The scene is shown over the observed photograph, which can be given as to `run`.
#[test]
fn a_photograph_is_given_as_to_run() {
    let f = Folder::new("repl_photo");
    f.write("disc.png", png(disc(64, 48, 34.0, 22.0, 15.0)));
    let args = ["lathe.pcad", "--observe", "disc.png", "--set", "size=48"];
    let d = piped(&f, &args, ":render over.png\n:infer mh(one(@**)) 20\n:render\n");
    assert_eq!(d.code, 0, "{}", d.err);
    assert!(
        d.out.contains("over.png: 768 x 576 pixels") && d.out.contains("render.png: "),
        "{}",
        d.out
    );
    let none = piped(&f, &["lathe.pcad"], ":render prior.png\n");
    assert!(
        none.code == 0 && none.out.contains("is not given") && f.exists("prior.png"),
        "{}{}",
        none.out,
        none.err
    );
}

/// A pseudo-terminal: editing, completion, continued lines, history, Ctrl-C inside and
/// outside of an evaluation, colours, pictures.
#[cfg(unix)]
#[test]
fn on_a_terminal() {
    use rexpect::session::{Options, PtySession, spawn_with_options};
    let f = Folder::new("repl_terminal");
    let start = |more: &[&str]| -> PtySession {
        let mut c = std::process::Command::new(env!("CARGO_BIN_EXE_pcadlang"));
        c.current_dir(f.path())
            .env_clear()
            .env("TERM", "xterm-256color")
            .env("COLORTERM", "truecolor");
        c.env("XDG_STATE_HOME", f.path().join("state")).env("COLUMNS", "80").arg("repl").args(more);
        spawn_with_options(c, Options::new().timeout_ms(Some(60_000))).unwrap()
    };
    let mut p = start(&[]);
    // A prompt is redrawn at every key; a new one follows the escape code that enables
    // bracketed paste. Keys sent before that are lost.
    let ready = |p: &mut PtySession| {
        p.exp_string("\u{1b}[?2004h").unwrap();
        p.exp_string("pcad> ").unwrap();
    };
    p.exp_string(":help lists the commands").unwrap();
    ready(&mut p);
    // A directive is coloured, and its value is printed.
    p.send_line("assume height ~ normal(0, 1)").unwrap();
    p.exp_string("\u{1b}[1;35massume\u{1b}[0m").unwrap();
    p.exp_string("height = ").unwrap();
    ready(&mut p);
    // Completion with Tab.
    p.send("hei\t + 0 * hei\t").unwrap();
    p.send_line("").unwrap();
    p.exp_regex(r"\r\n-?[0-9.]+\r\n").unwrap();
    ready(&mut p);
    p.send(":flip @hei\t").unwrap();
    p.send_line("").unwrap();
    p.exp_string("accepted").unwrap();
    ready(&mut p);
    // An entry of several lines.
    p.send_line("fn twice(x) {").unwrap();
    p.send_line("  2 * x").unwrap();
    p.send_line("}").unwrap();
    ready(&mut p);
    p.send_line("twice(21)").unwrap();
    p.exp_string("\r\n42\r\n").unwrap();
    ready(&mut p);
    // Ctrl-C clears the line; an error does not end the session.
    p.send("twice(1 + ").unwrap();
    p.send_control('c').unwrap();
    ready(&mut p);
    p.send_line("twise(1)").unwrap();
    p.exp_string("did you mean `twice`?").unwrap();
    ready(&mut p);
    // History: the last entry but one.
    p.send("\u{1b}[A\u{1b}[A").unwrap();
    p.send_line("").unwrap();
    p.exp_string("\r\n42\r\n").unwrap();
    ready(&mut p);
    // Ctrl-C during inference ends it and keeps its draws; `:undo` restores the previous
    // state.
    p.send_line(":set @height 0.25").unwrap();
    p.exp_string("log joint").unwrap();
    ready(&mut p);
    p.send_line(":infer mh(@height) 100000000000").unwrap();
    p.exp_string("sampling, ").unwrap();
    p.exp_string(" of 100000000000").unwrap();
    p.exp_string("Ctrl-C ends it").unwrap();
    p.send_control('c').unwrap();
    p.exp_string("height").unwrap();
    p.exp_string("stopped early; its draws are kept").unwrap();
    ready(&mut p);
    p.send_line(":undo").unwrap();
    ready(&mut p);
    p.send_line("height").unwrap();
    p.exp_string("\r\n0.25\r\n").unwrap();
    ready(&mut p);
    // Ctrl-C during an evaluation leaves the session unchanged.
    p.send_line("fold(fn(a, i) { a + i }, 0, 0 .. 10000000)").unwrap();
    std::thread::sleep(Duration::from_millis(300));
    p.send_control('c').unwrap();
    p.exp_string("stopped; nothing has changed").unwrap();
    ready(&mut p);
    // The session asks before it overwrites a file that it did not write.
    f.write("mine.pcad", "let theirs = 1;\n");
    p.send_line(":save mine").unwrap();
    p.exp_string("mine.pcad exists; overwrite it? [y/N]").unwrap();
    p.send_line("n").unwrap();
    p.exp_string("nothing was done").unwrap();
    ready(&mut p);
    assert_eq!(f.read("mine.pcad"), "let theirs = 1;\n");
    p.send_line(":save mine").unwrap();
    p.exp_string("[y/N]").unwrap();
    p.send_line("y").unwrap();
    p.exp_string("mine.trace.json").unwrap();
    ready(&mut p);
    assert!(f.read("mine.pcad").contains("assume height"));
    // Inference in the background.
    p.send_line(":infer mh(@height) 100000000000 &").unwrap();
    p.exp_string("run 2 in the background").unwrap();
    ready(&mut p);
    p.send_control('d').unwrap();
    p.exp_string("run 2 would be lost").unwrap();
    ready(&mut p);
    p.send_line("twice(height)").unwrap();
    p.exp_string("\r\n0.5\r\n").unwrap();
    ready(&mut p);
    p.send_line(":stop").unwrap();
    p.exp_string("run 2 is the state now").unwrap();
    ready(&mut p);
    // A picture in half-block characters.
    p.send_line("include \"std/scene.pcad\" as scene").unwrap();
    ready(&mut p);
    p.send_line("let ball = scene.sphere(1)").unwrap();
    p.exp_string("a solid").unwrap();
    ready(&mut p);
    p.send_line(":render").unwrap();
    p.exp_regex("\u{1b}\\[38;2;[0-9]+;[0-9]+;[0-9]+;48;2;").unwrap();
    ready(&mut p);
    p.send_control('d').unwrap();
    p.exp_eof().unwrap();

    // The history is kept for the next session.
    assert!(f.read("state/pcadlang/history").contains("twice(21)"));
    let mut p = start(&["coin.pcad"]);
    ready(&mut p);
    p.send("\u{1b}[A").unwrap();
    p.send_line("").unwrap();
    p.exp_string("no view").unwrap();
    ready(&mut p);
    p.send_line(":quit").unwrap();
    p.exp_eof().unwrap();
}
