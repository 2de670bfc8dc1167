//! Whether what a photograph shows was found: how well the best scene fits the outlines
//! that the picture itself suggests, in two dimensions, or the person that networks see there.
//! Chains agree where the fit is wrong, too; the outlines err in other ways than they do
//! (docs/measurements/objects.md, docs/measurements/people.md).

use crate::people::{BODY, inside};
use pcadlang_detectors::people::Person;
use pcadlang_library::scene::places::Place;
use pcadlang_scene::vision::Mask;
use serde_json::{Map, Value, json};
use std::fmt;

/// Returns the sentence of the verdict in a `run.json`, if it has one.
pub fn sentence(run: &Value) -> Option<&str> {
    run["found"]["text"].as_str()
}

/// Returns how doubtful what a `run.json` says of its picture is, 0 to 1, if it has a verdict: the
/// verdict, then the fit.
pub fn doubt(run: &Value) -> Option<f64> {
    let name = run["found"]["verdict"].as_str()?;
    let rank = [Verdict::Found, Verdict::Perhaps, Verdict::NotFound].map(Verdict::name);
    let rank = rank.iter().position(|r| *r == name)? as f64;
    Some((rank + 1.0 - run["found"]["fit"].as_f64().unwrap_or(0.0)) / 3.0)
}

/// An object was found if its fit, the overlap of outlines, and the agreement of chains are
/// at least these.
const FOUND: [f64; 3] = [0.9, 0.86, 0.8];
/// The same of a region of the picture, which has one outline, of its own.
const REGION: [f64; 3] = [0.93, 1.0, 0.85];
/// It was not found if the fit is below this, or below the next one while chains agree on
/// less than the last one.
const NOT_FOUND: [f64; 3] = [0.7, 0.9, 0.2];

/// A person was found if the networks' confidence, and the overlap of the body with their mask of
/// the person, are at least these, half of the body's joints are in the picture, and most views
/// agree.
const PERSON: [f64; 2] = [0.45, 0.55];
/// A person was not found if the overlap is below this.
const NO_PERSON: f64 = 0.25;

/// Whether something was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It was.
    Found,
    /// It may have been.
    Perhaps,
    /// It was not.
    NotFound,
}

/// A verdict with its reasons.
#[derive(Clone, Debug, PartialEq)]
pub struct Judgement {
    /// The verdict.
    pub verdict: Verdict,
    /// It in a sentence.
    pub text: String,
    /// What it is based on, by name.
    reasons: Map<String, Value>,
}

impl Judgement {
    /// Judges the pixels of the best scene by the places where the object may be; `None` if
    /// nothing suggests an outline. `chains` is the fraction of covered pixels on which the
    /// chains' last states agree.
    pub fn of(object: &Mask, places: &[Place], chains: Option<f64>) -> Option<Judgement> {
        let fits = places.iter().flat_map(|p| p.masks.iter().map(move |m| (p, m.overlap(object))));
        let (place, fit) = fits.max_by(|a, b| a.1.total_cmp(&b.1))?;
        let outlines = match &place.masks[..] {
            [a, b, ..] => a.overlap(b),
            _ => 1.0,
        };
        let agreement = chains.unwrap_or(1.0);
        let least = if place.source == "region" { REGION } else { FOUND };
        let sure = [fit, outlines, agreement].iter().zip(least).all(|(x, least)| *x >= least);
        let [poor, weak, apart] = NOT_FOUND;
        let verdict = if sure {
            Verdict::Found
        } else if fit < poor || fit < weak && agreement < apart {
            Verdict::NotFound
        } else {
            Verdict::Perhaps
        };
        let there = match &*place.source {
            "drawn" => "the outline that was drawn".into(),
            "axis" | "box" => format!("the outlines that fit the {}", place.source),
            "region" => "a region of the picture, in which no detector sees anything".into(),
            class => format!("the outlines of a {class} that a detector sees"),
        };
        let mut text = format!("the object covers {} of {there}", percent(fit));
        if outlines < FOUND[1] {
            text += &format!(", which overlap by only {}", percent(outlines));
        }
        if let Some(chains) = chains {
            text += &format!(", and chains agree on {}", percent(chains));
        }
        if verdict != Verdict::Found {
            text += " (say where it is: --box X,Y,W,H, --outline X,Y X,Y X,Y …)";
        }
        let reasons = [
            ("source", json!(place.source)),
            ("fit", json!(fit)),
            ("outlines", json!(outlines)),
            ("chains", json!(chains)),
        ];
        Some(Judgement::new(verdict, &text, reasons))
    }

