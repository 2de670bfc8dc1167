//! The people in a file, and the choice of one of them.

use super::node::first;
use super::{Keypoints, KeypointsError};
use rustc_hash::FxHashMap;
use std::path::Path;

/// The people of a file, in the order of the file.
#[derive(Clone, Debug, Default)]
pub struct People {
    pub(super) all: Vec<Person>,
}

/// A person of a file.
#[derive(Clone, Debug, Default)]
pub(super) struct Person {
    /// The person's id; empty if the file has a single person.
    pub id: String,
    /// The name among the people of the same image, if the file has one for them.
    pub within: String,
    /// Ids that people in the same image share: the image's number or name, and file name.
    pub image: Vec<String>,
    /// Those of `image` that are names of the picture's file, with and without the extension.
    pub files: Vec<String>,
    /// True if the image has no id but its place in the file.
    pub counted: bool,
    pub keypoints: Keypoints,
}

impl Person {
    /// Adds an id of the picture, and if it is a path, the names of the file with and without its
    /// extension.
    pub fn of_picture(mut self, id: &str) -> Person {
        if id.is_empty() {
            return self;
        }
        self.image.push(id.to_owned());
        let names = file_names(id);
        for name in names {
            if !self.image.iter().any(|i| i == name) {
                self.image.push(name.to_owned());
            }
        }
        if names != [id, id] {
            self.files.extend(names.map(str::to_owned));
        }
        self
    }
}

/// Returns the name of the file at the end of a path, with and without its extension.
pub(super) fn file_names(path: &str) -> [&str; 2] {
    let file = path.rsplit(['/', '\\']).next().unwrap_or(path);
    [file, Path::new(file).file_stem().and_then(|s| s.to_str()).unwrap_or(file)]
}

/// Gives people without an id that of the image, with `:` and the name or number of the person if
/// it shows several people.
pub(super) fn number(people: &mut [Person]) {
    let image = |p: &Person| p.image.first().cloned().unwrap_or_default();
    let mut count: FxHashMap<String, usize> = FxHashMap::default();
    for p in people.iter() {
        *count.entry(image(p)).or_default() += 1;
    }
    let mut before: FxHashMap<String, usize> = FxHashMap::default();
    for p in people {
        let of = image(p);
        let several = count.get(&of).is_some_and(|n| *n > 1);
        let place = before.entry(of.clone()).or_default();
        *place += 1;
        if !p.id.is_empty() {
            continue;
        }
        let own = if p.within.is_empty() { place.to_string() } else { p.within.clone() };
        p.id = match (of.is_empty(), several) {
            (true, _) => own,
            (false, true) => format!("{of}:{own}"),
            (false, false) => of,
        };
    }
}

/// Splits a path with `#ID`, which picks a person from the file, into path and id. The id has a
/// slash (as pictures' paths have) only after a file with an extension of this kind.
pub fn split_id(path: &str) -> (&str, Option<&str>) {
    let extension = |file: &str| EXTENSIONS.iter().any(|e| file.to_lowercase().ends_with(e));
    match path.rsplit_once('#') {
        Some((file, id))
            if !file.is_empty()
                && !id.is_empty()
                && (!id.contains(['/', '\\']) || extension(file)) =>
        {
            (file, Some(id))
        }
        _ => (path, None),
    }
}

const EXTENSIONS: [&str; 5] = [".json", ".csv", ".txt", ".npy", ".npz"];

/// Whether ids of pictures are the same: files often have a number with leading zeros for a name.
fn same(have: &str, want: &str) -> bool {
    let number = want.trim_start_matches('0');
    have == want || have == number && want.bytes().all(|b| b.is_ascii_digit())
}

impl People {
    /// The number of people, including those that were searched for but not detected.
    pub fn len(&self) -> usize {
        self.all.len()
    }

    /// True if the file has no people.
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// The ids of the people, in the order of the file.
    pub fn ids(&self) -> impl ExactSizeIterator<Item = &str> {
        self.all.iter().map(|p| p.id.as_str())
    }

    /// Returns one person: the one with the given id, or else the one of a picture whose
    /// file is called `stem` (without folder and extension), or else the only one. A file
    /// without people gives no keypoints. Where the file names no pictures, their numbers are
    /// their names; numbers of people, and places in the file, never are.
    ///
    /// # Errors
    /// If nobody has that id, or it is ambiguous which of several people is meant.
    pub fn pick(&self, id: Option<&str>, stem: Option<&str>) -> Result<Keypoints, KeypointsError> {
        if let Some(id) = id {
            return match self.find(id)? {
                Some(p) => Ok(p.keypoints.clone()),
                None => Err(self.nobody(id)),
            };
        }
        match (&self.all[..], stem) {
            ([], _) => Ok(Keypoints::default()),
            ([one], _) => Ok(one.keypoints.clone()),
            (_, Some(stem)) => {
                match self.of_file(stem)? {
                    Some(p) => Ok(p.keypoints.clone()),
                    None => Err(self
                        .several(&format!("; none of them has the name of the picture, `{stem}`"))),
                }
            }
            _ => Err(self.several("")),
        }
    }

    fn find(&self, id: &str) -> Result<Option<&Person>, KeypointsError> {
        if let Some(p) = self.all.iter().find(|p| p.id == id) {
            return Ok(Some(p));
        }
        self.one(id, |p| p.image.iter().any(|i| same(i, id)))
    }

    /// The person of the picture whose file is called `stem`.
    fn of_file(&self, stem: &str) -> Result<Option<&Person>, KeypointsError> {
        if self.all.iter().any(|p| !p.files.is_empty()) {
            return self.one(stem, |p| p.files.iter().any(|f| f == stem));
        }
        self.one(stem, |p| !p.counted && p.image.iter().any(|i| same(i, stem)))
    }

    /// The only person of whom this is true, if there is one.
    fn one(
        &self,
        id: &str,
        is: impl Fn(&Person) -> bool,
    ) -> Result<Option<&Person>, KeypointsError> {
        let found: Vec<&Person> = self.all.iter().filter(|p| is(p)).collect();
        match found[..] {
            [] => Ok(None),
            [one] => Ok(Some(one)),
            _ => {
                let ids = first(found.iter().map(|p| p.id.as_str()), 8);
                let message =
                    format!("there are {} people in the picture `{id}`: {ids}", found.len());
                Err(KeypointsError::new(message)
                    .hint("add `#` and an id to the file name to choose one"))
            }
        }
    }

    fn nobody(&self, id: &str) -> KeypointsError {
        let e = KeypointsError::new(format!("no person has the id `{id}`"));
        match self.all[..] {
            [] => e.hint("the file contains no people"),
            [Person { id: ref only, .. }] if only.is_empty() => {
                e.hint("there is one person, without an id")
            }
            _ => e.hint(format!("there are {}", first(self.ids(), 8))),
        }
    }

    fn several(&self, more: &str) -> KeypointsError {
        let message = format!("it contains {} people: {}{more}", self.len(), first(self.ids(), 5));
        KeypointsError::new(message).hint("add `#` and an id to the file name to choose one")
    }
}
