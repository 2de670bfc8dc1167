//! `run --stream`: each draw as a line of JSON, for programs in any language.

use pcadlang_inference::Checkpoint;
use pcadlang_inference::draws::{Column, DrawRow, POINTWISE, Sink};
use serde_json::{Map, Number, Value, json};
use std::io;

/// Prints the draws of a chain beside what another sink does with them.
pub struct Streamed<S> {
    kept: S,
    columns: Vec<Column>,
}

impl<S: Sink> Streamed<S> {
    /// Prints what `kept` keeps.
    pub fn new(kept: S) -> Streamed<S> {
        Streamed { kept, columns: Vec::new() }
    }
}

/// A number; null unless it is finite.
fn number(x: f64) -> Value {
    Number::from_f64(x).map_or(Value::Null, Value::Number)
}

/// An array of these dimensions, of texts if there are some.
fn nested(own: &[f64], dims: &[usize], levels: &[String]) -> Value {
    match dims {
        [] if levels.is_empty() => own.first().map_or(Value::Null, |x| number(*x)),
        [] => json!(own.first().filter(|x| **x >= 0.0).and_then(|x| levels.get(*x as usize))),
        [n, inner @ ..] => {
            let parts = own.chunks((own.len() / (*n).max(1)).max(1));
            parts.map(|part| nested(part, inner, levels)).collect()
        }
    }
}

/// The line of a draw: chain and draw from 0, the log joint density, and the recorded values
/// by name. Log densities of single observed values are left out.
fn line(columns: &[Column], row: &DrawRow) -> Value {
    let (mut at, mut values) = (0, Map::new());
    for c in columns {
        let own = row.values.get(at..at + c.shape.len()).unwrap_or_default();
        at += c.shape.len();
        if c.name == POINTWISE {
            continue;
        }
        values.insert(c.name.clone(), nested(own, c.shape.dims(), &c.levels));
    }
    json!({
        "chain": row.chain, "draw": row.draw, "log_joint": number(row.log_joint), "values": values,
    })
}

impl<S: Sink> Sink for Streamed<S> {
    fn columns(&mut self, columns: &[Column]) -> io::Result<()> {
        self.columns = columns.to_vec();
        self.kept.columns(columns)
    }

    fn draw(&mut self, row: &DrawRow) -> io::Result<()> {
        print_line!("{}", line(&self.columns, row));
        self.kept.draw(row)
    }

    fn chain_done(&mut self, chain: u32, steps: u64, warmup: u64, seconds: f64) -> io::Result<()> {
        self.kept.chain_done(chain, steps, warmup, seconds)
    }

    fn resume(&mut self) -> io::Result<Option<Checkpoint>> {
        self.kept.resume()
    }

    fn takes_checkpoints(&self) -> bool {
        self.kept.takes_checkpoints()
    }

    fn checkpoint(&mut self, checkpoint: &Checkpoint) -> io::Result<()> {
        self.kept.checkpoint(checkpoint)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pcadlang_inference::draws::Shape;

    #[test]
    fn a_line_has_the_values_by_name() {
        let columns = [
            Column::scalar("x"),
            Column::vector("w", 2),
            Column::vector(POINTWISE, 1),
            Column::new("m", Shape::Array(vec![2, 2])),
            Column { levels: vec!["cup".into(), "vase".into()], ..Column::vector("kind", 2) },
        ];
        let values = vec![0.5, f64::NAN, 2.0, -3.0, 1.0, 2.0, 3.0, 4.0, 1.0, f64::NAN];
        let row = DrawRow { chain: 1, draw: 7, log_joint: -1.5, values, ..DrawRow::default() };
        let wanted = r#"{"chain":1,"draw":7,"log_joint":-1.5,"values":{"x":0.5,"w":[null,2.0],"m":[[1.0,2.0],[3.0,4.0]],"kind":["vase",null]}}"#;
        assert_eq!(line(&columns, &row).to_string(), wanted);
    }
}
