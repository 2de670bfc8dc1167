//! Invalid files and settings: exit code 1, a message that names the fault, and no partly
//! written output.

use crate::common::folder::{Folder, disc, png};
use image::{GrayImage, RgbImage};

const RUN: [&str; 9] =
    ["run", "p.pcad", "--steps", "5", "--warmup", "5", "--chains", "1", "--quiet"];

fn run<'a>(more: &[&'a str]) -> Vec<&'a str> {
    RUN.iter().copied().chain(more.iter().copied()).collect()
}

/// A program that observes a photograph.
const PHOTO: &str = "include \"std/scene.pcad\" as scene; data photo: image \"the photograph\";
    assume r ~ uniform(0.3, 1.5);
    assume view = scene.render(scene.sphere(r));
    observe scene.contour(view, size = 32) = photo as picture;
    infer { repeat 5 { drift(one(@**)); collect r; } }";

/// A program that renders a mesh.
const MESH: &str = "include \"std/scene.pcad\" as scene; data m = mesh(\"x.obj\");
    assume x ~ uniform(-1, 1);
    assume view = scene.render(scene.affine(translate = [x, 0, 0]) * scene.centred(m));
    observe normal(x, 1) = 0;
    infer { repeat 5 { mh(@x); collect x; } }";

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |c, b| {
        (0..8).fold(
            c ^ u32::from(*b),
            |c, _| if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 },
        )
    })
}

/// A PNG whose header claims another size.
fn claims(width: u32, height: u32) -> Vec<u8> {
    let mut bytes = png(RgbImage::new(1, 1));
    bytes[16..20].copy_from_slice(&width.to_be_bytes());
    bytes[20..24].copy_from_slice(&height.to_be_bytes());
    let crc = crc32(&bytes[12..29]).to_be_bytes();
    bytes[29..33].copy_from_slice(&crc);
    bytes
}

#[test]
fn pictures_that_are_none() {
    let f = Folder::new("pictures");
    let whole = png(disc(64, 64, 32.0, 32.0, 20.0));
    f.write("p.pcad", PHOTO).write("empty.png", b"").write("cut.png", &whole[..whole.len() / 2]);
    f.write("head.png", &whole[..10])
        .write("text.png", "This is a text.")
        .write("sound.wav", b"RIFF\x24\x00\x00\x00WAVEfmt ");
    f.write("claims.png", claims(16384, 16384))
        .write("huge.png", claims(60000, 60000))
        .write("lie.png", claims(9000, 9000));
    std::fs::create_dir(f.path().join("folder.png")).unwrap();
    for (file, says) in [
        ("missing.png", "cannot read missing.png: no such file"),
        ("empty.png", "empty.png"),
        ("cut.png", "cut.png"),
        ("head.png", "head.png"),
        ("text.png", "text.png"),
        ("sound.wav", "sound.wav"),
        ("claims.png", "16384 x 16384"),
        ("huge.png", "60000 x 60000"),
        ("lie.png", "lie.png"),
        ("folder.png", "cannot read folder.png: it is a folder"),
    ] {
        f.refuses(&run(&["--observe", file]), says);
        f.refuses(&run(&["--observe", &format!("photo={file}")]), says);
        f.refuses(&["contours", file, "-o", "out.png"], says);
    }
    f.refuses(&run(&["--observe-contours", "cut.png"]), "cut.png");
    // Without a picture, the program names the input that it needs.
    f.refuses(&run(&[]), "photo");
}

/// A picture of the largest allowed width is read and explained like any other.
#[test]
fn a_very_wide_picture_is_read() {
    let f = Folder::new("wide");
    f.write("p.pcad", PHOTO)
        .write("wide.png", png(GrayImage::from_fn(16384, 8, |x, _| image::Luma([(x / 64) as u8]))));
    f.succeeds(&["contours", "wide.png", "-o", "out.png", "--size", "64"]);
    assert!(f.exists("out.png"));
    f.succeeds(&run(&["--observe", "wide.png", "--out", "out"]));
    assert!(f.read("out/run.json").contains("\"done\""));
    // A single pixel, and a picture without contrast.
    f.write("one.png", png(GrayImage::new(1, 1))).write("flat.png", png(GrayImage::new(40, 30)));
    for file in ["one.png", "flat.png"] {
        f.succeeds(&["contours", file, "-o", "out.png"]);
        f.succeeds(&run(&["--observe", file, "--out", "out"]));
    }
}

#[test]
fn cameras_that_are_none() {
    let f = Folder::new("cameras");
    f.write("p.pcad", PHOTO).write("x.png", png(disc(32, 32, 16.0, 16.0, 9.0)));
    f.write("empty.json", "")
        .write("list.json", "[1, 2]")
        .write("text.json", "camera")
        .write("bin.json", [0xff, 0xfe, 0]);
    f.write("none.json", "{}").write("nan.json", "{\"width\": 1e999}");
    f.refuses(
        &run(&["--camera", "missing.json", "--observe", "x.png"]),
        "cannot read missing.json",
    );
    for file in ["empty.json", "list.json", "text.json", "bin.json", "none.json", "nan.json"] {
        f.refuses(&run(&["--camera", file, "--observe", "x.png"]), file);
        f.refuses(&["sample", "p.pcad", "--camera", file], file);
    }
}

