//! `report.html`: its contents after a run, and `pcadlang report`, which rebuilds the
//! page from a run's folder.

use crate::common::folder::{Folder, disc, png};

/// A ball in a photograph of a disc, with a landmark at its centre that a detector saw
/// slightly off.
const BALL: &str = "include \"std/scene.pcad\" as scene;
    data photo: image \"the photograph\";
    data points = keypoints();
    assume x ~ normal(0, 0.5);
    assume size ~ uniform(0.2, 0.8);
    let ball = scene.landmarks(scene.sphere(size), { nose: [0, 0, 0] });
    let view = scene.render(scene.affine(translate = [x, 0, 0]) * ball);
    observe scene.keypoints(view, sd = 2) = points as joints;
    observe scene.contour(view, size = 96) = photo as picture;
    infer { warmup 60 { drift(one(@**)); } repeat 60 { drift(one(@**)); collect x, size; } }";

/// A ball where the picture suggests one. [`DISC`] is the outline of that of `disc.png`.
pub const PLACED: &str = "include \"std/scene.pcad\" as scene;
    data photo: image \"the photograph\";
    let places = scene.candidates(photo);
    assume x ~ normal(0, 0.5);
    let view = scene.render(scene.affine(translate = [x, 0, 0]) * scene.sphere(0.55));
    observe scene.contour(view, size = 96) = photo as picture;
    infer {
      init(best_of(100));
      warmup 60 { drift(@x); }
      repeat 60 { drift(@x); collect x, len(places); }
    }";
pub const DISC: [[u32; 2]; 8] =
    [[103, 68], [92, 79], [76, 79], [65, 68], [65, 52], [76, 41], [92, 41], [103, 52]];

