//! Whether the object of a photograph was found: how well the best scene fits the outlines
//! that the picture itself suggests, in two dimensions. Chains agree where the fit is wrong,
//! too; the outlines err in other ways than they do (docs/measurements/objects.md).

use pcadlang_library::scene::places::Place;
use pcadlang_scene::vision::Mask;
use serde_json::{Value, json};
use std::fmt;

/// Returns the sentence of the verdict in a `run.json`, if it has one.
pub fn sentence(run: &Value) -> Option<&str> {
    run["found"]["text"].as_str()
}

/// An object was found if its fit, the overlap of outlines, and the agreement of chains are
/// at least these.
const FOUND: [f64; 3] = [0.9, 0.86, 0.8];
/// The same of a region of the picture, which has one outline, of its own.
const REGION: [f64; 3] = [0.93, 1.0, 0.85];
/// It was not found if the fit is below this, or below the next one while chains agree on
/// less than the last one.
const NOT_FOUND: [f64; 3] = [0.7, 0.9, 0.2];

/// Whether an object was found.
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
    /// What points to the place where the object was fitted ([`Place::source`]).
    pub source: String,
    /// The overlap (intersection over union) of the object with the nearest outline there.
    pub fit: f64,
    /// The overlap of the first two outlines with each other; 1 for a single one.
    pub outlines: f64,
    /// The fraction of covered pixels on which the chains' last states agree.
    pub chains: Option<f64>,
}

impl Judgement {
    /// Judges the pixels of the best scene by the places where the object may be; `None` if
    /// nothing suggests an outline.
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
        Some(Judgement { verdict, source: place.source.clone(), fit, outlines, chains })
    }

    /// Returns it for `run.json`, with the sentence that says it as `text`.
    pub fn json(&self) -> Value {
        json!({
            "verdict": self.verdict.name(), "source": self.source, "fit": self.fit,
            "outlines": self.outlines, "chains": self.chains, "text": self.to_string(),
        })
    }
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
        let name = self.verdict.name();
        let place = match &*self.source {
            "drawn" => "the outline that was drawn".into(),
            "axis" | "box" => format!("the outlines that fit the {}", self.source),
            "region" => "a region of the picture, in which no detector sees anything".into(),
            class => format!("the outlines of a {class} that a detector sees"),
        };
        write!(f, "{name}: the object covers {:.0}% of {place}", 100.0 * self.fit)?;
        if self.outlines < FOUND[1] {
            write!(f, ", which overlap by only {:.0}%", 100.0 * self.outlines)?;
        }
        if let Some(chains) = self.chains {
            write!(f, ", and chains agree on {:.0}%", 100.0 * chains)?;
        }
        if self.verdict != Verdict::Found {
            write!(f, " (say where it is: --box X,Y,W,H, --outline X,Y X,Y X,Y …)")?;
        }
        Ok(())
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
