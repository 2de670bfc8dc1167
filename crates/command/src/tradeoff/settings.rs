//! The settings to try, and their programs.

use crate::args::{Inputs, Tradeoff};
use pcadlang_library::shipped;
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_runs::inputs;
use pcadlang_workbench::tradeoff::{Plan, Setting};
use serde_json::{Map, Value, json};
use std::path::Path;

/// The settings of all files.
#[derive(Default)]
pub struct Settings {
    /// All settings, without duplicates.
    pub all: Vec<Setting>,
    /// The settings that may become presets.
    pub candidates: Vec<Setting>,
}

/// Reads the settings.
pub fn read(a: &Tradeoff) -> Result<Settings, Failure> {
    let mut settings = Settings::default();
    for (file, text) in files(a)? {
        let read = Plan::from_json(&text).and_then(|p| Ok((p.settings()?, p.compare)));
        let (all, compare) = read.map_err(|e| plain(format!("{file}: {e}")))?;
        for setting in all {
            // A setting with a program cannot be a preset, since `run` is given its
            // program.
            if !compare && setting.program.is_none() && !settings.candidates.contains(&setting) {
                settings.candidates.push(setting.clone());
            }
            if !settings.all.contains(&setting) {
                settings.all.push(setting);
            }
        }
    }
    match settings.all.is_empty() {
        true => Err(plain("there are no settings to try: a list of `cross` is empty")),
        false => Ok(settings),
    }
}

/// Returns the hashes of the programs by name, after compiling each with its settings.
pub fn programs(a: &Tradeoff, settings: &[Setting]) -> Result<Map<String, Value>, Failure> {
    let mut hashes = Map::new();
    for setting in settings {
        let name = setting.program.as_deref().unwrap_or(&a.inputs.program);
        let inputs = Inputs { program: name.to_owned(), sets: Vec::new(), ..a.inputs.clone() };
        let mut other = inputs::without_camera(&inputs, true)?;
        hashes.insert(name.to_owned(), json!(other.hash()));
        for (param, value) in a.inputs.sets.iter().cloned().chain(setting.set.clone()) {
            other = other.set(&param, &value);
        }
        other.without_data().compile()?;
    }
    Ok(hashes)
}

/// Returns the names and texts of the settings files: those given, or else the program's
/// own, `NAME.settings.json`.
fn files(a: &Tradeoff) -> Result<Vec<(String, String)>, Failure> {
    let named = a.settings.iter().map(|path| {
        let text = String::from_utf8(pcadlang_runs::files::read(path)?)
            .map_err(|_| plain(format!("{}: not text", path.display())))?;
        Ok((path.display().to_string(), text))
    });
    if named.len() > 0 {
        return named.collect();
    }
    let name = Path::new(&a.inputs.program).with_extension("settings.json").display().to_string();
    match std::fs::read_to_string(&name).ok().or_else(|| shipped::file(&name).map(str::to_owned)) {
        Some(text) => Ok(vec![(name, text)]),
        None => Err(Failure::Plain(
            format!("{name} does not exist, so there are no settings to try"),
            Some(
                r#"write one and give it with --settings: {"cross": {"time": [1, 3]}, "vary": {"chains": [1, 2]}}"#
                    .into(),
            ),
        )),
    }
}
