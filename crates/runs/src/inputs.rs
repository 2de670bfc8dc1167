//! Makes a program with its data from the command line.

use crate::args::{Inputs, Job};
use crate::failure::{Failure, plain};
use crate::files;
use pcadlang_engine::lang::builtins::data::Options;
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::Limits as Bounds;
use pcadlang_library::Program;
use pcadlang_library::scene::{self, ImageValue};
use pcadlang_library::standard;
use pcadlang_scene::render::Camera;
use pcadlang_scene::vision::ContourMap;
use std::path::{Path, PathBuf};

/// The name of a program that comes from the standard input.
pub const STDIN: &str = "-";

/// Reads a program from the standard input. It may read files below the current folder.
fn typed(allowed: &[PathBuf]) -> Result<Program, Failure> {
    let text = std::io::read_to_string(std::io::stdin())
        .map_err(|e| plain(format!("cannot read the standard input: {e}")))?;
    let program = Program::named("<stdin>", &text)?;
    Ok(allowed.iter().try_fold(program, |p, folder| p.allow_read(folder))?)
}

/// Opens the program, with its parameters and camera.
pub fn program(inputs: &Inputs, quiet: bool) -> Result<Program, Failure> {
    let mut program = match &*inputs.program {
        STDIN => typed(&inputs.allowed.allow_read)?,
        path => Program::open_allowing(path, &inputs.allowed.allow_read)?,
    };
    if !quiet {
        for path in
            program.embedded().iter().filter(|p| p.ends_with(".pcad") && !p.starts_with("std/"))
        {
            error_line!("note: using the shipped {path}");
        }
    }
    let limits =
        inputs.allowed.limits.iter().try_fold(Bounds::default(), |l, (name, n)| l.with(name, *n));
    program = program.limits(limits.map_err(plain)?);
    crate::networks::choose(inputs.who.models.as_deref())?;
    if let Some(n) = inputs.who.person {
        program = program.set("person", &n.to_string());
    }
    if let Some([x, y, w, h]) = inputs.who.near {
        program = program.set("near", &format!("[{x}, {y}, {w}, {h}]"));
    }
    for (name, value) in &inputs.sets {
        program = program.set(name, value);
    }
    if let Some(spec) = &inputs.edges {
        program = program.detector(crate::edges::detector(spec)?);
    }
    if let Some(path) = &inputs.camera {
        let text = String::from_utf8(files::read(path)?)
            .map_err(|_| plain(format!("{}: not text", path.display())))?;
        let camera =
            Camera::from_json(&text).map_err(|e| plain(format!("{}: {e}", path.display())))?;
        program = program.camera(camera);
    }
    Ok(program)
}

/// Binds the files of `--observe`, `--keypoints` and `--observe-contours`. Returns the
/// name and the value of the photograph, if one is among them.
pub fn observe(
    mut program: Program,
    job: &Job,
) -> Result<(Program, Option<(String, Value)>), Failure> {
    let mut image: Option<(String, Value)> = None;
    let mut stem: Option<String> = None;
    let mut detected: Vec<(String, String)> = Vec::new();
    for spec in &job.observe {
        let (name, path) = named(&program, spec)?;
        let kind =
            program.interface().data.iter().find(|d| d.name == name).and_then(|d| d.ty.clone());
        match kind.as_deref() {
            Some("image") => {
                let photo = Value::object(ImageValue::photo(files::photo(Path::new(&path))?));
                program = program.observe(&name, photo.clone());
                stem = Path::new(&path).file_stem().and_then(|s| s.to_str()).map(str::to_owned);
                image = Some((name, photo));
            }
            // The entry of the file may depend on the photograph, which may come later.
            Some("keypoints") => detected.push((name, path)),
            other => {
                program = match entry(&path) {
                    Some((file, id)) => {
                        let value = part(other.unwrap_or("json"), &path, file, id)?;
                        program.observe(&name, value)
                    }
                    None => program.observe_file(&name, &path)?,
                }
            }
        }
    }
    if let Some(path) = &job.keypoints {
        detected.push((only(&program, "keypoints", "--keypoints")?, path.clone()));
    }
    for (name, path) in detected {
        let bytes = files::read(Path::new(standard::table().path_of("keypoints", &path)))?;
        let found = scene::data::load_keypoints(&path, &bytes, stem.as_deref());
        program = program.observe(&name, found.map_err(|f| Failure::Plain(f.message, f.hint))?);
    }
    if let Some(path) = &job.observe_contours {
        let map = ContourMap::from_photo(&files::photo(path)?);
        let name = match &image {
            Some((name, _)) => name.clone(),
            None => only(&program, "image", "--observe")?,
        };
        let photo =
            image.as_ref().and_then(|(_, i)| i.downcast::<ImageValue>()?.as_photo().cloned());
        let contours = Value::object(ImageValue::contours(map, photo));
        program = program.observe(&name, contours.clone());
        image = image.map(|(name, _)| (name, contours));
    }
    Ok((program, image))
}