#[test]
fn meshes_that_are_none() {
    let f = Folder::new("meshes");
    f.write("p.pcad", MESH);
    f.refuses(&run(&[]), "cannot read x.obj: no such file");
    for (text, says) in [
        ("", "the file is empty"),
        ("v 0 0 0\nv 1 nan 0\nv 0 1 0\nf 1 2 3\n", "line 2"),
        ("v 0 0 0\nv 1 inf 0\nv 0 1 0\nf 1 2 3\n", "line 2"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "line 4"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", "line 4"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -4 1 2\n", "line 4"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 99999999999999999999 1 2\n", "line 4"),
        ("v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n", "have zero area"),
        ("hello\n", "no faces"),
    ] {
        f.write("x.obj", text);
        f.refuses(&run(&[]), says);
        f.refuses(&["sample", "p.pcad"], says);
        f.refuses(&["check", "p.pcad"], says);
    }
    f.write("x.obj", [0x76, 0x20, 0xff, 0xfe]);
    f.refuses(&run(&[]), "line 1 of the OBJ file: a coordinate must be a finite number");
    // A face may refer to normals that are missing; a correct mesh renders.
    f.write("x.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1//7 2//8 3//9\n");
    let d = f.run(&run(&["--out", "a"]));
    assert!(
        d.code == 0 || d.code == 1 && d.err.starts_with("error") && !f.exists("a"),
        "{}",
        d.err
    );
    f.write("x.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    f.succeeds(&run(&["--out", "b"]));
    assert!(f.exists("b/best.obj") && f.exists("b/overlay.png"));
}

/// Objects out of view, behind the camera or as large as their distance: the run
/// completes.
#[test]
fn objects_out_of_view() {
    let f = Folder::new("away");
    f.write("x.png", png(disc(32, 32, 16.0, 16.0, 9.0)));
    for place in
        ["[50, 0, 0]", "[0, 0, 30]", "[0, 0, 8]", "[0, 0, -1e6]", "[1e15, 1e15, 0]", "[0, 0, 7.9]"]
    {
        f.write(
            "p.pcad",
            format!(
                "include \"std/scene.pcad\" as scene; data photo: image; assume r ~ uniform(0.3, 1.5);
                 assume view = scene.render(scene.affine(translate = {place}) * scene.sphere(r));
                 observe scene.contour(view, size = 32) = photo as picture;
                 infer {{ repeat 5 {{ drift(one(@**)); collect r, log_joint(); }} }}"
            ),
        );
        f.succeeds(&run(&["--observe", "x.png", "--out", "out"]));
        let draws = f.read("out/chain-1.csv");
        assert!(!draws.contains("NaN") && !draws.contains("nan"), "{place}: {draws}");
    }
}

#[test]
fn programs_that_are_none() {
    let f = Folder::new("programs");
    f.refuses(&["run", "missing.pcad"], "cannot read missing.pcad: no such file");
    f.refuses(&["check", "missing.pcad"], "cannot read missing.pcad");
    std::fs::create_dir(f.path().join("p.pcad")).unwrap();
    f.refuses(&run(&[]), "it is a folder");
    std::fs::remove_dir(f.path().join("p.pcad")).unwrap();
    f.write("p.pcad", [0xff, 0xfe, 0x00, 0x41]);
    f.refuses(&run(&[]), "UTF-8");
    f.write("p.pcad", png(disc(32, 32, 16.0, 16.0, 9.0)));
    f.refuses(&run(&[]), "");
    // An included path that is a folder, or the program itself.
    std::fs::create_dir(f.path().join("part.pcad")).unwrap();
    f.write("p.pcad", "include \"part.pcad\" as part; assume x ~ normal(0, 1);");
    f.refuses(&run(&[]), "part.pcad");
    f.write("p.pcad", "include \"p.pcad\" as me; assume x ~ normal(0, 1);");
    f.refuses(&run(&[]), "cycle");
    f.write("p.pcad", "include \"./p.pcad\" as me; assume x ~ normal(0, 1);");
    f.refuses(&run(&[]), "cycle");
}

/// An empty program is not an error, but there is nothing to infer.
#[test]
fn an_empty_program_runs_or_says_why_not() {
    let f = Folder::new("empty");
    f.write("p.pcad", "");
    let d = f.run(&run(&["--out", "out"]));
    assert!(d.code == 0 || d.err.starts_with("error"), "{}", d.err);
}

#[test]
fn recursion_without_end() {
    let f = Folder::new("recursion");
    for text in [
        "fn f(x) { f(x + 1) } assume a = f(0); observe normal(a, 1) = 0;",
        "fn f(x) { g(x) + 1 } fn g(x) { f(x) + 1 } assume a = f(0); observe normal(a, 1) = 0;",
        "fn f(x) { s ~ flip(1); if s { 1 + f(x) } else { 0 } } assume a = f(0); observe normal(a, 1) = 0;",
        "fn f(x) { s ~ normal(x, 1); s + f(s) } assume a = f(0); observe normal(a, 1) = 0;",
    ] {
        f.write("p.pcad", text);
        f.refuses(&run(&[]), "");
        f.refuses(&["sample", "p.pcad", "-n", "1"], "");
    }
}

#[test]
fn very_large_programs() {
    let f = Folder::new("large");
    let n = 100_000;
    for (open, close) in [
        ("(", ")"),
        ("[", "]"),
        ("-", ""),
        ("{", "}"),
        ("if true { ", " } else { 0 }"),
        ("fn(x) { ", "}"),
    ] {
        f.write("p.pcad", format!("assume x = {}1{};", open.repeat(n), close.repeat(n)));
        f.refuses(&run(&[]), "");
        f.refuses(&["check", "p.pcad"], "");
    }
    f.write("p.pcad", format!("assume x = {};", "(".repeat(n)));
    f.refuses(&run(&[]), "");
    // A source file of 5 MB is refused; one of slightly under 4 MiB is read, with and
    // without an error at its end.
    let comment = "// a comment that says nothing in particular, to make the file large, again and again, line by line\n";
    f.write("p.pcad", comment.repeat(50_000));
    f.refuses(&run(&[]), "the file is too large");
    let big =
        format!("{}assume x ~ normal(0, 1); observe normal(x, 1) = 1;\n", comment.repeat(40_000));
    f.write("p.pcad", &big);
    f.succeeds(&run(&["--out", "big"]));
    f.write("p.pcad", format!("{big}assume y = ;"));
    f.refuses(&run(&[]), "");
    let sum = format!(
        "assume x ~ normal(0, 1); let s = x{};\nobserve normal(s, 1) = 0;",
        " + 1".repeat(n)
    );
    f.write("p.pcad", sum);
    let d = f.run(&run(&["--out", "sum"]));
    assert!(d.code == 0 || d.code == 1 && d.err.starts_with("error"), "{}", d.err);
    // 1 MB of definitions is either handled in linear time or refused with a reason.
    let mut big = String::new();
    while big.len() < 1_000_000 {
        big.push_str(&format!("let v{} = {};\n", big.len(), big.len()));
    }
    f.write("p.pcad", big);
    let d = f.run(&["check", "p.pcad"]);
    assert!(d.code == 0 || d.code == 1 && d.err.starts_with("error"), "{}", d.err);
}

#[test]
fn settings_that_are_none() {
    let f = Folder::new("settings");
    f.write("p.pcad", PHOTO).write("x.png", png(disc(32, 32, 16.0, 16.0, 9.0)));
    f.refuses(&run(&["--set", "size=3", "--observe", "x.png"]), "size");
    f.refuses(&run(&["--observe", "foto=x.png"]), "foto");
    f.refuses(&run(&["--observe", "photo=x.png", "--observe", "other=x.png"]), "other");
    f.write("q.pcad", "param n: int = 3; assume x ~ normal(0, n); observe normal(x, 1) = 0;");
    let q = |v| vec!["run", "q.pcad", "--steps", "5", "--warmup", "5", "--quiet", "--set", v];
    f.refuses(&q("m=3"), "m");
    f.refuses(&q("n=\"three\""), "");
    f.refuses(&q("n=(1"), "");
    f.refuses(&q("n="), "");
    f.refuses(&q("n=-3"), "");
    f.refuses(&["run", "q.pcad", "--observe", "x.png"], "has no `data` items");
    f.write(
        "two.pcad",
        "include \"std/scene.pcad\" as scene; data a: image; data b: image; assume r ~ uniform(0.3, 1);
        assume view = scene.render(scene.sphere(r));
        observe scene.contour(view, size = 32) = a as a; observe scene.contour(view, size = 32) = b as b;",
    );
    f.refuses(&["run", "two.pcad", "--observe", "x.png"], "several images");
    f.refuses(&["run", "two.pcad", "--observe", "a=x.png"], "b");
}

#[test]
fn folders_that_hold_something_else() {
    let f = Folder::new("out");
    f.write("p.pcad", "assume x ~ normal(0, 1); observe normal(x, 1) = 1; infer { repeat 5 { mh(@x); collect x; } }");
    std::fs::create_dir(f.path().join("photos")).unwrap();
    f.write("photos/me.jpg", b"x").write("file", b"y");
    f.refuses(&run(&["--out", "photos"]), "not empty");
    f.refuses(&run(&["--out", "file"]), "file");
    f.refuses(&run(&["--out", "file/below"]), "file");
    assert_eq!(f.read("photos/me.jpg"), "x");
    // An empty folder and the folder of an earlier run are accepted as output; a run
    // leaves no partial files.
    std::fs::create_dir(f.path().join("empty")).unwrap();
    for _ in 0..2 {
        f.succeeds(&run(&["--out", "empty"]));
        assert!(f.files().iter().all(|n| !n.contains(".partial")), "{:?}", f.files());
    }
    f.refuses(
        &["sample", "p.pcad", "--out", "missing/folder/sheet.png", "--camera", "none.json"],
        "none.json",
    );
    f.refuses(&["contours", "file", "--out", "missing/map.png"], "file");
}
