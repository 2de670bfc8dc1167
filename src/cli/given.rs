//! From the command line to a program with its data.

use super::args::{Given, Job};
use super::{Failure, files, plain};
use image::DynamicImage;
use pcadlang::Program;
use pcadlang::lang::builtins::data;
use pcadlang::lang::builtins::scene::ImageValue;
use pcadlang::lang::value::Value;
use pcadlang::render::Camera;
use pcadlang::vision::{ContourMap, Limits, Photo, photo};
use std::path::Path;

/// Opens the program, with its parameters and camera.
pub fn program(given: &Given, quiet: bool) -> Result<Program, Failure> {
    let mut program = Program::open(&given.program)?;
    if !quiet {
        for path in program.embedded().iter().filter(|p| p.ends_with(".pcad") && !p.starts_with("std/")) {
            eprintln!("note: using the shipped {path}");
        }
    }
    for (name, value) in &given.sets {
        program = program.set(name, value);
    }
    if let Some(path) = &given.camera {
        let text = String::from_utf8(files::read(path)?).map_err(|_| plain(format!("{}: not text", path.display())))?;
        let camera = Camera::from_json(&text).map_err(|e| plain(format!("{}: {e}", path.display())))?;
        program = program.camera(camera);
    }
    Ok(program)
}

/// Binds the files of `--observe` and `--observe-contours`; gives the photograph among them.
pub fn observe(mut program: Program, job: &Job) -> Result<(Program, Option<Photo>), Failure> {
    let mut image: Option<(String, Photo)> = None;
    for spec in &job.observe {
        let (name, path) = named(&program, spec)?;
        let kind = program.interface().data.iter().find(|d| d.name == name).and_then(|d| d.ty.clone());
        if kind.as_deref() == Some("image") {
            let photo = decode(Path::new(&path))?;
            program = program.observe(&name, Value::object(ImageValue::photo(photo.clone())));
            image = Some((name, photo));
        } else {
            program = match entry(&path) {
                Some((file, id)) => {
                    let bytes = part(file, id)?;
                    let value = data::load(kind.as_deref().unwrap_or("json"), &path, &bytes);
                    program.observe(&name, value.map_err(|e| Failure::Plain(e.message, e.hint))?)
                }
                None => program.observe_file(&name, &path)?,
            };
        }
    }
    if let Some(path) = &job.observe_contours {
        let map = ContourMap::from_image(&DynamicImage::from(decode(path)?.rgb().clone()).to_luma8());
        let name = match &image {
            Some((name, _)) => name.clone(),
            None => only_image(&program)?,
        };
        let photo = image.as_ref().map(|(_, p)| p.clone());
        program = program.observe(&name, Value::object(ImageValue::contours(map, photo)));
    }
    Ok((program, image.map(|(_, p)| p)))
}

/// The file and entry of `FILE#ID`; a file that is called so is a file.
fn entry(path: &str) -> Option<(&str, &str)> {
    path.rsplit_once('#').filter(|(file, id)| !file.is_empty() && !id.is_empty() && !Path::new(path).exists())
}

/// One entry of a JSON object, as JSON.
fn part(file: &str, id: &str) -> Result<Vec<u8>, Failure> {
    let all: serde_json::Value =
        serde_json::from_slice(&files::read(Path::new(file))?).map_err(|e| plain(format!("{file}: {e}")))?;
    let found = all.get(id).ok_or_else(|| plain(format!("{file}: there is no entry {id:?}")))?;
    Ok(found.to_string().into_bytes())
}

fn decode(path: &Path) -> Result<Photo, Failure> {
    let bytes = files::read(path)?;
    photo::decode(&bytes, &Limits::default()).map_err(|e| plain(format!("{}: {e}", path.display())))
}

/// The name and path of `NAME=FILE`, or the only item that a plain `FILE` can be for.
fn named(program: &Program, spec: &str) -> Result<(String, String), Failure> {
    if let Some((name, path)) = spec.split_once('=')
        && !name.is_empty()
        && name.chars().all(|c| c.is_alphanumeric() || c == '_' || c == '/')
    {
        return Ok((name.to_owned(), path.to_owned()));
    }
    let data = program.interface().data;
    let open: Vec<_> = data.iter().filter(|d| !d.has_default).collect();
    if let [one] = open[..] {
        return Ok((one.name.clone(), spec.to_owned()));
    }
    only_image(program).map(|name| (name, spec.to_owned()))
}

/// The only `data` item that is an image.
fn only_image(program: &Program) -> Result<String, Failure> {
    let data = program.interface().data;
    let images: Vec<&str> = data.iter().filter(|d| d.ty.as_deref() == Some("image")).map(|d| d.name.as_str()).collect();
    match images[..] {
        [one] => Ok(one.to_owned()),
        [] if data.is_empty() => Err(plain("the program observes no data; leave out --observe")),
        [] => {
            let names: Vec<&str> = data.iter().map(|d| d.name.as_str()).collect();
            Err(Failure::Plain(
                "the program observes no image".into(),
                Some(format!("name the item: --observe NAME=FILE, one of {}", names.join(", "))),
            ))
        }
        _ => Err(Failure::Plain(
            "the program observes several images".into(),
            Some(format!("name the item: --observe NAME=FILE, one of {}", images.join(", "))),
        )),
    }
}
