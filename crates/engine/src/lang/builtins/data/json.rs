//! JSON (RFC 8259) as values: objects become records in their order, arrays of numbers
//! are packed, null becomes `nothing`.

use crate::lang::value::{Extent, MOST_ELEMENTS, Value};
use std::sync::Arc;

/// The maximum size of a JSON text in bytes: the value needs many times as much memory.
const MOST_BYTES: usize = 1 << 26;

/// Parses a JSON text. serde_json limits nesting to 128 levels.
pub(super) fn parse(bytes: &[u8]) -> Result<Value, String> {
    if bytes.len() > MOST_BYTES {
        return Err(format!("{} bytes of JSON; at most {MOST_BYTES}", bytes.len()));
    }
    let value = serde_json::from_slice(bytes).map(from_json).map_err(|e| e.to_string())?;
    match value.extent() {
        Extent::TooLarge => Err(format!("more than {MOST_ELEMENTS} elements")),
        Extent::Fits | Extent::TooDeep => Ok(value),
    }
}

/// Returns the value that JSON stands for.
pub fn from_json(json: serde_json::Value) -> Value {
    match json {
        serde_json::Value::Null => Value::Unit,
        serde_json::Value::Bool(b) => Value::Bool(b),
        serde_json::Value::Number(n) => Value::Num(n.as_f64().unwrap_or(f64::NAN)),
        serde_json::Value::String(s) => Value::Str(s.into()),
        serde_json::Value::Array(xs) => {
            Value::from_elements(xs.into_iter().map(from_json).collect())
        }
        serde_json::Value::Object(fields) => Value::Record(Arc::new(
            fields.into_iter().map(|(k, v)| (Arc::from(k), from_json(v))).collect(),
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_keep_their_shape() {
        let text = r#"{"b": [1, 2.5], "a": {"x": null, "y": [true, "s"]}, "n": 1e-7, "e": []}"#;
        let v = parse(text.as_bytes()).unwrap();
        assert_eq!(
            v.to_string(),
            r#"{ b: [1, 2.5], a: { x: nothing, y: [true, "s"] }, n: 0.0000001, e: [] }"#
        );
    }

    #[test]
    fn mistakes_name_their_place() {
        assert_eq!(parse(b"{\"a\": 1,}").unwrap_err(), "trailing comma at line 1 column 9");
        assert!(parse(&[b'['; 100_000]).unwrap_err().contains("recursion limit"));
        assert!(parse(b"1e999").is_err(), "no infinities by accident");
    }
}