    /// Judges the pixels of a body by the person whose it is in a photograph of some size,
    /// pixels.
    pub fn of_person(body: &Mask, person: &Person, size: (u32, u32)) -> Judgement {
        let (width, height) = (body.width(), body.height());
        let mask = person.mask(width, height, size.0).into_iter().map(|m| m > 0.5).collect();
        let fit = Mask::new(width, height, mask).map_or(0.0, |m| m.overlap(body));
        let inside = inside(person, size);
        let [sure, covered] = PERSON;
        let verdict = if fit < NO_PERSON {
            Verdict::NotFound
        } else if person.sure >= sure
            && fit >= covered
            && 2 * inside >= BODY.len()
            && 2 * person.agreeing > person.views
        {
            Verdict::Found
        } else {
            Verdict::Perhaps
        };
        let mut text = format!(
            "the networks' confidence is {}, and the body covers {} of the person they see",
            percent(person.sure),
            percent(fit)
        );
        if 2 * inside < BODY.len() {
            text += &format!("; only {inside} of {} joints are in the picture", BODY.len());
        }
        if 2 * person.agreeing <= person.views {
            text += &format!("; {} of {} views agree", person.agreeing, person.views);
        }
        if verdict != Verdict::Found {
            text += " (say where the person is: --box X,Y,W,H or --at X,Y)";
        }
        let reasons = [
            ("source", json!("person")),
            ("sure", json!(person.sure)),
            ("fit", json!(fit)),
            ("inside", json!(inside)),
            ("views", json!(person.views)),
            ("agreeing", json!(person.agreeing)),
        ];
        Judgement::new(verdict, &text, reasons)
    }

    /// Says that no person was found, so that nothing was fitted.
    pub fn nobody(why: &str) -> Judgement {
        Judgement::new(Verdict::NotFound, why, [("source", json!("person"))])
    }

    fn new<const N: usize>(verdict: Verdict, why: &str, reasons: [(&str, Value); N]) -> Judgement {
        let reasons = reasons.into_iter().map(|(name, value)| (name.to_owned(), value)).collect();
        Judgement { verdict, text: format!("{}: {why}", verdict.name()), reasons }
    }

    /// Returns it for `run.json`, with the sentence that says it as `text`.
    pub fn json(&self) -> Value {
        let mut all = self.reasons.clone();
        all.insert("verdict".into(), json!(self.verdict.name()));
        all.insert("text".into(), json!(self.text));
        Value::Object(all)
    }
}

fn percent(fraction: f64) -> String {
    format!("{:.0}%", 100.0 * fraction)
}

impl Verdict {
    fn name(self) -> &'static str {
        match self {
            Verdict::Found => "found",
            Verdict::Perhaps => "perhaps found",
            Verdict::NotFound => "not found",
        }
    }
}

impl fmt::Display for Judgement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A mask of 20 x 10 pixels that is on from column `a` to before column `b`.
    fn columns(a: usize, b: usize) -> Mask {
        Mask::new(20, 10, (0..200).map(|i| (a..b).contains(&(i % 20))).collect()).unwrap()
    }

    fn place(source: &str, masks: Vec<Mask>) -> Place {
        Place { score: 0.5, source: source.into(), bounds: None, masks, axes: Vec::new() }
    }

    #[test]
    fn the_outline_that_fits_best_decides() {
        let object = columns(0, 10);
        let judge = |places: &[Place]| Judgement::of(&object, places, None).map(|j| j.verdict);
        assert_eq!(judge(&[]), None);
        assert_eq!(judge(&[place("region", vec![])]), None);
        let other = place("bowl", vec![columns(12, 20)]);
        assert_eq!(judge(std::slice::from_ref(&other)), Some(Verdict::NotFound));
        let cup = place("cup", vec![columns(0, 9), columns(0, 10)]);
        assert_eq!(judge(&[other, cup]), Some(Verdict::Found));
        assert_eq!(judge(&[place("cup", vec![columns(0, 14)])]), Some(Verdict::Perhaps));
        let contrary = place("cup", vec![columns(0, 8), columns(0, 12)]);
        assert_eq!(judge(&[contrary]), Some(Verdict::Perhaps));
        assert_eq!(judge(&[place("region", vec![columns(0, 11)])]), Some(Verdict::Perhaps));
        assert_eq!(judge(&[place("region", vec![columns(0, 10)])]), Some(Verdict::Found));
        let judge = |object: &Mask, chains| {
            let places = [place("cup", vec![columns(0, 10)])];
            Judgement::of(object, &places, Some(chains)).map(|j| j.verdict)
        };
        assert_eq!(judge(&object, 0.9), Some(Verdict::Found));
        assert_eq!(judge(&object, 0.5), Some(Verdict::Perhaps));
        assert_eq!(judge(&columns(0, 8), 0.1), Some(Verdict::NotFound));
    }
}
