//! The files of the opened folder: programs, pictures, evaluations.

use super::examples;
use super::results::finite;
use pcadlang_engine::lang::reach::path_within;
use pcadlang_library::shipped;
use pcadlang_report::evaluation::MARK;
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_runs::files;
use pcadlang_runs::verdict;
use pcadlang_scene::vision::{Limits, photo};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// The folder in which uploaded photographs are stored.
pub const PICTURES: &str = "pictures";
/// How deep programs and pictures are searched for, and the most that are listed.
const DEPTH: usize = 3;
const LISTED: usize = 1000;

/// The opened folder.
pub struct Folder {
    path: PathBuf,
}

impl Folder {
    /// Opens a folder.
    pub fn new(path: PathBuf) -> Folder {
        Folder { path }
    }

    /// Returns its path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns a path in it.
    pub fn file(&self, asked: &str) -> Result<PathBuf, Failure> {
        path_within(&self.path, asked).map_err(plain)
    }

    /// Lists its files up to some depth, by name; folders of runs and hidden ones are
    /// left out.
    fn files(&self) -> Vec<String> {
        let mut found = Vec::new();
        let mut open = vec![(PathBuf::new(), 0)];
        while let Some((at, depth)) = open.pop() {
            let entries = std::fs::read_dir(self.path.join(&at)).into_iter().flatten().flatten();
            for entry in entries {
                let Ok(name) = entry.file_name().into_string() else { continue };
                let Ok(kind) = entry.file_type() else { continue };
                let path = at.join(&name);
                let is_run = || self.path.join(&path).join("run.json").exists();
                if name.starts_with('.') || name == "target" || name == "node_modules" {
                    continue;
                }
                match kind.is_dir() {
                    true if depth + 1 < DEPTH && !is_run() => open.push((path, depth + 1)),
                    false if kind.is_file() => found.extend(path.to_str().map(str::to_owned)),
                    _ => {}
                }
            }
            if found.len() > 20 * LISTED {
                break;
            }
        }
        found.sort();
        found
    }

    /// Describes the folder.
    pub fn described(&self) -> Value {
        let all = self.files();
        let own = all.iter().filter(|f| f.ends_with(".pcad"));
        let own = own.map(|f| json!({ "file": f, "shipped": false, "about": self.about(f) }));
        let runnable = |f: &&str| f.ends_with(".pcad") && !f.starts_with("std/");
        let known = shipped::programs()
            .filter(runnable)
            .filter(|f| !all.iter().any(|own| own == f))
            .map(|f| json!({ "file": f, "shipped": true, "example": examples::of_program(f), "about": first_comment(shipped::file(f).unwrap_or_default()) }));
        let programs: Vec<Value> = own.chain(known).take(LISTED).collect();
        let pictures: Vec<&String> = all.iter().filter(|f| is_picture(f)).take(LISTED).collect();
        let evaluations: Vec<String> = all
            .iter()
            .filter_map(|f| Some(f.strip_suffix(MARK)?.trim_end_matches('/').to_owned()))
            .filter(|f| !f.is_empty())
            .collect();
        let examples: Vec<&str> = examples::names().collect();
        json!({
            "programs": programs, "pictures": pictures, "examples": examples,
            "evaluations": evaluations,
        })
    }

    fn about(&self, file: &str) -> String {
        let text = std::fs::read_to_string(self.path.join(file)).unwrap_or_default();
        first_comment(&text)
    }

    /// Returns the text of a program, of the folder or shipped.
    pub fn read(&self, file: &str) -> Result<String, Failure> {
        if !file.ends_with(".pcad") {
            return Err(plain(format!("{file}: only programs (.pcad) can be read")));
        }
        let path = self.file(file)?;
        match shipped::file(file).filter(|_| !path.exists()) {
            Some(text) => Ok(text.to_owned()),
            None => String::from_utf8(files::read(&path)?)
                .map_err(|_| plain(format!("{file}: not text"))),
        }
    }

    /// Writes a program.
    pub fn write(&self, file: &str, text: &str) -> Result<(), Failure> {
        if !file.ends_with(".pcad") {
            return Err(plain(format!("{file}: only programs (.pcad) can be written")));
        }
        files::write(&self.file(file)?, text.as_bytes())
    }

