//! Landmarks: named points of a solid, such as the joints of a body.
//!
//! Landmarks are not geometry: they are not drawn and do not count in bounds. Invariant
//! of a list made by [`unique`]: all names differ.

use glam::DVec3;
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// A named point that moves with its solid.
#[derive(Clone, Debug, PartialEq)]
pub struct Landmark {
    /// The name; repeated names in a group get `#2`, `#3`, … appended.
    pub name: Arc<str>,
    /// The position, in world coordinates (scene units).
    pub position: DVec3,
}

/// Makes the names of a list unique, in order: the second `hand` becomes `hand#2`, the
/// third `hand#3`. Numbers from earlier calls are replaced, so the nesting of groups does
/// not matter.
pub(super) fn unique(all: impl IntoIterator<Item = Landmark>) -> Arc<[Landmark]> {
    let mut seen: FxHashMap<Arc<str>, u32> = FxHashMap::default();
    let named = all.into_iter().map(|l| {
        let base = base(&l.name);
        let base: Arc<str> =
            if base.len() == l.name.len() { Arc::clone(&l.name) } else { Arc::from(base) };
        let count = seen.entry(Arc::clone(&base)).or_insert(0);
        *count += 1;
        let name = if *count == 1 { base } else { Arc::from(format!("{base}#{count}")) };
        Landmark { name, ..l }
    });
    named.collect()
}

/// Returns a name without the number that [`unique`] appends.
fn base(name: &str) -> &str {
    match name.rsplit_once('#') {
        Some((base, n))
            if !base.is_empty() && !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit()) =>
        {
            base
        }
        _ => name,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(of: &[&str]) -> Vec<String> {
        let all = of.iter().map(|n| Landmark { name: Arc::from(*n), position: DVec3::ZERO });
        unique(all).iter().map(|l| l.name.to_string()).collect()
    }

    #[test]
    fn names_that_occur_again_are_numbered() {
        assert_eq!(names(&["a", "b", "a", "a"]), ["a", "b", "a#2", "a#3"]);
        assert_eq!(names(&["a", "a#2", "a", "a#2"]), ["a", "a#2", "a#3", "a#4"]);
        assert_eq!(names(&["a#2", "#", "#1", "a#x", "a#"]), ["a", "#", "#1", "a#x", "a#"]);
    }
}
