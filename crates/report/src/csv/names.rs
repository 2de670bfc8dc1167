//! The names of a file's columns, as CmdStan's readers and R can take them, and the order of
//! the elements of arrays.
//!
//! In these readers a `.` starts an index, a trailing `__` marks a statistic of the sampler,
//! and R replaces other characters itself. Therefore names consist of letters, digits and
//! `_`. The elements of an array are `R.1.1, R.2.1, …`, counted from 1, the first index
//! changing first; rows of numbers in memory have the last index changing first.

use pcadlang_inference::draws::{Column, Shape};
use std::collections::HashSet;

/// Words that R changes if they are the name of a column.
const RESERVED: [&str; 11] =
    ["if", "else", "repeat", "while", "function", "for", "next", "break", "in", "TRUE", "FALSE"];
const ALSO_RESERVED: [&str; 8] =
    ["NULL", "Inf", "NaN", "NA", "NA_integer_", "NA_real_", "NA_complex_", "NA_character_"];

/// Returns the name of every column of the file, with the elements of arrays one by one.
///
/// Other characters than letters and digits become one `_`; names begin with a letter, do not
/// end in `__`, and are no words of R. Names that become equal get the suffixes `_2`, `_3`, ….
pub fn column_names(columns: &[Column]) -> Vec<String> {
    as_written(columns).iter().flat_map(elements).collect()
}

/// The names of the elements of a column, in the order of the file.
fn elements(c: &Column) -> Vec<String> {
    let index = |at: &[usize]| at.iter().fold(c.name.clone(), |s, i| format!("{s}.{}", i + 1));
    let all: Vec<Vec<usize>> = c.shape.indices().collect();
    first_changes_first(&c.shape).into_iter().map(|i| index(&all[i])).collect()
}

/// Returns these columns under the names that they have in a file, without empty ones.
pub(crate) fn as_written(wanted: &[Column]) -> Vec<Column> {
    let mut taken = HashSet::new();
    let mut written = Vec::new();
    for column in wanted {
        let plain = plain(&column.name);
        let others = (2..).map(|i| format!("{plain}_{i}"));
        let mut all = std::iter::once(plain.clone()).chain(others);
        let name = all.find(|name| taken.insert(name.clone())).unwrap_or_default();
        if !column.shape.is_empty() {
            written.push(Column { name, is_field: false, ..column.clone() });
        }
    }
    written
}

fn plain(name: &str) -> String {
    let mut out = String::new();
    for c in name.chars() {
        let fits = c.is_ascii_alphanumeric() || c == '_';
        if fits {
            out.push(c);
        } else if !out.is_empty() && !out.ends_with('_') {
            out.push('_');
        }
    }
    if !fits_whole(name) {
        out.truncate(out.trim_end_matches('_').len());
    }
    while out.ends_with("__") {
        out.pop();
    }
    if !out.starts_with(|c: char| c.is_ascii_alphabetic()) {
        out.insert(0, 'x');
    }
    if RESERVED.contains(&out.as_str()) || ALSO_RESERVED.contains(&out.as_str()) {
        out.push('_');
    }
    out
}