    /// Stores a photograph, and returns its name. An equal file is used again; another one
    /// of the same name is kept.
    pub fn store_picture(&self, name: &str, bytes: &[u8]) -> Result<String, Failure> {
        let own = Path::new(name).file_name().and_then(|n| n.to_str());
        let name = own.filter(|n| is_picture(n) && !n.starts_with('.'));
        let name =
            name.ok_or_else(|| plain("the picture needs a name that ends in .png, .jpg or .jpeg"))?;
        photo::decode(bytes, &Limits::default()).map_err(|e| plain(format!("{name}: {e}")))?;
        std::fs::create_dir_all(self.file(PICTURES)?)
            .map_err(|e| plain(format!("{PICTURES}: {e}")))?;
        let (stem, end) = name.rsplit_once('.').unwrap_or((name, "png"));
        for n in 1..10_000 {
            let file = match n {
                1 => format!("{PICTURES}/{name}"),
                n => format!("{PICTURES}/{stem}-{n}.{end}"),
            };
            let path = self.file(&file)?;
            match std::fs::read(&path) {
                Ok(there) if there == bytes => return Ok(file),
                Ok(_) => {}
                Err(_) => {
                    files::write(&path, bytes)?;
                    return Ok(file);
                }
            }
        }
        Err(plain(format!("{name}: too many pictures have this name")))
    }

    /// Lists the cases of an evaluation: failures first, then by doubt.
    pub fn evaluation(&self, folder: &str) -> Result<Value, Failure> {
        let path = self.file(folder)?.join(MARK);
        let all: Value = serde_json::from_slice(&files::read(&path)?)
            .map_err(|e| plain(format!("{}: {e}", path.display())))?;
        let read = |case: &str, name: &str| -> Value {
            let path = self.path.join(folder).join(case).join(name);
            std::fs::read(path)
                .ok()
                .and_then(|b| serde_json::from_slice(&b).ok())
                .unwrap_or_default()
        };
        let case = |row: &Value| {
            let name = row["case"].as_str().unwrap_or_default();
            let run = read(name, "run.json");
            let at = |file: &str| {
                let path = format!("{folder}/{name}/{file}");
                self.path.join(&path).is_file().then_some(path)
            };
            let r_hat = row["r_hat_max"].as_f64();
            // Without a verdict: chains that disagree on the pixels, or on any quantity.
            let apart = 1.0 - run["agreement"].as_f64().unwrap_or(1.0);
            let chains = apart.max(r_hat.map_or(0.0, |r| 1.0 - 1.0 / r.max(1.0)));
            let doubt = verdict::doubt(&run).unwrap_or(chains);
            json!({
                "name": name, "state": row["status"], "error": row["error"],
                "picture": at("photo.jpg"), "overlay": at("overlay.png"), "run": format!("{folder}/{name}"),
                "score": row["best_log_joint"], "r_hat": r_hat, "seconds": row["seconds"],
                "doubt": finite(doubt),
            })
        };
        let mut cases: Vec<Value> =
            all["cases"].as_array().into_iter().flatten().map(case).collect();
        let key = |c: &Value| (c["state"] != "failed", -c["doubt"].as_f64().unwrap_or(0.0));
        cases.sort_by(|a, b| {
            let (a, b) = (key(a), key(b));
            a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
        });
        Ok(json!({ "cases": cases }))
    }
}

/// Returns whether a file name is that of a picture.
pub fn is_picture(name: &str) -> bool {
    let end = Path::new(name).extension().and_then(|e| e.to_str()).map(str::to_lowercase);
    matches!(end.as_deref(), Some("png" | "jpg" | "jpeg"))
}

