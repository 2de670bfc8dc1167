//! Counts the checked points, collects failures, and compares the counts with the table
//! of `docs/reference/numerics.md`.

const DOCUMENT: &str = include_str!("../../../docs/reference/numerics.md");

/// The points of one subject.
pub struct Points {
    subject: &'static str,
    checked: usize,
    wrong: Vec<String>,
}

impl Points {
    pub fn of(subject: &'static str) -> Points {
        Points { subject, checked: 0, wrong: Vec::new() }
    }

    /// Adds a point; `what` describes it if it is wrong.
    pub fn check(&mut self, right: bool, what: impl FnOnce() -> String) {
        self.checked += 1;
        if !right {
            self.wrong.push(what());
        }
    }

    /// Asserts that all points are right, and that their number is the documented one.
    pub fn finish(self) {
        let Points { subject, checked, wrong } = self;
        assert!(
            wrong.is_empty(),
            "{subject}: {} of {checked} are wrong:\n{}",
            wrong.len(),
            wrong.join("\n")
        );
        let documented = documented().find(|(name, _)| *name == subject).map(|(_, n)| n);
        assert_eq!(
            documented,
            Some(checked),
            "docs/reference/numerics.md should say {checked} points for \"{subject}\""
        );
    }
}

/// Returns the rows of the document's table: a subject, and the number of points in the
/// last column.
fn documented() -> impl Iterator<Item = (&'static str, usize)> {
    DOCUMENT.lines().filter_map(|line| {
        let mut cells = line.strip_prefix('|')?.strip_suffix('|')?.split('|').map(str::trim);
        Some((cells.next()?, cells.next_back()?.parse().ok()?))
    })
}

#[test]
fn there_are_at_least_2000_points() {
    let total: usize = documented().map(|(_, n)| n).sum();
    assert!(total >= 2000, "{total}");
    let said =
        DOCUMENT.lines().find_map(|l| l.strip_prefix("Together ")?.split(' ').next()?.parse().ok());
    assert_eq!(said, Some(total), "docs/reference/numerics.md should say: Together {total} points");
}
