//! Tables as text (RFC 4180): a header line, then one row per line; quoted fields may
//! contain separators and line breaks. The crate `csv` splits the text.
//!
//! The separator is the one of comma, semicolon and tab that is most frequent in the
//! header. A column holds numbers if all its fields are numbers, otherwise bools if all
//! are `true` or `false`, otherwise strings. There are no missing values: an empty field
//! in a column of numbers is an error rather than a NaN that surfaces later.

use crate::lang::value::{MOST_ELEMENTS, Record, Value};
use csv::StringRecord;
use std::io::Read;
use std::sync::Arc;

/// A row and its first byte.
type Row = (usize, StringRecord);

/// Parses a table into a record of arrays, one per column.
pub(super) fn parse(bytes: &[u8]) -> Result<Value, String> {
    let text = std::str::from_utf8(bytes)
        .map_err(|e| format!("not UTF-8 text (byte {})", e.valid_up_to()))?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut rows = rows(text, separator(text))?.into_iter();
    let Some((_, header)) = rows.next() else { return Err("the table is empty".into()) };
    if header.iter().all(|h| h.trim().parse::<f64>().is_ok()) {
        return Err(
            "line 1: the first line must be a header with the column names, but it contains only numbers".into()
        );
    }
    let rows: Vec<Row> = rows.collect();
    if let Some((at, row)) = rows.iter().find(|(_, row)| row.len() != header.len()) {
        return Err(format!(
            "line {}: {} fields, but the header has {}",
            line(text, *at),
            row.len(),
            header.len()
        ));
    }
    let mut table = Record::new();
    for (i, name) in header.iter().enumerate() {
        let name = name.trim();
        if name.is_empty() {
            return Err(format!("line 1: column {} has no name", i + 1));
        }
        if table.insert(Arc::from(name), column(name, i, &rows, text)?).is_some() {
            return Err(format!("line 1: there are two columns `{name}`"));
        }
    }
    Ok(Value::Record(Arc::new(table)))
}

/// Converts a column to an array.
fn column(name: &str, i: usize, rows: &[Row], text: &str) -> Result<Value, String> {
    let fields = || rows.iter().map(|(at, row)| (*at, row.get(i).map_or("", |f| f.trim())));
    let numbers: Vec<f64> = fields().filter_map(|(_, f)| f.parse().ok()).collect();
    if let Some((at, _)) = fields().find(|(_, f)| f.parse::<f64>().is_ok_and(f64::is_nan)) {
        return Err(format!("line {}: column `{name}` is NaN; remove the row", line(text, at)));
    }
    if numbers.len() == rows.len() {
        return Ok(Value::array(numbers));
    }
    if let Some((at, _)) = fields().find(|(_, f)| f.is_empty())
        && fields().all(|(_, f)| f.is_empty() || f.parse::<f64>().is_ok())
        && !numbers.is_empty()
    {
        return Err(format!("line {}: column `{name}` is empty; remove the row", line(text, at)));
    }
    let bools: Vec<Value> = fields().filter_map(|(_, f)| f.parse().ok().map(Value::Bool)).collect();
    if bools.len() == rows.len() {
        return Ok(Value::List(bools.into()));
    }
    Ok(Value::List(
        rows.iter().map(|(_, row)| row.get(i).map_or(Value::Unit, Value::str)).collect(),
    ))
}

/// The most frequent separator in the header; a comma if there is none.
fn separator(text: &str) -> u8 {
    let header = text.lines().next().unwrap_or_default();
    let count = |c: u8| header.bytes().filter(|b| *b == c).count();
    [b';', b'\t'].into_iter().fold(b',', |best, c| if count(c) > count(best) { c } else { best })
}

