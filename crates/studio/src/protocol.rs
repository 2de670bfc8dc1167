//! The frames that the page and the studio exchange (`docs/reference/studio.md`): requests
//! are parsed, answers are written. Nothing here does what is asked.

use pcadlang_syntax::diag::nearest;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// A request.
#[derive(Debug)]
pub struct Request {
    /// The number that its answer repeats.
    pub id: u64,
    /// The method and its parameters.
    pub call: Call,
}

/// A request that cannot be understood.
#[derive(Debug, PartialEq)]
pub struct Misunderstood {
    /// Its number, if that much could be read.
    pub id: Option<u64>,
    /// The error.
    pub message: String,
    /// A suggestion.
    pub hint: Option<String>,
}

/// One state of a program: that of a session, or one of a run.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct StateName {
    /// The session whose present state it is.
    pub session: Option<u64>,
    /// The run whose state it is: its best one if nothing else is named.
    pub run: Option<String>,
    /// A kept draw, from 0.
    pub draw: Option<usize>,
    /// A state on the way from the prior, from 0.
    pub film: Option<usize>,
    /// The best state of a mode, from 0.
    pub mode: Option<usize>,
}

/// Settings of a run.
#[derive(Clone, Debug, Default, Deserialize, PartialEq)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// The seed.
    pub seed: Option<u64>,
    /// The number of chains.
    pub chains: Option<u32>,
    /// The name of a preset.
    pub quality: Option<String>,
    /// The time limit in seconds.
    pub time: Option<f64>,
    /// Kernel applications per chain.
    pub steps: Option<u64>,
    /// Kernel applications per chain in warm-up.
    pub warmup: Option<u64>,
    /// Values of `param`s, as text.
    pub set: BTreeMap<String, String>,
}

/// A viewpoint.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Viewpoint {
    /// Where the camera is.
    pub eye: [f64; 3],
    /// The point it looks at.
    pub target: [f64; 3],
    /// The upward direction.
    pub up: [f64; 3],
    /// The angle that the picture's height covers, in degrees.
    pub fov_y: f64,
}