/// Returns the first comment of a program, without its own name.
fn first_comment(text: &str) -> String {
    let line = text.lines().find(|l| l.starts_with("//")).unwrap_or_default();
    let said = line.trim_start_matches('/').trim();
    said.split_once(" : ").map_or(said, |(_, about)| about).chars().take(160).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(name: &str) -> Folder {
        let path = std::env::temp_dir().join(format!("pcadlang-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).unwrap();
        Folder::new(path)
    }

    #[test]
    fn programs_and_pictures_are_found() {
        let f = folder("folder");
        f.write("mine.pcad", "// mine.pcad : a test\nassume x ~ normal(0, 1);").unwrap();
        let picture = image::RgbImage::new(20, 20);
        let bytes = pcadlang_report::pictures::png(&picture).unwrap();
        assert_eq!(f.store_picture("../../a.png", &bytes).unwrap(), "pictures/a.png");
        assert_eq!(f.store_picture("a.png", &bytes).unwrap(), "pictures/a.png", "the same picture");
        let other = pcadlang_report::pictures::png(&image::RgbImage::new(21, 20)).unwrap();
        assert_eq!(f.store_picture("a.png", &other).unwrap(), "pictures/a-2.png");
        assert!(f.store_picture("a.png", b"no picture").is_err());
        assert!(
            f.store_picture("a.exe", &bytes).is_err() && f.store_picture(".png", &bytes).is_err()
        );
        let all = f.described();
        assert_eq!(all["pictures"], json!(["pictures/a-2.png", "pictures/a.png"]));
        assert_eq!(
            all["programs"][0],
            json!({ "file": "mine.pcad", "shipped": false, "about": "a test" })
        );
        let lathe = all["programs"].as_array().unwrap().iter().find(|p| p["file"] == "lathe.pcad");
        assert_eq!(lathe.unwrap()["shipped"], true);
        assert!(f.read("lathe.pcad").unwrap().contains("assume") && f.read("../x.pcad").is_err());
        assert!(f.write("a.png", "").is_err() && f.read("pictures/a.png").is_err());
        std::fs::remove_dir_all(f.path()).unwrap();
    }

    #[test]
    fn failures_and_doubtful_cases_come_first() {
        let f = folder("gallery");
        let cases = json!({ "cases": [
            { "case": "good", "status": "done", "r_hat_max": 1.0 },
            { "case": "bad", "status": "done", "r_hat_max": 2.0 },
            { "case": "broken", "status": "failed", "error": "no" },
        ] });
        std::fs::create_dir_all(f.path().join("eval")).unwrap();
        std::fs::write(f.path().join("eval").join(MARK), cases.to_string()).unwrap();
        assert_eq!(f.described()["evaluations"], json!(["eval"]));
        let all = f.evaluation("eval").unwrap();
        let names: Vec<&Value> =
            all["cases"].as_array().unwrap().iter().map(|c| &c["name"]).collect();
        assert_eq!(names, ["broken", "bad", "good"]);
        assert_eq!(all["cases"][1]["doubt"], 0.5);
        std::fs::remove_dir_all(f.path()).unwrap();
    }

    #[test]
    fn cases_with_verdicts_are_in_their_order() {
        let f = folder("verdicts");
        let put = |name: &str, text: Value| {
            std::fs::create_dir_all(f.path().join(format!("e/{name}"))).unwrap();
            std::fs::write(f.path().join(format!("e/{name}/run.json")), text.to_string()).unwrap();
        };
        let found =
            |verdict: &str, fit: f64| json!({ "found": { "verdict": verdict, "fit": fit } });
        put("good", found("found", 0.9));
        put("fair", found("found", 0.8));
        put("perhaps", found("perhaps found", 0.95));
        put("nobody", json!({ "found": { "verdict": "not found" } }));
        put("chains", json!({ "agreement": 0.5 }));
        let names = ["good", "chains", "fair", "perhaps", "nobody"];
        let rows = names.map(|n| json!({ "case": n, "status": "done" }));
        let all = json!({ "cases": rows }).to_string();
        std::fs::write(f.path().join("e").join(MARK), all).unwrap();
        let cases = f.evaluation("e").unwrap();
        let order: Vec<&str> = cases["cases"]
            .as_array()
            .unwrap()
            .iter()
            .map(|c| c["name"].as_str().unwrap())
            .collect();
        assert_eq!(order, ["nobody", "chains", "perhaps", "fair", "good"]);
        std::fs::remove_dir_all(f.path()).unwrap();
    }
}
