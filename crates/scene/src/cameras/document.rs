//! JSON or YAML as one kind of tree, and the numbers in it.
//!
//! YAML is read as JSON has it: mappings with text as keys, lists, numbers, texts. Tags are
//! ignored (OpenCV marks matrices by some), references to other parts of a text are refused, since
//! they make large trees of small texts.

use crate::render::CameraError;
use saphyr_parser::{Event, Parser, ScalarStyle};
use serde_json::{Map, Value};

/// The deepest nesting.
const DEEPEST: usize = 64;
/// The largest magnitude of a number.
const LARGEST: f64 = 1e12;

/// Parses a text, JSON if it begins like it, or else YAML.
pub(super) fn parse(text: &str) -> Result<Value, CameraError> {
    let json = |e: serde_json::Error| CameraError::Json(e.to_string());
    match text.trim_start().starts_with(['{', '[']) {
        true => serde_json::from_str(text).map_err(json),
        false => yaml(text),
    }
}

/// Parses the first document of a YAML text.
fn yaml(text: &str) -> Result<Value, CameraError> {
    let wrong = |line: usize, column: usize, why: &str| {
        CameraError::other(format!(
            "line {line}, column {column}: neither JSON nor YAML of a camera: {why}"
        ))
    };
    // OpenCV before version 5 begins files with `%YAML:1.0`, which YAML does not allow.
    let text = match text.strip_prefix("%YAML:") {
        Some(rest) => rest.split_once('\n').map_or("", |(_, rest)| rest),
        None => text,
    };
    // Of each open list or mapping, what it has so far, and the key that waits for its value.
    let mut open: Vec<(Value, Option<String>)> = Vec::new();
    for event in Parser::new_from_str(text) {
        let (event, span) =
            event.map_err(|e| wrong(e.marker().line(), e.marker().col() + 1, e.info()))?;
        let fail = |why: &str| wrong(span.start.line(), span.start.col() + 1, why);
        let mut value = match event {
            Event::Scalar(text, style, ..) => scalar(&text, style),
            Event::SequenceStart(..) | Event::MappingStart(..) => {
                if open.len() >= DEEPEST {
                    return Err(fail("it is nested too deep"));
                }
                let list = matches!(event, Event::SequenceStart(..));
                let new = if list { Value::Array(Vec::new()) } else { Value::Object(Map::new()) };
                open.push((new, None));
                continue;
            }
            Event::SequenceEnd | Event::MappingEnd => {
                let Some((done, _)) = open.pop() else {
                    return Err(fail("an end without a start"));
                };
                done
            }
            Event::Alias(_) => return Err(fail("references (*name) are not read")),
            Event::DocumentEnd => break,
            _ => continue,
        };
        let Some((within, key)) = open.last_mut() else { return Ok(value) };
        match within {
            Value::Array(all) => all.push(value),
            Value::Object(map) => match (key.take(), &mut value) {
                (Some(key), value) => {
                    map.insert(key, value.take());
                }
                (None, Value::String(text)) => *key = Some(std::mem::take(text)),
                (None, Value::Number(n)) => *key = Some(n.to_string()),
                (None, _) => return Err(fail("a key that is not a text")),
            },
            _ => return Err(fail("a value in a value")),
        }
    }
    Err(wrong(1, 1, "it is empty"))
}

fn scalar(text: &str, style: ScalarStyle) -> Value {
    if style != ScalarStyle::Plain {
        return Value::from(text);
    }
    match text {
        "" | "~" | "null" => Value::Null,
        "true" => true.into(),
        "false" => false.into(),
        _ if text.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c)) => {
            match (text.parse::<u64>(), text.parse::<f64>()) {
                (Ok(n), _) => n.into(),
                (_, Ok(x)) if x.is_finite() => x.into(),
                _ => text.into(),
            }
        }
        _ => text.into(),
    }
}

/// The number of a value; `None` if it is too large to be used.
pub(super) fn number(value: &Value) -> Option<f64> {
    value.as_f64().filter(|x| x.abs() <= LARGEST)
}

/// All numbers of a list, of a list of lists, or of OpenCV's `{rows, cols, dt, data}`, row by row.
pub(super) fn numbers(value: &Value) -> Option<Vec<f64>> {
    match value {
        Value::Array(all) if all.iter().any(Value::is_array) => {
            Some(all.iter().map(numbers).collect::<Option<Vec<_>>>()?.concat())
        }
        Value::Array(all) => all.iter().map(number).collect(),
        Value::Object(map) => numbers(map.get("data")?),
        _ => None,
    }
}

/// As [`numbers`], exactly `N`.
pub(super) fn array<const N: usize>(value: &Value) -> Option<[f64; N]> {
    numbers(value)?.try_into().ok()
}

/// Width and height, whole pixels.
pub(super) fn size(width: f64, height: f64) -> Option<(u32, u32)> {
    let side = |x: f64| ((1.0..=16384.0).contains(&x) && x.fract() == 0.0).then_some(x as u32);
    side(width).zip(side(height))
}

/// A key without capitals and marks between words.
pub(super) fn bare(key: &str) -> String {
    key.chars().filter(|c| c.is_ascii_alphanumeric()).map(|c| c.to_ascii_lowercase()).collect()
}

/// The value of the first of these keys (as [`bare`] writes them) that is there and not null.
pub(super) fn get<'a>(map: &'a Map<String, Value>, keys: &[&str]) -> Option<&'a Value> {
    keys.iter()
        .find_map(|k| map.iter().find(|(key, v)| bare(key) == *k && !v.is_null()))
        .map(|(_, v)| v)
}