/// Splits `FILE#ID` into file and entry. If a file with the whole name exists, it is
/// meant.
fn entry(path: &str) -> Option<(&str, &str)> {
    path.rsplit_once('#')
        .filter(|(file, id)| !file.is_empty() && !id.is_empty() && !Path::new(path).exists())
}

/// Returns the file of `[NAME=]FILE[#ID]`.
pub fn file_of(spec: &str) -> &str {
    let path = match spec.split_once('=') {
        Some((name, path)) if is_name(name) => path,
        _ => spec,
    };
    entry(path).map_or(path, |(file, _)| file)
}

/// Loads one entry of a JSON object as data of a kind.
fn part(kind: &str, called: &str, file: &str, id: &str) -> Result<Value, Failure> {
    let all: serde_json::Value = serde_json::from_slice(&files::read(Path::new(file))?)
        .map_err(|e| plain(format!("{file}: {e}")))?;
    let found = all.get(id).ok_or_else(|| plain(format!("{file}: no entry {id:?}")))?;
    let alone = |other: &str| {
        Err(format!(
            "{called} refers to {other}, but an entry of a JSON file cannot refer to other files"
        ))
    };
    standard::table()
        .load(kind, called, found.to_string().as_bytes(), &Options::default(), &alone)
        .map_err(|e| Failure::Plain(e.message, e.hint))
}

/// Returns whether a text can be the name of a `data` item.
fn is_name(text: &str) -> bool {
    !text.is_empty() && text.chars().all(|c| c.is_alphanumeric() || c == '_' || c == '/')
}

/// Returns the name and path of `NAME=FILE`; the name may be omitted if only one item
/// fits.
fn named(program: &Program, spec: &str) -> Result<(String, String), Failure> {
    if let Some((name, path)) = spec.split_once('=')
        && is_name(name)
    {
        return Ok((name.to_owned(), path.to_owned()));
    }
    let data = program.interface().data;
    let open: Vec<_> = data.iter().filter(|d| !d.has_default).collect();
    if let [one] = open[..] {
        return Ok((one.name.clone(), spec.to_owned()));
    }
    only(program, "image", "--observe").map(|name| (name, spec.to_owned()))
}

/// Returns the only `data` item of a kind, for an option without a name.
fn only(program: &Program, kind: &str, option: &str) -> Result<String, Failure> {
    let data = program.interface().data;
    let fit: Vec<&str> =
        data.iter().filter(|d| d.ty.as_deref() == Some(kind)).map(|d| d.name.as_str()).collect();
    let (one, many) = if kind == "image" { ("image", "images") } else { (kind, kind) };
    match fit[..] {
        [one] => Ok(one.to_owned()),
        [] if data.is_empty() => {
            Err(plain(format!("the program has no `data` items; omit {option}")))
        }
        [] => {
            let names: Vec<&str> = data.iter().map(|d| d.name.as_str()).collect();
            let hint = match kind {
                "keypoints" => "declare one: data points = keypoints();".to_owned(),
                _ => format!("name the item: --observe NAME=FILE, one of {}", names.join(", ")),
            };
            Err(Failure::Plain(format!("the program observes no {one}"), Some(hint)))
        }
        _ => Err(Failure::Plain(
            format!("the program observes several {many}"),
            Some(format!("name the item: --observe NAME=FILE, one of {}", fit.join(", "))),
        )),
    }
}
