//! Tables of joints: DeepLabCut's CSV, with three or four lines of names, and SLEAP's, with columns
//! `NODE.x` and `NODE.y`. A row is a frame, or a person in a frame.

use super::joint_lists::known;
use super::joints::listed;
use super::names::usual;
use super::people::{Person, number};
use super::{Keypoints, KeypointsError};
use csv::StringRecord;

/// The maximum number of fields of a table, and of those of a line.
const MOST: usize = 10_000_000;
const MOST_COLUMNS: usize = 10_000;

/// The rows of DeepLabCut's head, by their first fields.
const HEAD: [&str; 4] = ["scorer", "individuals", "bodyparts", "coords"];

/// Columns with a frame's number or picture, in SLEAP's tables.
const FRAMES: [&str; 2] = ["frame_idx", "frame"];

/// A joint of a person: its columns.
struct Joint {
    name: String,
    x: usize,
    y: usize,
    confidence: Option<usize>,
}

/// A person in each row.
struct Body {
    name: String,
    joints: Vec<Joint>,
}

/// What the columns of a table are.
struct Columns {
    bodies: Vec<Body>,
    /// The columns that name the frame: the parts of a path.
    frame: Vec<usize>,
    /// The column with the person's name.
    track: Option<usize>,
}

/// Whether a text begins like a table.
pub(super) fn is_table(text: &str) -> bool {
    let first = text.lines().next().unwrap_or_default();
    !first.trim_start().starts_with(['{', '[']) && first.contains(',')
}

/// Reads the people of all frames; a person's id is the frame's, with `:` and the person's name if
/// there are several.
pub(super) fn people(text: &str) -> Result<Vec<Person>, KeypointsError> {
    let mut reader =
        csv::ReaderBuilder::new().has_headers(false).flexible(true).from_reader(text.as_bytes());
    let mut records = Vec::new();
    let mut fields = 0;
    for record in reader.records() {
        let record = record.map_err(|e| KeypointsError::new(e.to_string()))?;
        fields += record.len();
        if fields > MOST || record.len() > MOST_COLUMNS {
            return Err(KeypointsError::new(format!(
                "it has more than {MOST} fields, or {MOST_COLUMNS} in a line"
            )));
        }
        records.push(record);
    }
    let head = records.iter().take_while(|r| HEAD.contains(&cell(r, 0))).count();
    let (columns, rows) = match head {
        0 => (sleap(&records)?, records.get(1..)),
        _ => (deeplabcut(records.get(..head).unwrap_or_default())?, records.get(head..)),
    };
    let mut all = Vec::new();
    for record in rows.unwrap_or_default() {
        read(record, &columns, &mut all)?;
    }
    number(&mut all);
    Ok(all)
}

fn cell(record: &StringRecord, at: usize) -> &str {
    record.get(at).unwrap_or_default().trim()
}

/// Adds the people of a row, or nobody, to the people.
fn read(
    record: &StringRecord,
    columns: &Columns,
    all: &mut Vec<Person>,
) -> Result<(), KeypointsError> {
    let path: Vec<&str> =
        columns.frame.iter().map(|at| cell(record, *at)).filter(|part| !part.is_empty()).collect();
    let frame = path.join("/");
    // A line with nothing but a name is that of the index, not a frame.
    let others = (0..record.len()).filter(|at| !columns.frame.contains(at));
    if !frame.contains(|c: char| c.is_ascii_digit())
        && others.into_iter().all(|at| cell(record, at).is_empty())
    {
        return Ok(());
    }
    let track = columns.track.map(|at| cell(record, at)).unwrap_or_default();
    let before = all.len();
    for body in &columns.bodies {
        let keypoints = joints(record, body)?;
        if !keypoints.is_empty() {
            let within = if track.is_empty() { body.name.clone() } else { track.to_owned() };
            all.push(Person { within, keypoints, ..Person::default() }.of_picture(&frame));
        }
    }
    if all.len() == before {
        all.push(Person::default().of_picture(&frame));
    }
    Ok(())
}

