//! The plans run on a program: every kernel, groupings of the choices that are summed
//! out, the default plan, random mixes.

use super::posterior::Posterior;
use super::program::{Def, Dist, Effect, Item, Program};
use crate::common::kernels::random::{ANY, CONTINUOUS, DISCRETE, EXACT, REVERSIBLE, SUMMING};
use pcadlang_numerics::rng::Stream;

/// Statements, the declarations of kernels that they need, and the class in which their
/// draws are pooled.
#[derive(Clone)]
pub struct Plan {
    pub class: String,
    pub statements: String,
    pub kernels: String,
}

impl Plan {
    /// Returns the number of draws of a first test: fewer for expensive plans, so that
    /// more programs are tested.
    pub fn first_look(&self) -> u64 {
        if self.statements.contains("marginal") { 60 } else { 200 }
    }

    pub fn of(class: impl Into<String>, statements: impl Into<String>) -> Plan {
        Plan { class: class.into(), statements: statements.into(), kernels: String::new() }
    }
}

/// The largest number of joint values that are summed out.
const MOST_JOINT: usize = 24;

/// Returns the names of the observations that have surrogates, and whether these are flat.
fn with_surrogates(p: &Program) -> Vec<(String, bool)> {
    fn of(p: &Program, e: &Effect, into: &mut Vec<(String, bool)>) {
        match e {
            Effect::Observe(name, _, _, Some(coarse)) => {
                into.push((p.names[*name].clone(), matches!(coarse, Dist::Flat)));
            }
            Effect::Guarded(_, inner) => inner.iter().for_each(|e| of(p, e, into)),
            _ => {}
        }
    }
    let mut all = Vec::new();
    for item in &p.items {
        match item {
            Item::Effect(e) => of(p, e, &mut all),
            Item::Loop(_, _, effects) => effects.iter().for_each(|e| of(p, e, &mut all)),
            _ => {}
        }
    }
    all
}

