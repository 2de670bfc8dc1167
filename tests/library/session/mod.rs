//! Sessions as a front end uses them: entries, replies, and that an error does not change
//! the state.

mod front_end;
mod inference;

use pcadlang::Program;
use pcadlang_engine::trace::Stop;
use pcadlang_workbench::session::{Reply, Session};

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
        Err(e) => e.with_hint(),
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
            s.enter(text).map_or_else(|e| e.with_hint(), |r| format!("(accepted) {}", r.text));
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
        let shown = pcadlang_report::number;
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
