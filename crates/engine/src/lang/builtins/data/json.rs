//! JSON (RFC 8259) as values: objects become records in their order, arrays of numbers
//! are packed, null becomes `nothing`.

use crate::lang::value::{Extent, MOST_ELEMENTS, Record, Value};
use serde::de::{Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};
use std::fmt::Formatter;
use std::sync::Arc;

/// The maximum size of a JSON text in bytes: the value needs many times as much memory.
const MOST_BYTES: usize = 1 << 26;

/// Parses a JSON text. serde_json limits nesting to 128 levels.
pub(super) fn parse(bytes: &[u8]) -> Result<Value, String> {
    if bytes.len() > MOST_BYTES {
        return Err(format!("{} bytes of JSON; at most {MOST_BYTES}", bytes.len()));
    }
    let Json(value) = serde_json::from_slice(bytes).map_err(|e| e.to_string())?;
    match value.extent() {
        Extent::TooLarge => Err(format!("more than {MOST_ELEMENTS} elements")),
        Extent::Fits | Extent::TooDeep => Ok(value),
    }
}

/// The value that JSON stands for.
pub struct Json(pub Value);

impl<'de> Deserialize<'de> for Json {
    fn deserialize<D: Deserializer<'de>>(json: D) -> Result<Json, D::Error> {
        json.deserialize_any(Reader).map(Json)
    }
}

/// Makes values while JSON is read: a tree of it would take many times their memory.
struct Reader;

impl<'de> Visitor<'de> for Reader {
    type Value = Value;

    fn expecting(&self, f: &mut Formatter) -> std::fmt::Result {
        f.write_str("JSON")
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Unit)
    }

    fn visit_bool<E>(self, b: bool) -> Result<Value, E> {
        Ok(Value::Bool(b))
    }

    fn visit_i64<E>(self, n: i64) -> Result<Value, E> {
        Ok(Value::Num(n as f64))
    }

    fn visit_u64<E>(self, n: u64) -> Result<Value, E> {
        Ok(Value::Num(n as f64))
    }

    fn visit_f64<E>(self, x: f64) -> Result<Value, E> {
        Ok(Value::Num(x))
    }

    fn visit_str<E>(self, s: &str) -> Result<Value, E> {
        Ok(Value::Str(s.into()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut all: A) -> Result<Value, A::Error> {
        let mut elements = Vec::new();
        while let Some(Json(element)) = all.next_element()? {
            elements.push(element);
        }
        Ok(Value::from_elements(elements))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut all: A) -> Result<Value, A::Error> {
        let mut fields = Record::default();
        while let Some((name, Json(value))) = all.next_entry::<Arc<str>, _>()? {
            fields.insert(name, value);
        }
        Ok(Value::Record(Arc::new(fields)))
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
