//! Distributions by name and parameters, for tables of reference values (`tests/data`).

use pcadlang_numerics::dist::*;

/// Returns the distribution of a family, with its parameters in the order of the tables
/// of reference values.
pub fn made(family: &str, p: &[f64]) -> Dist {
    match (family, p) {
        (name, [lo, hi, p @ ..]) if name.starts_with("truncated:") => {
            truncated(&made(&name["truncated:".len()..], p), *lo, *hi).unwrap()
        }
        ("multinomial", [n, w @ ..]) => Multinomial::new(*n, w).unwrap().into(),
        ("lkj", [n, eta]) => Lkj::new(*n, *eta).unwrap().into(),
        ("wishart", [df, scale @ ..]) => {
            let scale = nalgebra::DMatrix::from_row_slice(3, 3, scale);
            Wishart::new(*df, &scale).unwrap().into()
        }
        ("categorical", p) => Categorical::new(p).unwrap().into(),
        ("mixture", [a, b, parts @ ..]) => {
            let parts: Vec<Dist> = parts.chunks(2).map(|p| made("normal", p)).collect();
            Mixture::new(&[*a, *b], parts).unwrap().into()
        }
        ("dirichlet", p) => Dirichlet::new(p).unwrap().into(),
        _ => {
            let family = FAMILIES.iter().find(|f| f.name == family).expect("a known family");
            (family.numbers.expect("a family of numbers").make)(p).unwrap()
        }
    }
}

/// Returns the value with these numbers; a matrix has rows of three.
pub fn datum(family: &str, x: &[f64]) -> Datum {
    match x {
        [x] => Datum::Num(*x),
        rows if matches!(family, "lkj" | "wishart") => {
            Datum::List(rows.chunks(3).map(|r| r.to_vec().into()).collect())
        }
        _ => x.to_vec().into(),
    }
}
