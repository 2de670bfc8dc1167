//! Tables as text (RFC 4180): a header line, then one row per line; quoted fields may
//! contain separators and line breaks. The crate `csv` splits the text.
//!
//! The separator is the one of comma, semicolon and tab that is most frequent in the
//! header. A column holds numbers if all its fields are numbers, otherwise bools if all
//! are `true` or `false`, otherwise strings. Fields of a column of numbers or bools that are
//! left out, or that are mistakes, are [`Missing`]: only their use is an error.

use crate::lang::missing::{Missing, Why};
use crate::lang::value::{MOST_ELEMENTS, Record, Value};
use csv::StringRecord;
use std::io::Read;
use std::sync::Arc;

/// A row and its first byte.
type Row = (usize, StringRecord);

/// The spellings of a missing entry in spreadsheets, R, pandas and other programs, in small
/// letters.
const ABSENT: [&str; 12] =
    ["", "na", "n/a", "#n/a", "#na", "<na>", "null", "none", "nan", "-", ".", "?"];
/// A column holds numbers if there are at least this many of them for each other text: the
/// texts are then mistakes.
const NUMBERS: usize = 3;

/// The type of a field on its own.
#[derive(Clone, Copy)]
enum Field {
    Num(f64),
    Bool(bool),
    Not(Why),
}

impl Field {
    fn of(text: &str) -> Field {
        let absent = || ABSENT.contains(&&*text.to_ascii_lowercase());
        match (text.parse::<f64>(), text.parse()) {
            (Ok(x), _) if x.is_infinite() && text.contains(|c: char| c.is_ascii_digit()) => {
                Field::Not(Why::Huge)
            }
            (Ok(x), _) if x.is_nan() => Field::Not(Why::Absent),
            (Ok(x), _) => Field::Num(x),
            (_, Ok(b)) => Field::Bool(b),
            _ if absent() => Field::Not(Why::Absent),
            _ if text.replacen(',', ".", 1).parse::<f64>().is_ok() => Field::Not(Why::Comma),
            _ => Field::Not(Why::Other),
        }
    }
}

/// Parses a table into a record of arrays, one per column.
pub(super) fn parse(bytes: &[u8], file: &str) -> Result<Value, String> {
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
        let commas = row.len() > header.len() && separator(text) == b',';
        return Err(format!(
            "line {}: {} fields, but the header has {}{}",
            line(text, *at),
            row.len(),
            header.len(),
            if commas {
                "; numbers need a decimal point, and texts with commas quotes"
            } else {
                ""
            }
        ));
    }
    let (mut table, file) = (Record::new(), Arc::from(file));
    for (i, name) in header.iter().enumerate() {
        let name = name.trim();
        if name.is_empty() {
            return Err(format!("line 1: column {} has no name", i + 1));
        }
        if table.insert(Arc::from(name), column(name, i, &rows, (text, &file))).is_some() {
            return Err(format!("line 1: there are two columns `{name}`"));
        }
    }
    Ok(Value::Record(Arc::new(table)))
}

/// Converts a column to an array.
fn column(name: &str, i: usize, rows: &[Row], (text, file): (&str, &Arc<str>)) -> Value {
    let fields: Vec<Field> = rows.iter().map(|(_, row)| Field::of(written(row, i))).collect();
    let count = |is: fn(&Field) -> bool| fields.iter().filter(|f| is(f)).count();
    let numbers = count(|f| matches!(f, Field::Num(_) | Field::Not(Why::Comma | Why::Huge)));
    let bools = count(|f| matches!(f, Field::Bool(_)));
    let texts = count(|f| matches!(f, Field::Not(Why::Other)));
    let is_numbers = numbers >= NUMBERS * (bools + texts);
    if !is_numbers && numbers + texts > 0 {
        return Value::List(
            rows.iter().map(|(_, row)| row.get(i).map_or(Value::Unit, Value::str)).collect(),
        );
    }
    let (name, mut seen): (Arc<str>, _) = (Arc::from(name), (0, 1));
    let value = |(field, (at, row)): (&Field, &Row)| match *field {
        Field::Num(x) => Value::Num(x),
        Field::Bool(b) if !is_numbers => Value::Bool(b),
        other => {
            // Lines are counted from the entry before.
            seen = (*at, seen.1 + breaks(text.get(seen.0..*at).unwrap_or("")));
            Value::object(Missing {
                file: Arc::clone(file),
                name: Arc::clone(&name),
                at: (seen.1, i + 1),
                text: written(row, i).into(),
                why: if let Field::Not(why) = other { why } else { Why::Other },
            })
        }
    };
    Value::from_elements(fields.iter().zip(rows).map(value).collect())
}

