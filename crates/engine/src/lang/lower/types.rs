//! Static types: enough to report a wrong argument where it is written, without false
//! alarms.

use crate::lang::builtins::Type;
use crate::lang::value::Value;

/// Returns the type of a value.
pub(super) fn of_value(v: &Value) -> Type {
    match v {
        Value::Num(_) => Type::Num,
        Value::Bool(_) => Type::Bool,
        Value::Str(_) => Type::Str,
        Value::Array(_) | Value::List(_) => Type::Array,
        Value::Record(_) => Type::Record,
        Value::Closure(_) | Value::Builtin(_) | Value::Memo(_) => Type::Function,
        Value::Dist(_) => Type::Dist,
        Value::Likelihood(_) => Type::Likelihood,
        Value::Object(o) => Type::Object(o.type_name()),
        Value::Unit | Value::Container(_) => Type::Any,
    }
}

/// True if a value of static type `got` may be of type `wanted`.
pub(super) fn accepts(wanted: Type, got: Type) -> bool {
    use Type::*;
    match (wanted, got) {
        (Any, _) | (_, Any) => true,
        (Num | Int, Num | Int | Nums) => true,
        (Nums, Num | Int | Nums | Array) => true,
        (Array, Array | Nums) => true,
        // Objects are distinguished at run time: their names are for users only.
        (Object(_), Object(_)) | (Object(_), Covariance) | (Covariance, Object(_)) => true,
        (a, b) => a == b,
    }
}

/// Returns a type with its article, for messages.
pub(super) fn shown(t: Type) -> String {
    let s = t.to_string();
    match s.chars().next() {
        Some(c) if s.starts_with("a ") || s.starts_with("an ") || s == "any" => {
            let _ = c;
            s
        }
        Some('a' | 'e' | 'i' | 'o' | 'u') => format!("an {s}"),
        _ => format!("a {s}"),
    }
}

/// Returns the type that a `param` or function parameter declares.
pub(super) fn declared(name: &str) -> Option<Type> {
    Some(match name {
        "any" => Type::Any,
        "number" | "num" | "float" | "real" => Type::Num,
        "int" => Type::Int,
        "bool" => Type::Bool,
        "string" | "str" => Type::Str,
        "array" => Type::Array,
        "record" => Type::Record,
        "function" => Type::Function,
        "distribution" => Type::Dist,
        _ => return None,
    })
}
