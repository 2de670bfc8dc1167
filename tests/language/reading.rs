//! The files that a program may read: those below its own folder, embedded ones, and
//! those named on the command line.

use crate::common::folder::{Folder, disc, png};
use pcadlang::Program;
use pcadlang_engine::lang::value::Value;

const CHECK: [&str; 2] = ["check", "own/p.pcad"];
const OUTSIDE: &str = "it is outside the folders that the program may read";

/// A folder `own` for a program, beside another that it must not access.
fn two_folders(name: &str) -> Folder {
    let f = Folder::new(name);
    for dir in ["own", "own/parts", "other", "other/deep"] {
        std::fs::create_dir(f.path().join(dir)).unwrap();
    }
    f.write("other/x.csv", "a,b\n1,2\n")
        .write("other/part.pcad", "let secret = 1;")
        .write("own/y.csv", "a,b\n1,2\n");
    f
}

/// Asserts that the program is refused, with the position in its text and a remedy.
fn refused(f: &Folder, text: &str, what: &str) {
    f.write("own/p.pcad", text);
    let d = f.run(&CHECK);
    assert_eq!(d.code, 1, "{text}: {}", d.out);
    for part in [OUTSIDE, "own/p.pcad:1:", "--allow-read", what] {
        assert!(d.err.contains(part), "{text}: {part:?} is not in\n{}", d.err);
    }
    assert!(!d.err.contains("secret"), "{}", d.err);
}

fn allowed(f: &Folder, text: &str, more: &[&str]) {
    f.write("own/p.pcad", text);
    f.succeeds(&[&CHECK[..], more].concat());
}

#[test]
fn files_outside_of_the_folder_are_refused() {
    let f = two_folders("reading_outside");
    let absolute = f.path().join("other").canonicalize().unwrap();
    let absolute = absolute.to_str().unwrap();
    refused(&f, "data t = csv(\"../other/x.csv\");", "other");
    refused(&f, &format!("data t = csv(\"{absolute}/x.csv\");"), absolute);
    refused(&f, "data t = csv(\"parts/../../other/x.csv\");", "other");
    refused(&f, "include \"../other/part.pcad\" as part;", "other");
    refused(&f, &format!("include \"{absolute}/part.pcad\" as part;"), absolute);
    // Nor does a program learn which files exist there.
    refused(&f, "data t = csv(\"../other/missing.csv\");", "other");
    refused(&f, "data t = csv(\"../missing/x.csv\");", "--allow-read");
    // Below the program's folder, a missing file gives the usual error.
    f.write("own/p.pcad", "data t = csv(\"parts/missing.csv\");");
    f.refuses(&CHECK, "no such file");
}

#[test]
fn files_below_the_folder_are_read_by_whatever_path() {
    let f = two_folders("reading_below");
    f.write("own/parts/inner.pcad", "include \"../shared.pcad\" as s; let z = s.x;")
        .write("own/shared.pcad", "let x = 1;");
    allowed(&f, "include \"parts/inner.pcad\" as inner; data t = csv(\"parts/../y.csv\");", &[]);
    let absolute = f.path().join("own/y.csv").canonicalize().unwrap();
    allowed(&f, &format!("data t = csv(\"{}\");", absolute.display()), &[]);
    allowed(&f, "include \"std/scene.pcad\" as scene; data t = csv(\"../own/y.csv\");", &[]);
    // An included file in a subfolder has the same limits as the program.
    f.write("own/parts/inner.pcad", "include \"../../other/part.pcad\" as p;");
    f.write("own/p.pcad", "include \"parts/inner.pcad\" as inner;");
    f.refuses(&CHECK, "cannot read own/parts/../../other/part.pcad");
}

