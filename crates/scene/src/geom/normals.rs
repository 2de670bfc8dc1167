//! Unit normals of vertices, which may be computed on first use: what a mesh covers of a picture
//! does not depend on them.

use glam::Vec3;
use std::fmt;
use std::ops::Deref;
use std::sync::LazyLock;

/// A unit normal for each vertex of a mesh; a slice.
pub struct Normals(List);

type Later = LazyLock<Vec<Vec3>, Box<dyn FnOnce() -> Vec<Vec3> + Send>>;

enum List {
    Known(Vec<Vec3>),
    Later(Later),
}

impl Normals {
    /// Those that a function returns, which is called when they are needed.
    pub fn later(make: impl FnOnce() -> Vec<Vec3> + Send + 'static) -> Normals {
        Normals(List::Later(LazyLock::new(Box::new(make))))
    }
}

impl From<Vec<Vec3>> for Normals {
    fn from(list: Vec<Vec3>) -> Normals {
        Normals(List::Known(list))
    }
}

impl FromIterator<Vec3> for Normals {
    fn from_iter<I: IntoIterator<Item = Vec3>>(list: I) -> Normals {
        Normals(List::Known(list.into_iter().collect()))
    }
}

impl Deref for Normals {
    type Target = [Vec3];

    fn deref(&self) -> &[Vec3] {
        match &self.0 {
            List::Known(list) => list,
            List::Later(list) => list,
        }
    }
}

impl<'a> IntoIterator for &'a Normals {
    type Item = &'a Vec3;
    type IntoIter = std::slice::Iter<'a, Vec3>;

    fn into_iter(self) -> std::slice::Iter<'a, Vec3> {
        self.iter()
    }
}

impl Clone for Normals {
    fn clone(&self) -> Normals {
        self.to_vec().into()
    }
}

impl PartialEq for Normals {
    fn eq(&self, other: &Normals) -> bool {
        **self == **other
    }
}

impl fmt::Debug for Normals {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        (**self).fmt(f)
    }
}