/// Returns the plans to run on a program: a random few of each sort.
pub fn plans(p: &Program, posterior: &Posterior, default: &str, rng: &mut Stream) -> Vec<Plan> {
    let mut all: Vec<Plan> = Vec::new();
    let class = |s: &str| s.split_once('(').map_or(s, |(name, _)| name).to_owned();
    let mut some = |list: &[&str], n: usize, rng: &mut Stream| {
        for _ in 0..n {
            let k = list[rng.index(list.len())];
            all.push(Plan::of(class(k), k));
        }
    };
    some(ANY, 2, rng);
    some(DISCRETE, 1, rng);
    if posterior.has_continuous {
        some(CONTINUOUS, 2, rng);
    }
    // All groupings if there are one or two choices, otherwise the whole and a random
    // one; the cost of a step is proportional to the number of joint values.
    let sites: Vec<(&String, usize)> =
        posterior.discrete.iter().map(|(a, values)| (a, *values)).collect();
    if posterior.has_continuous && !sites.is_empty() {
        let whole = (1u64 << sites.len().min(60)) - 1;
        let groupings: Vec<u64> = match sites.len() {
            1 | 2 => (1..=whole).collect(),
            _ => [whole]
                .into_iter()
                .chain((0..1).map(|_| 1 + rng.index(whole as usize) as u64))
                .collect(),
        };
        for g in groupings {
            let (mut chosen, mut joint) = (Vec::new(), 1);
            let begin = rng.index(sites.len());
            for (i, (site, values)) in
                sites.iter().enumerate().cycle().skip(begin).take(sites.len())
            {
                if g >> i & 1 == 1 && joint * values <= MOST_JOINT {
                    joint *= values;
                    chosen.push(site.as_str());
                }
            }
            let k = SUMMING[rng.index(SUMMING.len())];
            all.push(Plan::of(
                format!("{} summing out", class(k)),
                k.replace('%', &chosen.join(" + ")),
            ));
        }
    }
    // Sums alone: nothing continuous is left to move.
    if !posterior.has_continuous && !sites.is_empty() {
        let (k, (site, _)) = (SUMMING[rng.index(SUMMING.len())], sites[rng.index(sites.len())]);
        all.push(Plan::of(format!("{} alone", class(k)), k.replace('%', site)));
    }
    if !sites.is_empty() {
        let (k, a, b) = (EXACT[rng.index(2)], rng.index(sites.len()), rng.index(sites.len()));
        let both = [sites[a].0.as_str(), sites[b].0.as_str()].join(" + ");
        all.push(Plan::of(class(k), k.replace('%', &both)));
    }
    let coarse = with_surrogates(p);
    if !coarse.is_empty() {
        let (k, at) = (REVERSIBLE[rng.index(REVERSIBLE.len())], rng.index(coarse.len()));
        let y = &coarse[at].0;
        all.push(Plan::of("delayed", format!("delayed({k}, @{y});")));
        if let Some((z, _)) = coarse.get(at + 1) {
            all.push(Plan::of("delayed", format!("delayed({k}, @{y}, then = @{z});")));
        }
    }
    if let Some(mut own) = own(p, posterior, rng) {
        // Other surrogates may not have all choices that it proposes.
        let mut flat = coarse.iter().filter(|c| c.1).map(|c| &c.0);
        if let Some(y) = flat.next().filter(|_| rng.uniform() < 0.5) {
            own.statements = match flat.next() {
                Some(z) => format!("delayed(moved(), @{y}, then = @{z});"),
                None => format!("delayed(moved(), @{y});"),
            };
        }
        all.push(own);
    }
    if rng.uniform() < 0.5 {
        let pool: Vec<String> =
            all.iter().map(|p| p.statements.trim_end_matches(';').to_owned()).collect();
        let kernels: String = all.iter().map(|p| &*p.kernels).collect();
        let arm = |rng: &mut Stream| {
            format!("{:?} => {};", 0.2 + rng.uniform(), pool[rng.index(pool.len())])
        };
        let arms: String = (0..2 + rng.index(3)).map(|_| arm(rng) + " ").collect();
        all.push(Plan { kernels, ..Plan::of("mix", format!("repeat 2 {{ mix {{ {arms}}} }}")) });
    }
    all.push(Plan::of("default plan", default));
    all
}

/// Returns a plan with a kernel declared in the program: it proposes one or two top-level
/// choices that always exist, depending on their present values, which it reads as values or
/// by the names of the program.
fn own(p: &Program, posterior: &Posterior, rng: &mut Stream) -> Option<Plan> {
    let mut proposals = Vec::new();
    for item in &p.items {
        let Item::Def(Def::Draw(n, d)) = item else { continue };
        let at = format!("@{}", p.names[*n]);
        if !posterior.is_always_there(&at) {
            continue;
        }
        let tenths = |from: usize, rng: &mut Stream| (from + rng.index(8)) as f64 / 10.0;
        let (a, b, c) = (tenths(1, rng), tenths(1, rng), tenths(4, rng));
        let now = if rng.uniform() < 0.5 { format!("value({at})") } else { p.names[*n].clone() };
        proposals.push(match d {
            Dist::Flip(_) => format!("propose {at} ~ flip({a:?});"),
            Dist::Normal(..) => {
                format!("propose {at} ~ normal({a:?} * {now} + {b:?}, {c:?});")
            }
            Dist::Categorical(values) => {
                let others = format!(", {b:?}, {c:?}");
                let others = if values.len() == 2 { &others[..others.len() / 2] } else { &others };
                format!("propose {at} ~ categorical([{a:?} + {now}{others}]);")
            }
            _ => continue,
        });
    }
    if proposals.is_empty() {
        return None;
    }
    let first = rng.index(proposals.len());
    let mut body = proposals.swap_remove(first);
    if !proposals.is_empty() && rng.uniform() < 0.5 {
        body += &format!(" {}", proposals[rng.index(proposals.len())]);
    }
    Some(Plan {
        kernels: format!("kernel moved() {{ {body} }}\n"),
        ..Plan::of("own kernel", "moved();")
    })
}