/// Declares the methods, with the fields of their parameters.
macro_rules! methods {
    ($($(#[$doc:meta])* $variant:ident = $name:literal { $($(#[$of:meta])* $field:ident: $ty:ty),* $(,)? })*) => {
        $($(#[$doc])*
        #[derive(Debug, Deserialize, PartialEq)]
        #[serde(deny_unknown_fields)]
        pub struct $variant { $($(#[$of])* pub $field: $ty),* })*

        /// The method and its parameters.
        #[derive(Debug, PartialEq)]
        #[allow(missing_docs)]
        pub enum Call { $($variant($variant)),* }

        impl Call {
            /// The names of all methods.
            pub const NAMES: &[&str] = &[$($name),*];

            /// Reads the parameters of a method; `None` if there is no such method.
            fn read(method: &str, params: Value) -> Option<Result<Call, String>> {
                match method {
                    $($name => Some(read(params).map(Call::$variant)),)*
                    _ => None,
                }
            }
        }
    };
}

methods! {
    /// The contents of the opened folder.
    Folder = "folder" {}
    /// The text of a program.
    Read = "read" { file: String }
    /// Writes a program.
    Write = "write" { file: String, text: String }
    /// Stores a photograph that comes with the program.
    Example = "example" { picture: String }
    /// The cases of an evaluation.
    Evaluation = "evaluation" { folder: String }

    /// Opens a session.
    Open = "open" {
        program: Option<String>,
        run: Option<String>,
        /// The photograph at hand, which is observed if the program takes one.
        photo: Option<String>,
        #[serde(default)] observe: Vec<String>,
        #[serde(default)] set: BTreeMap<String, String>,
    }
    /// Describes a session.
    Describe = "session" { session: u64 }
    /// Closes a session.
    Close = "close" { session: u64 }
    /// Replaces the text of a session's program.
    Replace = "replace" {
        session: u64,
        text: String,
        /// The photograph at hand, which is observed if the new text takes one.
        photo: Option<String>,
    }
    /// Opens a session again with other data.
    Observe = "observe" { session: u64, observe: Vec<String> }
    /// Says where the object is in a session's photograph.
    Hint = "hint" { session: u64, hint: HintJson }
    /// The place that a hint points out in a session's photograph, which stays as it is.
    Guess = "guess" { session: u64, hint: HintJson, #[serde(default)] quick: bool }
    /// An entry of the prompt.
    Enter = "enter" { session: u64, text: String }
    /// Stops what a session is doing.
    Interrupt = "interrupt" { session: u64 }
    /// The choices of a state.
    Choices = "choices" {
        state: StateName,
        select: Option<String>,
        #[serde(default)] from: usize,
        count: Option<usize>,
    }
    /// Gives a value to a choice.
    Assign = "assign" {
        session: u64,
        address: String,
        value: Value,
        #[serde(default)] drag: bool,
    }
    /// The landmarks of a session's scene in its picture.
    JointsOf = "joints" { session: u64 }
    /// Pulls a landmark elsewhere; the choices that move it follow.
    Pull = "pull" {
        session: u64,
        joint: String,
        at: [f64; 2],
        #[serde(default)] drag: bool,
    }
    /// The dependencies of a choice, in both directions.
    Why = "why" { session: u64, address: String }
    /// Completes a word at the prompt.
    Complete = "complete" { session: u64, text: String, at: usize }

    /// Begins a run.
    Begin = "run" { session: u64, #[serde(default)] settings: Settings }
    /// Pauses a run.
    Pause = "pause" { run: String }
    /// Goes on with a paused, stopped or interrupted run.
    GoOn = "go_on" { run: String }
    /// Ends a run; it can go on later.
    Stop = "stop" { run: String }
    /// All runs of the folder.
    Runs = "runs" {}
    /// Forgets a run that has ended.
    Remove = "remove" { run: String }
    /// The kept states of a run.
    Kept = "draws" { run: String }
    /// The summary of a run.
    Summary = "summary" { run: String }
    /// Draws of quantities.
    Quantity = "quantity" { run: String, names: Vec<String> }
    /// Two runs side by side.
    Compare = "compare" { a: String, b: String }
    /// Writes a file that shows a run.
    Export = "export" { run: String, kind: String }

    /// A picture of a state.
    Picture = "picture" {
        state: StateName,
        layer: String,
        size: u32,
        camera: Option<Viewpoint>,
    }
    /// The mesh of a state.
    Mesh = "mesh" { state: StateName, limit: Option<usize> }
    /// The camera of a state.
    CameraOf = "camera" { state: StateName }
}

fn read<T: DeserializeOwned>(params: Value) -> Result<T, String> {
    serde_json::from_value(params).map_err(|e| e.to_string())
}

impl Request {
    /// Reads a text frame.
    pub fn read(text: &str) -> Result<Request, Misunderstood> {
        let not = |id: Option<u64>, message: String, hint: Option<String>| {
            Err(Misunderstood { id, message, hint })
        };
        let mut fields: Map<String, Value> = match serde_json::from_str(text) {
            Ok(Value::Object(fields)) => fields,
            Ok(_) => return not(None, "a request is a JSON object".into(), None),
            Err(e) => return not(None, format!("the request is not JSON: {e}"), None),
        };
        let id = fields.get("id").and_then(Value::as_u64);
        let Some(number) = id else {
            return not(None, "a request needs an `id`: a whole number".into(), None);
        };
        let Some(method) = fields.get("method").and_then(Value::as_str).map(str::to_owned) else {
            return not(id, "a request needs a `method`".into(), None);
        };
        let params = match fields.remove("params") {
            None | Some(Value::Null) => json!({}),
            Some(params) => params,
        };
        match Call::read(&method, params) {
            Some(Ok(call)) => Ok(Request { id: number, call }),
            Some(Err(e)) => not(id, format!("`{method}`: {e}"), None),
            None => {
                let near = nearest(&method, Call::NAMES.iter().copied());
                let hint = near.map(|n| format!("did you mean `{n}`?"));
                not(id, format!("there is no method `{method}`"), hint)
            }
        }
    }
}

/// Returns the text frame of an answer.
pub fn result(id: u64, result: &Value) -> String {
    json!({ "id": id, "result": result }).to_string()
}

/// Returns the text frame of an error; without the number of its request if that could not
/// be read.
pub fn error(id: Option<u64>, message: &str, hint: Option<&str>, diagnostics: Value) -> String {
    let error = json!({ "message": message, "hint": hint, "diagnostics": diagnostics });
    json!({ "id": id, "error": error }).to_string()
}

/// Returns a binary frame: the length of its header, the header, the data.
pub fn binary(id: u64, mut header: Map<String, Value>, data: &[u8]) -> Vec<u8> {
    header.insert("id".to_owned(), json!(id));
    let header = Value::Object(header).to_string();
    let mut frame = Vec::with_capacity(4 + header.len() + data.len());
    frame.extend_from_slice(&(header.len() as u32).to_le_bytes());
    frame.extend_from_slice(header.as_bytes());
    frame.extend_from_slice(data);
    frame
}

/// Where the object is in the photograph, pixels; everything is optional.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct HintJson {
    /// The file of a mask, in the opened folder.
    pub mask: Option<PathBuf>,
    /// The corners of an outline.
    pub outline: Vec<[f64; 2]>,
    /// Left, top, width and height.
    #[serde(rename = "box")]
    pub bounds: Option<[f64; 4]>,
    /// The object's axis.
    pub axis: Option<AxisJson>,
    /// Positions on the object.
    pub at: Vec<[f64; 2]>,
    /// Positions beside it.
    pub not: Vec<[f64; 2]>,
}

/// An axis, pixels.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct AxisJson {
    /// The end on which the object stands.
    pub foot: [f64; 2],
    /// The other end.
    pub top: [f64; 2],
    /// The width across it.
    pub width: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_are_read() {
        let r = Request::read(r#"{"id": 3, "method": "folder"}"#).unwrap();
        assert_eq!((r.id, r.call), (3, Call::Folder(Folder {})));
        let text = r#"{"id": 4, "method": "picture", "params": {"state": {"run": "runs/a", "draw": 2}, "layer": "depth", "size": 128}}"#;
        let Call::Picture(p) = Request::read(text).unwrap().call else { panic!() };
        assert_eq!((p.state.run.as_deref(), p.state.draw, p.size), (Some("runs/a"), Some(2), 128));
        let text =
            r#"{"id": 5, "method": "run", "params": {"session": 1, "settings": {"time": 2.5}}}"#;
        let Call::Begin(b) = Request::read(text).unwrap().call else { panic!() };
        assert_eq!((b.settings.time, b.settings.chains), (Some(2.5), None));
    }

    #[test]
    fn what_is_not_understood_is_named() {
        let wrong = |text: &str| Request::read(text).unwrap_err();
        assert_eq!(wrong("{").id, None);
        assert!(wrong("[]").message.contains("JSON object"));
        assert!(wrong("{}").message.contains("`id`"));
        assert!(wrong(r#"{"id": -1, "method": "runs"}"#).message.contains("`id`"));
        assert!(wrong(r#"{"id": 1}"#).message.contains("`method`"));
        let near = wrong(r#"{"id": 1, "method": "pictures"}"#);
        assert_eq!((near.id, near.hint.as_deref()), (Some(1), Some("did you mean `picture`?")));
        for params in ["[]", "7", r#"{"run": 1}"#, r#"{"run": "a", "more": 1}"#, "{}"] {
            let said = wrong(&format!(r#"{{"id": 1, "method": "stop", "params": {params}}}"#));
            assert!(said.message.starts_with("`stop`: "), "{said:?}");
        }
    }

    #[test]
    fn a_binary_frame_begins_with_the_length_of_its_header() {
        let frame = binary(9, Map::new(), &[1, 2, 3]);
        let length = u32::from_le_bytes([frame[0], frame[1], frame[2], frame[3]]) as usize;
        let header: Value = serde_json::from_slice(&frame[4..4 + length]).unwrap();
        assert_eq!((header["id"].as_u64(), &frame[4 + length..]), (Some(9), &[1, 2, 3][..]));
    }
}
