//! The plan of a program without an `infer` block, chosen by the kinds of its choices and printed so that it can be copied.

use crate::trace::{ChoiceKind, Selector, Trace};

/// The plan for a program whose observations ask for these choices, as program text.
pub fn default_plan(trace: &mut Trace) -> String {
    let mut count = |kind| {
        let s = trace.select(&Selector::Kind(kind));
        trace.targets(s).len()
    };
    let (continuous, discrete) = (count(ChoiceKind::Continuous), count(ChoiceKind::Discrete));
    let (finite, gaussian) = (count(ChoiceKind::Finite), count(ChoiceKind::Gaussian));
    let mut arms = Vec::new();
    if continuous > 0 {
        arms.push((5.0, "drift(one($continuous))"));
        if continuous > 1 {
            arms.push((2.0, "drift($continuous)"));
        }
        arms.push((0.5, "mh(one($continuous))"));
    }
    if gaussian > 0 {
        arms.push((1.5, if gaussian > 1 { "elliptical(one($gaussian))" } else { "elliptical($gaussian)" }));
        if gaussian > 1 {
            arms.push((1.0, "elliptical($gaussian)"));
        }
    }
    if finite > 0 {
        arms.push((4.0, "gibbs(one($finite))"));
    }
    if discrete > finite {
        arms.push((3.0, "mh(one($discrete))"));
        arms.push((1.0, "drift(one($discrete))"));
    }
    let choices = continuous + discrete;
    if choices == 0 {
        return "infer {\n  repeat 1000 { }\n}\n".into();
    }
    let total: f64 = arms.iter().map(|(w, _)| w).sum();
    let arms: String = arms.iter().map(|(w, k)| format!(" {:.2} => {k};", w / total)).collect();
    let sweep = choices.clamp(10, 200);
    format!(
        "infer {{\n  init(best_of(20));\n  warmup {} {{ mix {{{arms} }} }}\n  repeat 1000 {{ repeat {sweep} {{ mix {{{arms} }} }} }}\n}}\n",
        (sweep * 200).min(20_000)
    )
}