/// Splits the text into rows, without blank ones.
fn rows(text: &str, separator: u8) -> Result<Vec<Row>, String> {
    // One more row at the end: a quoted field that is not closed swallows it.
    const END: &str = "\nend";
    let reader = csv::ReaderBuilder::new()
        .delimiter(separator)
        .has_headers(false)
        .flexible(true)
        .from_reader(text.as_bytes().chain(END.as_bytes()));
    let (mut rows, mut fields): (Vec<Row>, usize) = (Vec::new(), 0);
    for row in reader.into_records() {
        let row = row.map_err(|e| e.to_string())?;
        // The position is that before the line breaks between two rows.
        let before = row.position().map_or(0, |p| p.byte() as usize).min(text.len());
        let rest = text.get(before..).unwrap_or("").trim_start_matches(['\r', '\n']);
        let at = text.len() - rest.len();
        fields += row.len();
        if fields > MOST_ELEMENTS {
            return Err(format!("line {}: more than {MOST_ELEMENTS} fields", line(text, at)));
        }
        if row.len() != 1 || !row[0].trim().is_empty() {
            rows.push((at, row));
        }
    }
    match rows.pop() {
        Some((at, last)) if at < text.len() => {
            let open = last.iter().next_back().and_then(|f| f.strip_suffix(END)).unwrap_or("");
            let opened = line(text, text.len()) + 1 - line(open, open.len());
            Err(format!("line {opened}: a quoted field is not closed"))
        }
        _ => Ok(rows),
    }
}

/// The line of a byte, counted from 1.
fn line(text: &str, at: usize) -> usize {
    let before = text.get(..at).unwrap_or(text).replace("\r\n", "\n");
    1 + before.matches(['\r', '\n']).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> String {
        match parse(text.as_bytes()) {
            Ok(v) => v.to_string(),
            Err(e) => e,
        }
    }

    #[test]
    fn columns_get_the_type_of_all_their_fields() {
        assert_eq!(read("x,y\n1,2.5\n-3e2, 4\n"), "{ x: [1, -300], y: [2.5, 4] }");
        assert_eq!(
            read("x;ok;n\n1;true;a\n2;false;2"),
            "{ x: [1, 2], ok: [true, false], n: [\"a\", \"2\"] }"
        );
        assert_eq!(read("\u{feff}a\tb\r\n1\t2\r\n\r\n"), "{ a: [1], b: [2] }");
        assert_eq!(read("x,y\n"), "{ x: [], y: [] }");
        assert_eq!(read("x\ninf\n"), "{ x: [inf] }");
        assert_eq!(read("end\n1\nend"), "{ end: [\"1\", \"end\"] }");
    }

    #[test]
    fn quotes_protect_separators_and_line_ends() {
        assert_eq!(
            read("a,b\n\"1,5\",\"say \"\"hi\"\"\nthere\"\n"),
            "{ a: [\"1,5\"], b: [\"say \\\"hi\\\"\\nthere\"] }"
        );
        assert_eq!(read("a,b\n\"1\n2\",x\n3\n"), "line 4: 1 fields, but the header has 2");
    }

    #[test]
    fn mistakes_name_their_line() {
        assert_eq!(read(""), "the table is empty");
        assert_eq!(
            read("1,2\n3,4"),
            "line 1: the first line must be a header with the column names, but it contains only numbers"
        );
        assert_eq!(read("x,y\n1,2\n3"), "line 3: 1 fields, but the header has 2");
        assert_eq!(read("x,x\n1,2"), "line 1: there are two columns `x`");
        assert_eq!(read("x,\n1,2"), "line 1: column 2 has no name");
        assert_eq!(read("x,y\n1,2\n\n,3"), "line 4: column `x` is empty; remove the row");
        assert_eq!(read("x\n1\nnan"), "line 3: column `x` is NaN; remove the row");
        assert_eq!(read("x\n\"1"), "line 2: a quoted field is not closed");
        assert_eq!(
            read("x,y\r\n\"1\n2\",3\r\n\r\n4,\"5\n6,\"\"7\n"),
            "line 5: a quoted field is not closed"
        );
        assert_eq!(read("x,y\r1,2\r \r3"), "line 4: 1 fields, but the header has 2");
        assert_eq!(parse(&[b'x', 0xff]).unwrap_err(), "not UTF-8 text (byte 1)");
    }
}