fn seen(name: &str) -> Folder {
    let f = Folder::new(name);
    f.write("ball.pcad", BALL).write("disc.png", png(disc(160, 120, 84.0, 60.0, 20.0)));
    f.write("disc.json", r#"{"nose": [88, 58, 1]}"#);
    f
}

const RUN: [&str; 8] = [
    "run",
    "ball.pcad",
    "--observe",
    "disc.png",
    "--keypoints",
    "disc.json",
    "--quiet",
    "--chains",
];

/// Removes the page of a folder and rebuilds it: it must be identical to the last byte.
fn made_again(f: &Folder, run: &str) -> String {
    let (name, page) = (format!("{run}/report.html"), f.read(&format!("{run}/report.html")));
    std::fs::remove_file(f.path().join(&name)).unwrap();
    let done = f.succeeds(&["report", run]);
    assert_eq!((done.out.trim_end(), done.err.as_str()), (name.as_str(), ""));
    let again = f.read(&name);
    let same = page.bytes().zip(again.bytes()).take_while(|(a, b)| a == b).count();
    let around = |text: &str| {
        text.as_bytes()
            .get(same.saturating_sub(60)..(same + 60).min(text.len()))
            .map(<[u8]>::to_vec)
    };
    let around =
        |text: &str| String::from_utf8_lossy(&around(text).unwrap_or_default()).into_owned();
    assert!(
        page == again,
        "another page from byte {same} on:\n{}\n{}",
        around(&page),
        around(&again)
    );
    page
}

#[test]
fn a_page_is_made_again() {
    let f = seen("page-again");
    f.succeeds(&[&RUN[..], &["2", "--out", "ball"]].concat());
    let page = made_again(&f, "ball");
    // The program and the photograph are no longer needed.
    for gone in ["ball.pcad", "disc.png", "disc.json"] {
        std::fs::remove_file(f.path().join(gone)).unwrap();
    }
    made_again(&f, "ball");
    for said in [
        "the photograph",
        "the best state over it",
        "the contours of the photograph",
        "detected joints",
    ] {
        assert!(page.contains(&format!("<figcaption>{said}")), "{said}");
    }
    let pair = page
        .split("<div class=\"pair\">")
        .nth(1)
        .and_then(|p| p.split("</div>").next())
        .unwrap_or_default();
    assert_eq!(
        pair.matches("<img class=\"lines\"").count(),
        2,
        "the contours of both are side by side"
    );
    let command = "pcadlang run ball.pcad --observe disc.png --keypoints disc.json --seed 1 --chains 2 --quality own";
    assert!(
        page.contains(&format!("<pre id=\"command\">{command}</pre>")),
        "the command is there to copy"
    );
    let facts = page
        .split("<p class=\"facts\">")
        .nth(1)
        .and_then(|p| p.split("</p>").next())
        .unwrap_or_default();
    assert!(
        facts.contains(" UTC · ") && facts.contains(" s in all · 2 chains · seed 1"),
        "{facts}"
    );
    assert!(page.contains("data:image/jpeg"), "the photograph is in the page");
    for name in ["photo.jpg", "photo_contours.png", "joints.png", "program.pcad"] {
        assert!(f.exists(&format!("ball/{name}")), "{name}");
    }
    // The contours of the photograph are those of the disc, with a radius of 20 pixels
    // around (84, 60).
    let lines = image::open(f.path().join("ball/photo_contours.png")).unwrap().to_luma8();
    assert_eq!(
        lines.dimensions(),
        image::open(f.path().join("ball/contours.png")).unwrap().to_luma8().dimensions()
    );
    let far = |(x, y, _): &(u32, u32, &image::Luma<u8>)| {
        (f64::from(*x) - 83.5).hypot(f64::from(*y) - 59.5) - 20.0
    };
    let lit: Vec<f64> =
        lines.enumerate_pixels().filter(|p| p.2.0[0] > 128).map(|p| far(&p).abs()).collect();
    assert!(lit.len() > 60 && lit.iter().all(|d| *d < 3.0), "{lit:?}");
}

/// If only joints are compared, as for people, the contours of the photograph are still
/// shown, but a photograph without contours gives no warning.
#[test]
fn contours_are_shown_where_only_joints_are_compared() {
    let f = seen("page-joints");
    let joints: Vec<&str> = BALL.lines().filter(|l| !l.contains("scene.contour(")).collect();
    f.write("ball.pcad", joints.join("\n"));
    f.succeeds(&[&RUN[..], &["2", "--out", "ball"]].concat());
    let page = made_again(&f, "ball");
    let pair = page
        .split("<div class=\"pair\">")
        .nth(1)
        .and_then(|p| p.split("</div>").next())
        .unwrap_or_default();
    assert_eq!(
        pair.matches("<img class=\"lines\"").count(),
        2,
        "the contours of both are side by side"
    );
    f.write("disc.png", png(image::GrayImage::from_pixel(160, 120, image::Luma([200]))));
    f.succeeds(&[&RUN[..], &["2", "--out", "blank"]].concat());
    assert!(!f.read("blank/summary.json").contains("no contours were found"));
}

/// The page can be rebuilt from chains of different lengths, and from names that the
/// files of draws cannot contain.
#[test]
fn pages_of_odd_draws_are_made_again() {
    let f = Folder::new("page-odd");
    let program = "assume k ~ uniform_discrete(1, 4); assume v ~ iid(normal(0, 1), 3);
        assume w = map(fn(i) { z[i] ~ normal(i, 1); z[i] }, 0 .. k); let both = { a: sum(w), b: v[1] };
        observe normal(sum(w), 2) = 5;
        infer { warmup 50 { mh(one(@**)); } repeat 400 { mh(one(@**)); collect k, w, v, both, pow(k, 2); } }";
    f.write("odd.pcad", program);
    f.succeeds(&[
        "run", "odd.pcad", "--chains", "3", "--time", "600ms", "--quiet", "--out", "time",
    ]);
    made_again(&f, "time");
    f.succeeds(&["run", "odd.pcad", "--chains", "3", "--quiet", "--out", "steps"]);
    let page = made_again(&f, "steps");
    assert!(
        page.replace("<wbr>", "").contains(">pow(k, 2)<"),
        "the name of before, with its comma"
    );
    assert!(!page.contains("<img") && !page.contains("<canvas"), "nothing is seen");
}

/// Chains in different modes: each mode's picture is above its column.
#[test]
fn each_mode_has_its_picture() {
    let f = Folder::new("page-modes");
    let program = "include \"std/scene.pcad\" as scene;
        assume x ~ uniform(-1.5, 1.5); observe normal(x, 9) = 0;
        assume view = scene.render(scene.affine(translate = [x, 0, 0]) * scene.sphere(0.4));
        infer { repeat 60 { collect x; } }";
    f.write("far.pcad", program);
    f.succeeds(&["run", "far.pcad", "--chains", "3", "--seed", "1", "--quiet", "--out", "far"]);
    let page = made_again(&f, "far");
    let each = |n: usize| {
        format!("<img class=\"thumb\" alt=\"the best state of mode {n}\" src=\"data:image/")
    };
    assert!(
        (1..=3)
            .all(|n| page.matches(&each(n)).count() == 1 && f.exists(&format!("far/mode-{n}.png")))
    );
    let pictures: Vec<_> =
        (1..=3).map(|n| image::open(f.path().join(format!("far/mode-{n}.png"))).unwrap()).collect();
    assert!(pictures[0] != pictures[1] && pictures[1] != pictures[2]);
    // Another run in the folder, with a single mode, removes the pictures.
    f.succeeds(&["run", "far.pcad", "--chains", "1", "--quiet", "--out", "far"]);
    assert!(!f.exists("far/mode-1.png") && !made_again(&f, "far").contains("class=\"thumb\""));
}

/// A run that was killed, one that failed, and a folder without a run.
#[test]
fn what_is_no_whole_run_is_said() {
    let f = seen("page-none");
    f.succeeds(&[&RUN[..], &["2", "--out", "ball"]].concat());
    std::fs::remove_file(f.path().join("ball/summary.json")).unwrap();
    f.write("ball/run.json", f.read("ball/run.json").replace("\"done\"", "\"running\""));
    let cut = f.read("ball/chain-2.csv");
    f.write("ball/chain-2.csv", &cut[..cut.len() - 7]);
    f.succeeds(&["report", "ball"]);
    let page = f.read("ball/report.html");
    assert!(
        page.contains("<p class=\"warning\">the run has not ended")
            && page.contains("<a href=\"#q0\">log_"),
        "{page}"
    );
    f.write("ball/best.obj", "none").write("ball/photo.jpg", "none");
    f.succeeds(&["report", "ball"]);
    let page = f.read("ball/report.html");
    assert!(
        !page.contains("<canvas") && page.contains("the best state over it"),
        "what is broken is left out"
    );
    f.write("ball/chain-2.csv", "half a");
    f.write("ball/chain-1.csv", "");
    f.refuses(&["report", "ball"], "ball holds no draws to report");
    std::fs::create_dir(f.path().join("empty")).unwrap();
    f.write("empty/notes.txt", "none");
    for (folder, hint) in [
        ("empty", "`pcadlang run` leaves"),
        ("nowhere", "no such folder"),
        ("disc.png", "is a file"),
    ] {
        f.refuses(&["report", folder], &format!("{folder} is not the folder of a run"));
        let err = f.run(&["report", folder]).err;
        assert!(err.contains(hint), "{err}");
    }
    f.write("empty/evaluation.json", "{}");
    assert!(
        f.run(&["report", "empty"])
            .err
            .contains("an evaluation has a run in each folder of a case")
    );
}

/// The first line of a run is that of its page, and in its record.
#[test]
fn a_page_begins_with_whether_the_object_was_found() {
    let f = Folder::new("page-found");
    f.write("placed.pcad", PLACED).write("disc.png", png(disc(160, 120, 84.0, 60.0, 20.0)));
    let said = |run: &str, left: u32| {
        let corner = |[x, y]: [u32; 2]| format!("{},{y}", x - left);
        let outline = DISC.map(corner).join(" ");
        let command = ["run", "placed.pcad", "--observe", "disc.png", "--chains", "2"];
        let said = f.succeeds(&[&command[..], &["--outline", &outline, "--out", run]].concat());
        let line = said.out.lines().next().unwrap().to_owned();
        let record: serde_json::Value =
            serde_json::from_str(&f.read(&format!("{run}/run.json"))).unwrap();
        assert_eq!(record["found"]["text"], line.as_str());
        let page = made_again(&f, run);
        let below = page.split("</h1>\n").nth(1).unwrap();
        assert_eq!(below.lines().next().unwrap(), format!("<p class=\"found\">{line}</p>"));
        line
    };
    let line = said("here", 0);
    assert!(line.starts_with("found: the object covers 9"), "{line}");
    assert!(line.contains("% of the outline that was drawn, and chains agree on "), "{line}");
    let line = said("beside", 60);
    assert!(line.starts_with("not found: the object covers 0% of the outline"), "{line}");
}
