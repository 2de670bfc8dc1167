//! Reference values computed with mpmath; `tests/data/make_extremes_reference.py`
//! documents the columns.

const TABLE: &str = include_str!("../../data/extremes_reference.csv");

/// A row of the table.
pub struct Row {
    pub name: &'static str,
    pub parameters: Vec<f64>,
    pub point: Vec<f64>,
    pub values: Vec<f64>,
    pub region: &'static str,
    pub line: &'static str,
}

/// Returns the rows of a kind.
pub fn rows(kind: &str) -> Vec<Row> {
    let numbers = |s: &str| s.split_whitespace().map(|x| x.parse().unwrap()).collect();
    let row = |line: &'static str| {
        let fields: Vec<&str> = line.split(',').collect();
        let [of, name, parameters, point, values, region] = fields[..] else {
            panic!("bad row {line}")
        };
        let (parameters, point, values) = (numbers(parameters), numbers(point), numbers(values));
        (of == kind).then_some(Row { name, parameters, point, values, region, line })
    };
    TABLE.lines().skip(1).filter_map(row).collect()
}

/// Whether a value is within a relative or an absolute error; infinities must be equal.
pub fn agree(got: f64, expected: f64, relative: f64, absolute: f64) -> bool {
    got == expected || (got - expected).abs() <= (relative * expected.abs()).max(absolute)
}
