//! Column names that are valid in CSV and in ArviZ.

use pcadlang_inference::draws::{Column, Shape};
use std::collections::HashSet;

/// Returns the name of every column of the file, with the elements of vectors one by one.
///
/// In ArviZ a `.` starts an index and a trailing `__` marks a statistic of the sampler,
/// and neither ArviZ nor CmdStan supports quotes. Therefore `.` becomes `/`, a comma `;`,
/// white space and quotes `_`, and a name that ends in `__` gets a trailing `/`. Names
/// that become equal get the suffixes `/2`, `/3`, ….
pub fn column_names(columns: &[Column]) -> Vec<String> {
    let mut taken = HashSet::new();
    let mut names = Vec::new();
    for column in columns {
        let wanted = csv_safe(&column.name);
        let mut name = wanted.clone();
        let mut copies = 1;
        while !taken.insert(name.clone()) {
            copies += 1;
            name = format!("{wanted}/{copies}");
        }
        match column.shape {
            Shape::Scalar => names.push(name),
            Shape::Vector(n) => names.extend((1..=n).map(|i| format!("{name}.{i}"))),
        }
    }
    names
}

fn csv_safe(name: &str) -> String {
    let mut out: String = name
        .chars()
        .map(|c| match c {
            '.' => '/',
            ',' => ';',
            c if c.is_whitespace() || c.is_control() || c == '"' => '_',
            c => c,
        })
        .collect();
    if out.is_empty() || out.starts_with('#') {
        out.insert(0, '_');
    }
    if out.ends_with("__") {
        out.push('/');
    }
    out
}

/// Returns these columns under the names that they have in a file.
pub(crate) fn as_written(wanted: &[Column]) -> Vec<Column> {
    columns(&column_names(wanted).iter().map(String::as_str).collect::<Vec<_>>())
}

/// Returns the columns of a line of names: the inverse of [`column_names`] for names that
/// it did not change.
pub(super) fn columns(names: &[&str]) -> Vec<Column> {
    let mut columns: Vec<Column> = Vec::new();
    for name in names {
        let element =
            name.rsplit_once('.').and_then(|(base, i)| Some((base, i.parse::<usize>().ok()?)));
        match (element, columns.last_mut()) {
            (Some((base, i)), Some(Column { name, shape: Shape::Vector(n) }))
                if name == base && i == *n + 1 =>
            {
                *n = i
            }
            (Some((base, 1)), _) => columns.push(Column::vector(base, 1)),
            _ => columns.push(Column::scalar(*name)),
        }
    }
    columns
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_survive_the_way_there_and_back() {
        let wanted = [
            Column::scalar("a/b"),
            Column::vector("v", 3),
            Column::vector("w", 1),
            Column::scalar("f(x;y)"),
        ];
        let names = column_names(&wanted);
        assert_eq!(names, ["a/b", "v.1", "v.2", "v.3", "w.1", "f(x;y)"]);
        assert_eq!(columns(&names.iter().map(String::as_str).collect::<Vec<_>>()), wanted);
    }

    #[test]
    fn what_would_break_a_reader_is_replaced() {
        let odd = ["a.b", "f(x, y)", "# c", "", "lp__", "a/b", "q\"\n"].map(Column::scalar);
        assert_eq!(column_names(&odd), ["a/b", "f(x;_y)", "_#_c", "_", "lp__/", "a/b/2", "q__/"]);
    }

    #[test]
    fn empty_vectors_have_no_columns() {
        assert_eq!(column_names(&[Column::vector("v", 0), Column::scalar("x")]), ["x"]);
    }
}
