//! Ultralytics' label text: a line per person, `class x y width height`, then two or three numbers
//! per joint, then the person's confidence and track, if they were asked for.

use super::KeypointsError;
use super::joint_lists::LISTS;
use super::joints::{listed, names_of};
use super::people::{Person, number};

/// The largest fraction of a picture's side, of a joint beside the picture.
const MOST: f64 = 2.0;

/// The numbers of a line before its joints: class and box.
const BEFORE: usize = 5;

/// Whether a text begins with a line of several numbers apart.
pub(super) fn is_labels(text: &str) -> bool {
    let first = text.lines().find(|line| !line.trim().is_empty()).unwrap_or_default();
    let mut words = first.split_whitespace();
    words.clone().count() > 1 && words.all(|w| w.parse::<f64>().is_ok())
}

/// Reads the people of a picture. The third number of a joint is a confidence in what `predict`
/// saves and 0, 1 or 2 in a data set, where 0 is a joint that is missing.
pub(super) fn people(text: &str) -> Result<Vec<Person>, KeypointsError> {
    let mut people = Vec::new();
    for (i, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let place = format!("line {}", i + 1);
        let numbers = line.split_whitespace().map(|word| {
            word.parse::<f64>()
                .ok()
                .filter(|x| x.is_finite())
                .ok_or_else(|| KeypointsError::new(format!("{place}: `{word}` must be a number")))
        });
        let numbers: Vec<f64> = numbers.collect::<Result<_, _>>()?;
        let joints = numbers.get(BEFORE..).unwrap_or_default();
        let (count, each) = form(joints.len()).ok_or_else(|| unknown(&place, numbers.len()))?;
        let joint = |j: &[f64]| match *j {
            [x, y] => Some([x, y, 1.0]),
            [x, y, c] => Some([x, y, c]),
            _ => None,
        };
        let joints: Vec<[f64; 3]> =
            joints.chunks_exact(each).take(count).filter_map(joint).collect();
        if let Some([x, y, _]) = joints.iter().find(|[x, y, _]| x.max(*y) > MOST) {
            let message = format!(
                "{place} has a joint at {x}, {y}; fractions of the picture's sides are expected"
            );
            return Err(KeypointsError::new(message));
        }
        let keypoints = listed(names_of(count, None, &place)?, &joints)?.into_normalised();
        people.push(Person { keypoints, ..Person::default() });
    }
    if people.len() > 1 {
        number(&mut people);
    }
    Ok(people)
}

/// Returns the number of joints, and of numbers for each, of a line with this many numbers after
/// the box. COCO's joints may be followed by one or two others.
fn form(numbers: usize) -> Option<(usize, usize)> {
    let after = |each: usize| (0..=2).any(|more| numbers == 17 * each + more).then_some((17, each));
    let exact = |each: usize| {
        let list = LISTS.iter().find(|l| l.len() * each == numbers)?;
        Some((list.len(), each))
    };
    after(3).or_else(|| after(2)).or_else(|| exact(3)).or_else(|| exact(2))
}

fn unknown(place: &str, numbers: usize) -> KeypointsError {
    let message = format!(
        "{place} has {numbers} numbers; expected `class x y width height` and two or three numbers \
         for each joint"
    );
    let hint =
        format!("joints have no names here: known are lists of {}", super::joint_lists::known());
    KeypointsError::new(message).hint(hint)
}