fn fits_whole(name: &str) -> bool {
    name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

/// The places of an array's numbers in a row in memory, in the order of the file.
fn first_changes_first(shape: &Shape) -> Vec<usize> {
    let dims = shape.dims();
    let mut order = vec![0];
    let mut step = shape.len();
    let mut steps = Vec::new();
    for n in dims {
        step /= (*n).max(1);
        steps.push((*n, step));
    }
    // Each dimension repeats what the dimensions before it make.
    for (n, step) in steps {
        order = (0..n).flat_map(|i| order.iter().map(move |at| at + i * step)).collect();
    }
    order
}

/// The places of a row's numbers in memory, in the order of the file; none if both are the
/// same.
pub(super) fn file_order(columns: &[Column]) -> Option<Vec<usize>> {
    if columns.iter().all(|c| c.shape.dims().len() < 2) {
        return None;
    }
    let mut begin = 0;
    let mut all = Vec::new();
    for c in columns {
        all.extend(first_changes_first(&c.shape).into_iter().map(|i| begin + i));
        begin += c.shape.len();
    }
    Some(all)
}

/// Returns the columns of a line of names. Names of elements that are no complete array in
/// the order of the file are columns of their own.
pub(super) fn columns(names: &[&str]) -> Vec<Column> {
    let mut columns = Vec::new();
    let mut rest = names;
    while let Some(name) = rest.first() {
        let (column, n) = array_at(rest).unwrap_or_else(|| (Column::scalar(*name), 1));
        columns.push(column);
        rest = &rest[n..];
    }
    columns
}

/// The array whose elements come first in these names, and how many there are.
fn array_at(names: &[&str]) -> Option<(Column, usize)> {
    let (base, first) = indexed(names[0])?;
    if first.iter().any(|i| *i != 1) {
        return None;
    }
    let own = |name: &&&str| {
        indexed(name).filter(|(b, at)| *b == base && at.len() == first.len()).map(|(_, at)| at)
    };
    let all: Vec<Vec<usize>> = names.iter().map_while(|n| own(&n)).collect();
    // The elements up to the first name that is not the next one of the array.
    let n = (1..all.len()).find(|i| !follows(&all[i - 1], &all[*i])).unwrap_or(all.len());
    let dims = all[n - 1].clone();
    let size = dims.iter().try_fold(1usize, |s, d| s.checked_mul(*d));
    let column = Column::new(base, Shape::Array(dims));
    let complete = size == Some(n) && elements(&column).iter().eq(names[..n].iter());
    complete.then_some((column, n))
}

/// Splits a name at its indices, if it has any.
fn indexed(name: &str) -> Option<(&str, Vec<usize>)> {
    let mut base = name;
    let mut at = Vec::new();
    while let Some((before, i)) = base.rsplit_once('.') {
        let Some(i) = i.parse().ok().filter(|i| *i > 0) else { break };
        at.insert(0, i);
        base = before;
    }
    (!at.is_empty()).then_some((base, at))
}

/// Whether indices are later than others in the order of the file.
fn follows(before: &[usize], after: &[usize]) -> bool {
    before.iter().rev().lt(after.iter().rev())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(names: &[String]) -> Vec<Column> {
        columns(&names.iter().map(String::as_str).collect::<Vec<_>>())
    }

    #[test]
    fn names_survive_the_way_there_and_back() {
        let wanted = [
            Column::scalar("a_b"),
            Column::vector("v", 3),
            Column::vector("w", 1),
            Column::new("R", Shape::Array(vec![2, 3])),
            Column::new("t", Shape::Array(vec![2, 1, 2])),
            Column::scalar("f_x_y"),
        ];
        let names = column_names(&wanted);
        let joined = "a_b v.1 v.2 v.3 w.1 R.1.1 R.2.1 R.1.2 R.2.2 R.1.3 R.2.3 t.1.1.1 t.2.1.1 t.1.1.2 t.2.1.2 f_x_y";
        assert_eq!(names.join(" "), joined);
        assert_eq!(named(&names), wanted);
        let order = file_order(&wanted[3..4]).unwrap();
        assert_eq!(order, [0, 3, 1, 4, 2, 5]);
        assert_eq!(file_order(&wanted[..3]), None);
    }

    #[test]
    fn what_would_break_a_reader_is_replaced() {
        let odd = ["a.b", "f(x, y)", "# c", "", "lp__", "a/b", "q\"\n", "2x", "in", "σ²", "a__b"];
        assert_eq!(
            column_names(&odd.map(Column::scalar)),
            ["a_b", "f_x_y", "c", "x", "lp_", "a_b_2", "q", "x2x", "in_", "x_2", "a__b"]
        );
        let again = [Column::scalar("a/b"), Column::scalar("a_b_2"), Column::scalar("a.b")];
        assert_eq!(column_names(&again), ["a_b", "a_b_2", "a_b_3"]);
    }

    #[test]
    fn parts_of_arrays_are_columns_of_their_own() {
        let shapes = |names: &[&str]| {
            columns(names).iter().map(|c| (c.name.clone(), c.shape.len())).collect::<Vec<_>>()
        };
        let one = |name: &str| (name.to_owned(), 1);
        assert_eq!(shapes(&["v.2", "v.3"]), [one("v.2"), one("v.3")]);
        assert_eq!(shapes(&["R.1.1", "R.2.2"]), [one("R.1.1"), one("R.2.2")]);
        assert_eq!(shapes(&["v.1", "v.2", "v.1"]), [("v".into(), 2), ("v".into(), 1)]);
        assert_eq!(shapes(&["v.1", "w"]), [("v".into(), 1), one("w")]);
        let huge = format!("v.1,v.{}", usize::MAX);
        assert_eq!(columns(&huge.split(',').collect::<Vec<_>>()).len(), 2);
        let huge = format!("v.1.1,v.{0}.{0}", usize::MAX);
        assert_eq!(columns(&huge.split(',').collect::<Vec<_>>()).len(), 2);
    }

    #[test]
    fn empty_vectors_have_no_columns() {
        assert_eq!(column_names(&[Column::vector("v", 0), Column::scalar("x")]), ["x"]);
    }
}