/// Reads a person; joints without a position are missing, a position without a confidence is sure.
fn joints(record: &StringRecord, body: &Body) -> Result<Keypoints, KeypointsError> {
    let number = |at: usize| match cell(record, at) {
        text if text.is_empty() || text.eq_ignore_ascii_case("nan") => Ok(f64::NAN),
        text => text.parse::<f64>().map_err(|_| {
            let line = record.position().map_or(0, |p| p.line());
            let message = format!("line {line}, column {}: `{text}` must be a number", at + 1);
            KeypointsError::new(message)
        }),
    };
    let mut names = Vec::new();
    let mut points = Vec::new();
    for joint in &body.joints {
        let (x, y) = (number(joint.x)?, number(joint.y)?);
        let c = joint.confidence.map(number).transpose()?.filter(|c| !c.is_nan()).unwrap_or(1.0);
        if !x.is_nan() && !y.is_nan() {
            names.push(joint.name.clone());
            points.push([x, y, c]);
        }
    }
    listed(names, &points)
}

/// Adds a column to its joint.
fn add(bodies: &mut Vec<Body>, person: &str, joint: &str, what: &str, at: usize) {
    let found = bodies.iter().rposition(|b| b.name == person);
    let index = found.unwrap_or_else(|| {
        bodies.push(Body { name: person.to_owned(), joints: Vec::new() });
        bodies.len() - 1
    });
    let Some(Body { joints, .. }) = bodies.get_mut(index) else { return };
    let name = usual(joint);
    let index = joints.iter().rposition(|j| j.name == name).unwrap_or_else(|| {
        // Columns that are never found are empty, and so is the joint.
        let none = usize::MAX;
        joints.push(Joint { name: name.into_owned(), x: none, y: none, confidence: None });
        joints.len() - 1
    });
    let Some(joint) = joints.get_mut(index) else { return };
    match what {
        "x" => joint.x = at,
        "y" => joint.y = at,
        _ => joint.confidence = Some(at),
    }
}

/// Reads the lines of names of DeepLabCut: scorer, individuals (if there are several), bodyparts,
/// coords.
fn deeplabcut(head: &[StringRecord]) -> Result<Columns, KeypointsError> {
    let line = |name: &str| head.iter().find(|r| cell(r, 0) == name);
    let (Some(parts), Some(coords)) = (line("bodyparts"), line("coords")) else {
        let message = "the lines `bodyparts` and `coords` of DeepLabCut are missing";
        return Err(KeypointsError::new(message));
    };
    let individuals = line("individuals");
    let mut bodies = Vec::new();
    let kind = |at: usize| Some(cell(coords, at)).filter(|k| ["x", "y", "likelihood"].contains(k));
    for at in 0..coords.len() {
        if let Some(what) = kind(at) {
            let person = individuals.map(|r| cell(r, at)).unwrap_or_default();
            add(&mut bodies, person, cell(parts, at), what, at);
        }
    }
    if bodies.is_empty() {
        return Err(KeypointsError::new("the line `coords` has neither x nor y"));
    }
    let frame = (0..coords.len()).take_while(|at| kind(*at).is_none()).collect();
    Ok(Columns { bodies, frame, track: None })
}

/// Reads the line of names of SLEAP's analysis CSV; in sleap-io's with a row for a frame, the names
/// begin with `inst0.`, `inst1.`, ….
fn sleap(records: &[StringRecord]) -> Result<Columns, KeypointsError> {
    let first = records.first().cloned().unwrap_or_default();
    let column = |names: &[&str]| first.iter().position(|name| names.contains(&name.trim()));
    let mut bodies = Vec::new();
    for (at, name) in first.iter().enumerate() {
        let Some((joint, what)) = name.trim().rsplit_once('.') else { continue };
        if !["x", "y", "score"].contains(&what) || joint == "instance" {
            continue;
        }
        let numbered = joint.strip_prefix("inst").and_then(|rest| rest.split_once('.'));
        let numbered = numbered.filter(|(n, _)| n.parse::<u32>().is_ok());
        let (person, joint) = numbered.unwrap_or(("", joint));
        add(&mut bodies, person, joint, what, at);
    }
    bodies.retain(|b| b.joints.iter().any(|j| j.x != usize::MAX && j.y != usize::MAX));
    let frame = column(&FRAMES);
    if bodies.is_empty() || frame.is_none() {
        let error = KeypointsError::new(
            "the table is neither DeepLabCut's, with lines `scorer`, `bodyparts` and `coords`, nor \
             SLEAP's, with columns `frame_idx`, `NODE.x` and `NODE.y`",
        );
        return Err(error.hint(format!(
            "joints are named in tables; lists without names are known in JSON: {}",
            known()
        )));
    }
    Ok(Columns { bodies, frame: frame.into_iter().collect(), track: column(&["track"]) })
}