#[test]
fn the_command_line_widens() {
    let f = two_folders("reading_wider");
    let both = "include \"../other/part.pcad\" as part; data t = csv(\"../other/x.csv\");";
    allowed(&f, both, &["--allow-read", "other"]);
    f.refuses(
        &[&CHECK[..], &["--allow-read", "other/deep"]].concat(),
        "cannot read own/../other/part.pcad",
    );
    f.refuses(
        &[&CHECK[..], &["--allow-read", "missing"]].concat(),
        "cannot read missing: no such \
        file",
    );
    f.refuses(&[&CHECK[..], &["--allow-read", "other/x.csv"]].concat(), "cannot read other/x.csv");
    f.write("own/p.pcad", "data t: csv; assume x ~ normal(0, 1); observe normal(x, 1) = t.a[0];");
    let run = ["run", "own/p.pcad", "--steps", "5", "--chains", "1", "--quiet", "--out", "out"];
    f.succeeds(&[&run[..], &["--observe", "t=other/x.csv"]].concat());
}

#[cfg(unix)]
#[test]
fn symbolic_links_are_followed_before_they_are_judged() {
    use std::os::unix::fs::symlink;
    let f = two_folders("reading_links");
    let at = |name: &str| f.path().join(name);
    symlink("../other/x.csv", at("own/link.csv")).unwrap();
    symlink(at("other").canonicalize().unwrap(), at("own/away")).unwrap();
    symlink("parts", at("own/within")).unwrap();
    symlink("nowhere", at("own/broken")).unwrap();
    f.write("own/parts/z.csv", "a\n1\n");
    refused(&f, "data t = csv(\"link.csv\");", "other");
    refused(&f, "data t = csv(\"away/x.csv\");", "other");
    refused(&f, "include \"away/part.pcad\" as part;", "other");
    refused(&f, "data t = csv(\"away/deep/../x.csv\");", "other");
    allowed(&f, "data t = csv(\"within/z.csv\");", &[]);
    f.write("own/p.pcad", "data t = csv(\"broken/x.csv\");");
    f.refuses(&CHECK, "no such file");
    // A file that was read is replaced by a link.
    allowed(&f, "data t = csv(\"y.csv\");", &[]);
    std::fs::remove_file(at("own/y.csv")).unwrap();
    symlink("../other/x.csv", at("own/y.csv")).unwrap();
    refused(&f, "data t = csv(\"y.csv\");", "other");
    // A program that is a link is named on the command line; its folder is that of the
    // link.
    f.write("other/p2.pcad", "data t = csv(\"parts/z.csv\");");
    symlink("../other/p2.pcad", at("own/p2.pcad")).unwrap();
    f.succeeds(&["check", "own/p2.pcad"]);
    // Reading a pipe would wait for a writer.
    std::process::Command::new("mkfifo").arg(at("own/pipe.csv")).status().unwrap();
    f.write("own/p.pcad", "data t = csv(\"pipe.csv\");");
    f.refuses(&CHECK, "it is not a regular file");
}

#[test]
fn files_that_files_name_are_bounded_alike() {
    let f = two_folders("reading_named");
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let rig = |mesh: &str| {
        let weights = "[[[0, 1]], [[0, 1]], [[0, 1]]]";
        format!(
            "{{\"mesh\": \"{mesh}\", \"joints\": [{{\"name\": \"j\", \"head\": [0, 0, 0]}}], \"weights\": {weights}}}"
        )
    };
    f.write("other/a.obj", triangle).write("own/a.obj", triangle);
    f.write("own/in.rig.json", rig("a.obj")).write("own/out.rig.json", rig("../other/a.obj"));
    allowed(&f, "data body = armature(\"in.rig.json\");", &[]);
    refused(&f, "data body = armature(\"out.rig.json\");", "other");
    allowed(&f, "data body = armature(\"out.rig.json\");", &["--allow-read", "other"]);
    let gltf = |uri: &str| {
        format!(
            "{{\"asset\": {{\"version\": \"2.0\"}}, \"buffers\": [{{\"byteLength\": 1, \"uri\": \"{uri}\"}}]}}"
        )
    };
    f.write("own/m.gltf", gltf("..%2Fother%2Fa.obj"));
    refused(&f, "data m = mesh(\"m.gltf\");", "other");
    // A file named on the command line may name others below its own folder only.
    f.write(
        "own/p.pcad",
        "data body: armature; assume x ~ normal(0, 1); observe normal(x, 1) = 1;",
    );
    f.write("other/b.rig.json", rig("a.obj"))
        .write("other/c.rig.json", rig("../secret.obj"))
        .write("secret.obj", triangle);
    let run = [
        "run",
        "own/p.pcad",
        "--steps",
        "5",
        "--chains",
        "1",
        "--quiet",
        "--out",
        "out",
        "--observe",
    ];
    f.succeeds(&[&run[..], &["body=other/b.rig.json"]].concat());
    let d = f.run(&[&run[..], &["body=other/c.rig.json"]].concat());
    assert!(d.code == 1 && d.err.contains(OUTSIDE), "{}", d.err);
}

