//! The plan of a program without an `infer` block. It depends on the kinds of the
//! program's choices, and is printed so that it can be copied.

use pcadlang_engine::trace::{ChoiceKind, Draws, Selector, Trace};

/// A gradient with choices summed out pays if it sums at most this many times as many
/// scores as a sweep of `gibbs` evaluates. On a tape a score takes a small part of the time
/// that `gibbs` takes for it, a transition needs several gradients, and a sum never mixes
/// worse than a sweep.
const SUM_PAYS: usize = 4;

/// The plan for a program, as program text, from the choices of several draws from its
/// prior: another draw may have choices that the first one lacks.
///
/// If the density has a gradient, `nuts` moves all continuous choices together. If a tape
/// can sum the finite choices out of the density at a similar cost as that of a sweep of
/// `gibbs`, `nuts` does so, otherwise they are left to that sweep; other choices are left
/// to kernels without gradients.
/// `nuts` and sweeps stay within one structure: if the structure depends on their
/// choices, single-site kernels are added that can change it.
pub fn default_plan(draws: &mut [Trace]) -> String {
    let mut count = |kind| {
        let of = |trace: &mut Trace| {
            let s = trace.select(&Selector::Kind(kind));
            trace.targets(s).len()
        };
        draws.iter_mut().map(of).max().unwrap_or(0)
    };
    let (continuous, discrete) = (count(ChoiceKind::Continuous), count(ChoiceKind::Discrete));
    let (finite, gaussian) = (count(ChoiceKind::Finite), count(ChoiceKind::Gaussian));
    if continuous + discrete == 0 {
        return "infer {\n  repeat 1000 { }\n}\n".into();
    }
    if continuous > 0 && draws.iter_mut().all(has_gradient) {
        let depends = |kind| draws.iter().any(|t: &Trace| t.structure_depends_on(kind));
        let (on_continuous, on_finite) =
            (depends(ChoiceKind::Continuous), depends(ChoiceKind::Finite));
        if finite > 0 && draws.iter_mut().all(sum_pays) {
            return with_gradient(
                "nuts($continuous, marginal = $finite)",
                (0, discrete - finite),
                on_continuous,
                false,
            );
        }
        with_gradient("nuts($continuous)", (finite, discrete - finite), on_continuous, on_finite)
    } else {
        without_gradient(continuous, discrete, finite, gaussian)
    }
}

/// Whether the density is differentiable with respect to the continuous choices.
fn has_gradient(trace: &mut Trace) -> bool {
    let selection = trace.select(&Selector::Kind(ChoiceKind::Continuous));
    let targets = trace.targets(selection).to_vec();
    trace.gradient(&targets, 1.0, &mut Vec::new()).is_ok()
}

/// Whether all finite choices can be summed out on a tape, and that costs little compared
/// with a sweep over them.
fn sum_pays(trace: &mut Trace) -> bool {
    let of = |kind, trace: &mut Trace| {
        let selection = trace.select(&Selector::Kind(kind));
        trace.targets(selection).to_vec()
    };
    let (moving, sites) = (of(ChoiceKind::Continuous, trace), of(ChoiceKind::Finite, trace));
    if moving.is_empty() || sites.is_empty() {
        return false;
    }
    let recording = trace.record_summed(&moving, &sites, Draws::default()).ok().flatten();
    recording.is_some_and(|r| {
        let (sum, sweep) = r.scores();
        sum <= SUM_PAYS * sweep
    })
}

/// The plan with a kernel for the continuous choices, and numbers of finite choices that
/// are left and of other discrete ones.
fn with_gradient(
    nuts: &str,
    (finite, unbounded): (usize, usize),
    on_continuous: bool,
    on_finite: bool,
) -> String {
    let mut pass = format!(" {nuts};");
    if on_continuous {
        pass += " mh(one($continuous));";
    }
    if finite > 0 {
        pass += " gibbs(each($finite));";
    }
    match finite {
        _ if !on_finite => {}
        0..4 => pass += " gibbs(one($finite));",
        _ => pass += &format!(" repeat {} {{ gibbs(one($finite)); }}", (finite / 2).min(50)),
    }
    if unbounded > 0 {
        pass += &format!(
            " repeat {} {{ mh(one($discrete - $finite)); drift(one($discrete - $finite)); }}",
            unbounded.min(50)
        );
    }
    format!(
        "infer {{\n  init(best_of(20));\n  warmup 1000 {{{pass} }}\n  repeat 1000 {{{pass} }}\n}}\n"
    )
}

fn without_gradient(continuous: usize, discrete: usize, finite: usize, gaussian: usize) -> String {
    let mut arms = Vec::new();
    if continuous > 0 {
        arms.push((5.0, "drift(one($continuous))"));
        if continuous > 1 {
            arms.push((2.0, "drift($continuous)"));
        }
        arms.push((0.5, "mh(one($continuous))"));
    }
    if gaussian > 0 {
        arms.push((
            1.5,
            if gaussian > 1 { "elliptical(one($gaussian))" } else { "elliptical($gaussian)" },
        ));
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
    let total: f64 = arms.iter().map(|(w, _)| w).sum();
    let arms: String = arms.iter().map(|(w, k)| format!(" {:.2} => {k};", w / total)).collect();
    let sweep = (continuous + discrete).clamp(10, 200);
    format!(
        "infer {{\n  init(best_of(20));\n  warmup {} {{ mix {{{arms} }} }}\n  repeat 1000 {{ repeat {sweep} {{ mix {{{arms} }} }} }}\n}}\n",
        (sweep * 200).min(20_000)
    )
}