/// A field of a row without the space around it.
fn written(row: &StringRecord, i: usize) -> &str {
    row.get(i).map_or("", str::trim)
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
    1 + breaks(text.get(..at).unwrap_or(text))
}

/// The number of line breaks.
fn breaks(text: &str) -> usize {
    text.replace("\r\n", "\n").matches(['\r', '\n']).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> String {
        match parse(text.as_bytes(), "t.csv") {
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
            read("a,b\n\"1,x\",\"say \"\"hi\"\"\nthere\"\n"),
            "{ a: [\"1,x\"], b: [\"say \\\"hi\\\"\\nthere\"] }"
        );
        assert_eq!(read("a,b\n\"1\n2\",x\n3\n"), "line 4: 1 fields, but the header has 2");
    }

    /// The errors of the entries of a table without values.
    fn entries(text: &str) -> Vec<String> {
        let Ok(Value::Record(table)) = parse(text.as_bytes(), "t.csv") else { panic!("{text}") };
        let all = table.values().flat_map(|c| c.passes());
        all.filter_map(|v| Some(v.downcast::<Missing>()?.fault().message)).collect()
    }

    #[test]
    fn entries_without_values_know_where_they_are() {
        for absent in
            ["", "  ", "NA", "nan", "NaN", "-nan", "N/A", "#N/A", "NULL", "None", "-", "."]
        {
            let text = format!("\u{feff}y;x\r\n{absent};1\r\n\r\n2.5;{absent}\r\n3;2\r\n");
            let what = match absent.trim() {
                "" => "is empty".to_owned(),
                a => format!("is missing (`{a}`)"),
            };
            let expected = [
                format!("t.csv, line 2, column 1: the entry of `y` {what}"),
                format!("t.csv, line 4, column 2: the entry of `x` {what}"),
            ];
            assert_eq!(entries(&text), expected, "{absent}");
        }
        let one = |text: &str| entries(text).join("\n");
        assert_eq!(
            one("a,b\n\"x\ny\",\"3,5\"\n"),
            "t.csv, line 2, column 2: the entry of `b` has a comma (`3,5`)"
        );
        assert_eq!(
            one("x;y\n1;3,5\n2;4,5"),
            [
                "t.csv, line 2, column 2: the entry of `y` has a comma (`3,5`)",
                "t.csv, line 3, column 2: the entry of `y` has a comma (`4,5`)"
            ]
            .join("\n")
        );
        assert_eq!(
            one("y\n1\n1e400"),
            "t.csv, line 3, column 1: the entry of `y` is out of range (`1e400`)"
        );
        assert_eq!(
            one("y\n1\n2\n12 kg\n4"),
            "t.csv, line 4, column 1: the entry of `y` is not a number (`12 kg`), though most of the column are"
        );
        assert_eq!(entries("y,z\nNA,1\nNA,2").len(), 2, "a column without any value");
        assert_eq!(
            read("ok,n\ntrue,NA\nNA,a\n"),
            "{ ok: [true, a missing entry], n: [\"NA\", \"a\"] }"
        );
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
        assert_eq!(
            read("x,y\n1,2\n3,5,4"),
            "line 3: 3 fields, but the header has 2; numbers need a decimal point, and texts with commas quotes"
        );
        assert_eq!(read("x\n\"1"), "line 2: a quoted field is not closed");
        assert_eq!(
            read("x,y\r\n\"1\n2\",3\r\n\r\n4,\"5\n6,\"\"7\n"),
            "line 5: a quoted field is not closed"
        );
        assert_eq!(read("x,y\r1,2\r \r3"), "line 4: 1 fields, but the header has 2");
        assert_eq!(parse(&[b'x', 0xff], "t.csv").unwrap_err(), "not UTF-8 text (byte 1)");
    }
}