#[test]
fn banks_are_looked_for_where_the_program_may_read() {
    let f = two_folders("reading_banks");
    let program = |bank: &str| {
        format!(
            "assume x ~ normal(0, 1); observe normal(x, 1) = 1; infer {{ repeat 5 {{ knn(@x, bank = \"{bank}\", k = 2); }} }}"
        )
    };
    let run = ["run", "own/p.pcad", "--chains", "1", "--quiet", "--out", "out"];
    f.write("other/x.bank", "not a bank").write("own/y.bank", "not a bank");
    f.write("own/p.pcad", program("../other/x.bank"));
    let d = f.run(&run);
    assert!(d.code == 1 && d.err.contains(OUTSIDE) && d.err.contains("--allow-read"), "{}", d.err);
    f.write("own/p.pcad", program("y.bank"));
    let d = f.run(&run);
    assert!(d.code == 1 && d.err.contains("it is not a bank"), "{}", d.err);
}

#[test]
fn the_library_does_the_same() {
    let f = two_folders("reading_library");
    let text = "include \"../other/part.pcad\" as part; data t = csv(\"../other/x.csv\");";
    let path = f.write("own/p.pcad", text).path().join("own/p.pcad");
    let (path, other) = (path.to_str().unwrap(), f.path().join("other"));
    let why = |e: pcadlang::Error| e.to_string();
    assert!(Program::open(path).map_err(why).err().unwrap().contains(OUTSIDE));
    assert!(Program::open_allowing(path, &[&other]).and_then(Program::compile).is_ok());
    assert!(Program::open_allowing(path, &[other.join("none")]).is_err());
    // Reading may be allowed after opening, for files that are read later.
    f.write("own/p.pcad", "data t = csv(\"../other/x.csv\");");
    assert!(
        Program::open(path).and_then(Program::compile).map_err(why).unwrap_err().contains(OUTSIDE)
    );
    assert!(
        Program::open(path).and_then(|p| p.allow_read(&other)).and_then(Program::compile).is_ok()
    );
    // Permissions persist when the program is edited, and when another program replaces
    // it.
    let wider = Program::open_allowing(path, &[&other]).unwrap();
    assert!(wider.edited("include \"../other/part.pcad\" as part;").is_ok());
    f.write("own/parts/q.pcad", "include \"../../other/part.pcad\" as part;")
        .write("own/shared.pcad", "let x = 1;");
    let next = f.path().join("own/parts/q.pcad");
    let next = next.to_str().unwrap();
    assert!(wider.replaced(next).is_ok() && Program::open(path).unwrap().replaced(next).is_err());
    assert!(wider.written_as(next).is_ok());
    // A program given as text cannot read files, but may observe files given to it.
    let text =
        format!("data t = csv(\"{}\"); assume x ~ normal(0, 1);", other.join("x.csv").display());
    assert!(
        Program::parse(&text)
            .and_then(Program::compile)
            .map_err(why)
            .unwrap_err()
            .contains(OUTSIDE)
    );
    let given = Program::parse(&text)
        .and_then(|p| p.observe_file("t", other.join("x.csv").to_str().unwrap()));
    assert!(given.and_then(Program::compile).is_ok());
    let photo = f.write("x.png", png(disc(8, 8, 4.0, 4.0, 2.0))).path().join("x.png");
    let program = Program::parse("data photo: image; assume x ~ normal(0, 1);").unwrap();
    assert!(
        program.observe_file("photo", photo.to_str().unwrap()).and_then(Program::compile).is_ok()
    );
    assert!(Program::parse(&text).unwrap().observe("t", Value::Unit).compile().is_ok());
}
