//! What a user pointed out in a photograph, as a value: a thin layer over
//! [`pcadlang_scene::vision::hint`].

use super::observed_maps::MaskValue;
use super::{IMAGE, ImageValue, native};
use crate::model::Program;
use pcadlang_engine::lang::builtins::{Arg, Args, Row, Type, arg, opt};
use pcadlang_engine::lang::error::{Fault, FaultKind};
use pcadlang_engine::lang::value::{Record, Value};
use pcadlang_scene::vision::{AxisHint, Hint, Mask};
use std::borrow::Cow;

/// The argument `hint` of a function that looks for something in a photograph.
pub(super) const HINT: Arg = opt(
    "hint",
    Type::Record,
    "the photograph's own",
    "What to look for, a record as of `scene.hint`; what it does not name is not pointed out.",
);

pub(super) const TABLE: &[Row] = &[native(
    "hint",
    "Finding",
    &[arg("photo", IMAGE, "The photograph; nothing can be pointed out in a contour map.")],
    Type::Record,
    "What the user pointed out in a photograph (`--mask`, `--outline`, `--box`, `--axis`, `--at`, \
     `--not`), in its pixels from the top left corner: `drawn`, whether there is a mask or an \
     outline; `mask`, the mask or the inside of the outline, at the size of the photograph, empty \
     without them; `outline`, the corners [[x, y], …]; `box`, [x, y, width, height]; `axis`, \
     { foot: [x, y], top: [x, y], width }; `at` and `not`, positions [[x, y], …] on the object and \
     beside it. What was not pointed out is []: `if len(hint.box) > 0 { … }`.",
    |a| {
        let image = match a.values.first() {
            // The photograph is missing when a program is examined without its data.
            Some(Value::Unit) => return Ok(value(&Hint::default(), (1, 1))),
            _ => a.object::<ImageValue>(0, "an image")?,
        };
        let found = image
            .prepared()
            .get(image.hint().clone(), |hint: &Hint| Ok(value(hint, image.size())))?;
        Ok(Value::clone(&found))
    },
)];

/// The names of the fields.
const FIELDS: [&str; 7] = ["drawn", "mask", "outline", "box", "axis", "at", "not"];

/// Converts the hint of a photograph of `size` pixels to a record.
fn value(hint: &Hint, (width, height): (u32, u32)) -> Value {
    let (width, height) = (width.max(1), height.max(1));
    let drawn = hint.drawn(width, height);
    let given = Value::Bool(drawn.is_some());
    let mask = drawn
        .or_else(|| Mask::new(width, height, vec![false; width as usize * height as usize]).ok());
    let pair = |p: [f64; 2]| Value::array(p.to_vec());
    let pairs = |all: &[[f64; 2]]| Value::from_elements(all.iter().map(|p| pair(*p)).collect());
    let axis = hint.axis.map(|a| {
        Value::record([
            ("foot", pair(a.foot)),
            ("top", pair(a.top)),
            ("width", Value::Num(a.width)),
        ])
    });
    Value::record([
        ("drawn", given),
        ("mask", mask.map_or(Value::Unit, |m| Value::object(MaskValue::new(m)))),
        ("outline", pairs(&hint.outline)),
        ("box", Value::array(hint.bounds.map_or(Vec::new(), |b| b.to_vec()))),
        ("axis", axis.unwrap_or_else(|| Value::array([]))),
        ("at", pairs(&hint.at)),
        ("not", pairs(&hint.not)),
    ])
}

/// Returns the argument [`HINT`] of a call, or else the hint of the photograph.
///
/// # Errors
/// As [`from_value`].
pub(super) fn asked<'a>(a: &Args<'a>, image: &'a ImageValue) -> Result<Cow<'a, Hint>, Fault> {
    match a.is_written("hint") {
        true => from_value(a.get("hint"), image.size()).map(Cow::Owned),
        false => Ok(Cow::Borrowed(image.hint())),
    }
}

/// Reads a record as of `scene.hint`, for a photograph of `size` pixels. Missing fields are
/// nothing, as are [] and an empty mask.
///
/// # Errors
/// An unknown field, a field of another form, and as [`Hint::check`].
pub fn from_value(value: &Value, (width, height): (u32, u32)) -> Result<Hint, Fault> {
    let Value::Record(fields) = value else {
        let wanted = "a record such as { box: [x, y, width, height] }";
        return Err(Fault::type_error(format!("expected {wanted}, got {value}")));
    };
    if let Some(other) = fields.keys().find(|k| !FIELDS.contains(&&***k)) {
        let fault = Fault::type_error(format!("a hint has no field `{other}`"));
        return Err(fault.with_nearest(other, "its fields are", FIELDS.into_iter()));
    }
    let drawn = fields.get("mask").filter(|m| !is_nothing(m)).map(|m| {
        let mask = m.downcast::<MaskValue>().map(|m| m.mask.clone());
        mask.ok_or_else(|| wrong("mask", "a mask", m))
    });
    let hint = Hint {
        mask: drawn.transpose()?.filter(|m| m.data().contains(&true)),
        outline: positions(fields, "outline")?,
        bounds: numbers(fields, "box", "[x, y, width, height]")?,
        axis: axis(fields)?,
        at: positions(fields, "at")?,
        not: positions(fields, "not")?,
    };
    hint.check(width, height).map_err(|e| Fault::domain(e.to_string()))?;
    Ok(hint)
}

fn wrong(field: &str, wanted: &str, got: &Value) -> Fault {
    Fault::type_error(format!("`{field}` must be {wanted}, got {got}"))
}

fn is_nothing(v: &Value) -> bool {
    v.len() == Some(0)
}

