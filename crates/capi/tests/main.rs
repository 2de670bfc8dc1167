//! A program in C does what it says, and the boundary takes what it should not be given.

use std::path::{Path, PathBuf};
use std::process::Command;

fn here() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// A function of C: its name and the number of its parameters.
fn functions(text: &str, before: &str) -> Vec<(String, usize)> {
    let mut all: Vec<(String, usize)> = text
        .split(before)
        .skip(1)
        .filter_map(|rest| {
            let (name, rest) = rest.split_once('(')?;
            let inside = rest.split_once(')')?.0.trim().trim_end_matches(',');
            let none = inside.is_empty() || inside == "void";
            let count = if none { 0 } else { inside.matches(',').count() + 1 };
            Some((name.trim().to_owned(), count))
        })
        .filter(|(name, _)| name.chars().all(|c| c.is_alphanumeric() || c == '_'))
        .map(|(name, count)| (name.trim_start_matches("pcad_").to_owned(), count))
        .collect();
    all.sort();
    all.dedup();
    all
}

/// The rest of the header is compared by `.ci/header`.
#[test]
fn the_header_declares_the_functions_of_the_code() {
    let read = |name: &str| std::fs::read_to_string(here().join(name)).unwrap();
    let code: String = ["src/failure.rs", "src/posterior.rs", "src/program.rs"].map(read).concat();
    let ours = functions(&code, "extern \"C\" fn ");
    // Comments name functions, too, without their parameters.
    let header: String = read("include/pcadlang.h")
        .split("/*")
        .map(|part| part.split_once("*/").map_or(part, |(_, after)| after))
        .collect();
    assert_eq!(functions(&header, "pcad_"), ours);
    assert!(ours.len() > 15);
}

/// Skipped without a C compiler; nothing else of the project needs one.
#[test]
fn a_program_in_c_reads_a_posterior() {
    if Command::new("cc").arg("--version").output().is_err() {
        eprintln!("no C compiler: NOT RUN");
        return;
    }
    let built = std::env::current_exe().unwrap();
    let library = built.ancestors().map(|d| d.join("libpcadlang_c.a")).find(|f| f.exists());
    let library = library.expect("the static library is built with the tests");
    let program = Path::new(env!("CARGO_TARGET_TMPDIR")).join("line");
    let compiled = Command::new("cc")
        .args(["-std=c11", "-Wall", "-Wextra", "-Werror"])
        .arg(here().join("examples/line.c"))
        .arg(format!("-I{}", here().join("include").display()))
        .arg(library)
        .args(["-lm", "-lpthread", "-ldl", "-o"])
        .arg(&program)
        .output()
        .unwrap();
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    let run = Command::new(&program).output().unwrap();
    let out = String::from_utf8_lossy(&run.stdout);
    assert!(run.status.success(), "{out}");
    assert!(out.contains("4 chains of") && out.contains("<program>:1:"), "{out}");
}

#[test]
fn nulls_and_mistakes_are_errors() {
    use pcadlang_c::*;
    use std::ffi::{CStr, CString};
    use std::ptr::{null, null_mut};
    // SAFETY: every function allows null, and the texts end with a zero byte.
    unsafe {
        assert!(pcad_open(null()).is_null() && pcad_parse(null()).is_null());
        assert!(pcad_compile(null()).is_null() && pcad_sample(null(), null()).is_null());
        assert_eq!((pcad_chains(null()), pcad_draws(null())), (0, 0));
        assert_eq!(pcad_read(null(), null(), null_mut(), 0), 0);
        assert!(pcad_summary(null()).is_null());
        assert_eq!(pcad_set(null_mut(), c"x".as_ptr(), c"1".as_ptr()), -1);
        pcad_program_free(null_mut());
        pcad_model_free(null_mut());
        pcad_posterior_free(null_mut());
        pcad_text_free(null_mut());
        let program = pcad_parse(c"param p = 1; data y; assume x ~ normal(0, p);".as_ptr());
        assert_eq!(pcad_set(program, null(), null()), -1);
        assert_eq!(pcad_observe_array(program, c"y".as_ptr(), null(), 3), -1);
        assert_eq!(pcad_observe_file(program, c"y".as_ptr(), c"none.json".as_ptr()), -1);
        let latin = CString::new([0xe4]).unwrap();
        assert_eq!(pcad_set(program, latin.as_ptr(), c"1".as_ptr()), -1);
        assert!(pcad_compile(program).is_null());
        assert!(CStr::from_ptr(pcad_error()).to_str().unwrap().contains("`y`"));
        assert_eq!(pcad_observe_number(program, c"y".as_ptr(), 2.0), 0);
        let model = pcad_compile(program);
        let options = PcadOptions { seconds: -1.0, ..PcadOptions::default() };
        assert!(pcad_sample(model, &options).is_null());
        let options = PcadOptions { chains: 2, steps: 10, ..PcadOptions::default() };
        let posterior = pcad_sample(model, &options);
        pcad_model_free(model);
        pcad_program_free(program);
        assert_eq!(pcad_read(posterior, c"z".as_ptr(), null_mut(), 0), 0);
        assert!(CStr::from_ptr(pcad_error()).to_str().unwrap().contains("there are:"));
        assert_eq!(pcad_chains(posterior), 2);
        let summary = pcad_summary(posterior);
        assert!(CStr::from_ptr(summary).to_str().unwrap().contains("\"mean\""));
        pcad_text_free(summary);
        pcad_posterior_free(posterior);
    }
}
