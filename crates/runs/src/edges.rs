//! `--edges`: a contour detector that replaces the built-in one.

use super::failure::Failure;
use crate::files;
use pcadlang_engine::lang::builtins::data::Options;
use pcadlang_library::scene::DetectorValue;
use pcadlang_library::standard;
use pcadlang_syntax::ast::{ExprKind, ItemKind};
use pcadlang_syntax::parse;
use pcadlang_syntax::span::FileId;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// The detector that was read last, with its argument, so that a command that runs a
/// program many times reads it once.
static LAST: Mutex<Option<(String, DetectorValue)>> = Mutex::new(None);

/// Splits `FILE[, OPTION = VALUE, …]` into the file and the options. If a file with the
/// whole name exists, it is meant.
fn split(spec: &str) -> (&str, &str) {
    match spec.split_once(',') {
        Some((file, options)) if !Path::new(spec).exists() => (file.trim(), options.trim()),
        _ => (spec, ""),
    }
}

/// Returns the file of `FILE[, OPTION = VALUE, …]`.
pub fn file_of(spec: &str) -> &Path {
    Path::new(split(spec).0)
}

/// Loads the detector of `FILE[, OPTION = VALUE, …]`; the options are those of `detector`
/// in a program.
pub fn detector(spec: &str) -> Result<DetectorValue, Failure> {
    let mut last = LAST.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, known)) = last.as_ref().filter(|(s, _)| s == spec) {
        return Ok(known.clone());
    }
    let (file, text) = split(spec);
    let options = options(text)?;
    let bytes = files::read(Path::new(file))?;
    let alone = |other: &str| {
        Err(format!("{file} refers to {other}, but a detector must be a single file"))
    };
    let loaded = standard::table().load("detector", file, &bytes, &options, &alone);
    let loaded = loaded.map_err(|f| Failure::Plain(f.message, f.hint))?;
    let detector = loaded.downcast::<DetectorValue>().cloned().unwrap_or_default();
    *last = Some((spec.to_owned(), detector.clone()));
    Ok(detector)
}

/// Parses options such as `colours = "bgr", white = 255` as the arguments of a call.
fn options(text: &str) -> Result<Options, Failure> {
    if text.is_empty() {
        return Ok(Options::default());
    }
    let wrong = |why: &str, hint: Option<String>| {
        let hint = hint.or_else(|| {
            Some("for example --edges 'network.onnx, colours = \"bgr\", white = 255'".into())
        });
        Failure::Plain(format!("--edges: {why} (`{text}`)"), hint)
    };
    let (program, errors) = parse(&format!("data d = detector({text});"), FileId(0));
    let args = match program.items.first().map(|i| &i.kind) {
        Some(ItemKind::Data(d)) if errors.is_empty() && program.items.len() == 1 => {
            match d.default.as_ref().map(|e| &e.kind) {
                Some(ExprKind::Call { args, .. }) => Some(args),
                _ => None,
            }
        }
        _ => None,
    };
    let args =
        args.ok_or_else(|| wrong("expected the options of a detector after the file name", None))?;
    standard::table().options("detector", args).map_err(|(_, f)| wrong(&f.message, f.hint))
}

/// Returns what contours depend on besides the picture: the bytes of the file, and the
/// options.
pub fn bytes(spec: Option<&str>) -> Result<Vec<u8>, Failure> {
    let Some(spec) = spec else { return Ok(Vec::new()) };
    let mut all = files::read(file_of(spec))?;
    all.extend(split(spec).1.as_bytes());
    Ok(all)
}