/// Returns exactly `N` numbers.
fn exactly<const N: usize>(v: &Value) -> Option<[f64; N]> {
    match v {
        Value::Array(xs) => xs[..].try_into().ok(),
        _ => None,
    }
}

fn numbers<const N: usize>(
    fields: &Record,
    name: &str,
    wanted: &str,
) -> Result<Option<[f64; N]>, Fault> {
    let given = fields.get(name).filter(|v| !is_nothing(v));
    given.map(|v| exactly(v).ok_or_else(|| wrong(name, wanted, v))).transpose()
}

fn positions(fields: &Record, name: &str) -> Result<Vec<[f64; 2]>, Fault> {
    let Some(given) = fields.get(name) else { return Ok(Vec::new()) };
    let all = (0..given.len().unwrap_or(0)).map(|i| exactly(&given.element(i)?));
    match given {
        Value::List(_) | Value::Array(_) => all.collect(),
        _ => None,
    }
    .ok_or_else(|| wrong(name, "positions [[x, y], …]", given))
}

fn axis(fields: &Record) -> Result<Option<AxisHint>, Fault> {
    let Some(given) = fields.get("axis").filter(|v| !is_nothing(v)) else { return Ok(None) };
    let read = || {
        let Value::Record(parts) = given else { return None };
        let Value::Num(width) = *parts.get("width")? else { return None };
        let known = AxisHint {
            foot: exactly(parts.get("foot")?)?,
            top: exactly(parts.get("top")?)?,
            width,
        };
        (parts.len() == 3).then_some(known)
    };
    let wanted = "{ foot: [x, y], top: [x, y], width: pixels }";
    read().map(Some).ok_or_else(|| wrong("axis", wanted, given))
}

impl Program {
    /// Points out an object in the only photograph that was observed.
    ///
    /// # Errors
    /// If no photograph was observed, or several were, and as [`Hint::check`].
    pub fn hint(self, hint: Hint) -> Result<Program, Fault> {
        let fault = |why: String| Fault::new(FaultKind::Other, why);
        let photos = self.observed().filter_map(|(name, v)| {
            Some((name, v.downcast::<ImageValue>().filter(|i| i.as_photo().is_some())?))
        });
        let (name, image) = match photos.collect::<Vec<_>>()[..] {
            [(name, image)] => (name.to_owned(), image),
            [] => {
                return Err(
                    fault("a hint needs a photograph".to_owned()).with_hint("observe one before")
                );
            }
            ref several => {
                let names: Vec<&str> = several.iter().map(|(n, _)| *n).collect();
                let all = names.join(", ");
                return Err(fault(format!(
                    "a hint is about one photograph, and several are observed: {all}"
                )));
            }
        };
        let (width, height) = image.size();
        hint.check(width, height).map_err(|e| fault(e.to_string()))?;
        let hinted = Value::object(image.with_hint(hint));
        Ok(self.observe(&name, hinted))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(fields: &[(&str, Value)]) -> Result<Hint, Fault> {
        from_value(&Value::record(fields.iter().cloned()), (60, 40))
    }

    fn whole() -> Hint {
        Hint {
            outline: vec![[1.0, 1.0], [9.0, 1.0], [9.0, 9.0]],
            bounds: Some([1.0, 2.0, 30.0, 20.0]),
            axis: Some(AxisHint { foot: [5.0, 30.0], top: [6.0, 3.0], width: 8.0 }),
            at: vec![[3.0, 4.0], [5.0, 6.0]],
            not: vec![[50.0, 4.0]],
            ..Hint::default()
        }
    }

    #[test]
    fn a_record_comes_back_as_it_was() {
        let found = from_value(&value(&whole(), (60, 40)), (60, 40)).unwrap();
        // An outline comes back with its inside.
        assert_eq!(found.mask, whole().drawn(60, 40));
        assert_eq!(Hint { mask: None, ..found }, whole());
        let nothing = value(&Hint::default(), (60, 40));
        assert!(from_value(&nothing, (60, 40)).unwrap().is_empty());
        assert!(read(&[]).unwrap().is_empty());
        let numbers = |v: Vec<f64>| Value::array(v);
        let some = read(&[("box", numbers(vec![1.0, 2.0, 30.0, 20.0]))]).unwrap();
        assert_eq!(some, Hint { bounds: whole().bounds, ..Hint::default() });
    }

    #[test]
    fn other_records_are_errors() {
        let numbers = |v: &[f64]| Value::array(v.to_vec());
        let said = |name: &str, v: Value| {
            let fault = read(&[(name, v)]).unwrap_err();
            format!("{} {}", fault.message, fault.hint.unwrap_or_default())
        };
        for (name, v, problem) in [
            ("bax", numbers(&[]), "no field `bax` did you mean `box`?"),
            ("box", numbers(&[1.0, 2.0]), "`box` must be [x, y, width, height]"),
            ("box", numbers(&[1.0, 2.0, 0.0, 4.0]), "above 0"),
            ("at", numbers(&[1.0, 2.0]), "`at` must be positions"),
            ("at", Value::Num(1.0), "`at` must be positions"),
            ("not", Value::from_elements(vec![numbers(&[1.0, 99.0])]), "60 x 40"),
            ("axis", Value::record([("foot", numbers(&[1.0, 2.0]))]), "`axis` must be"),
            ("mask", Value::Num(1.0), "`mask` must be a mask"),
        ] {
            let said = said(name, v);
            assert!(said.contains(problem), "{said}");
        }
        assert!(from_value(&Value::Num(1.0), (60, 40)).is_err());
    }
}
