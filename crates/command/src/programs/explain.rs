//! `run --explain`: what was modelled, proposed, redrawn and skipped, and why.
//!
//! The cost of a proposal is measured: a choice of each group is proposed in the last
//! state of the first chain, and the proposal is then undone.

use pcadlang_engine::trace::{Draws, Target, Trace};
use pcadlang_inference::selecting;
use pcadlang_library::Model;
use pcadlang_numerics::rng::{Purpose, StreamKey};
use pcadlang_report::table::{COLUMNS, aligned};
use pcadlang_runs::job::Outcome;
use pcadlang_scene::render::{Work, work};
use pcadlang_syntax::span::{FileId, Span};
use serde_json::{Value, json};
use std::collections::{BTreeMap, HashSet};

/// How many proposals with rendering are made for each group; the first ones fill the
/// thread's caches of pictures.
const WANTED: u32 = 4;

/// The maximum number of proposals tried to get them: a choice that keeps its value does
/// not render anything.
const TRIES: u64 = 64;

/// Choices whose addresses differ only in keys.
struct Group {
    name: String,
    choices: usize,
    /// The kernels that select some of the choices.
    kernels: Vec<String>,
    /// The number of single-site proposals of the choices, and how many were accepted.
    alone: [u64; 2],
    /// The rendering work of one proposal; `None` if the proposal is impossible in this
    /// state.
    drawn: Option<Work>,
}

/// The explanation of a run.
pub struct Explanation {
    groups: Vec<Group>,
    observed: Vec<String>,
    /// The locations and source lines of choices that are absent from the state.
    absent: Vec<[String; 2]>,
}

/// Explains a run by the last state of its first chain.
pub fn explain(model: &Model, o: &Outcome, seed: u64) -> Explanation {
    let Some(first) = o.chains.first() else {
        return Explanation { groups: Vec::new(), observed: Vec::new(), absent: Vec::new() };
    };
    let mut trace = first.last.clone();
    let mut groups: BTreeMap<String, (Group, Vec<Target>)> = BTreeMap::new();
    for t in trace.all_targets().to_vec() {
        let name = without_keys(&trace.address(t).to_string());
        let new = || {
            let group = Group {
                name: name.clone(),
                choices: 0,
                kernels: Vec::new(),
                alone: [0; 2],
                drawn: None,
            };
            (group, Vec::new())
        };
        let (group, targets) = groups.entry(name.clone()).or_insert_with(new);
        group.choices += 1;
        targets.push(t);
    }
    for site in &o.sites {
        if let Some((group, _)) = groups.get_mut(&without_keys(&site.address)) {
            group.alone[0] += site.proposals;
            group.alone[1] += site.accepted;
        }
    }
    let plan = model.plan().map(|(plan, _)| plan).unwrap_or_default();
    for kernel in selecting(&plan, &mut trace) {
        let selection = trace.select(&kernel.selector);
        let chosen: HashSet<Target> = trace.targets(selection).iter().copied().collect();
        for (group, targets) in groups.values_mut() {
            if targets.iter().any(|t| chosen.contains(t)) {
                group.kernels.push(kernel.kernel.clone());
            }
        }
    }
    for (group, targets) in groups.values_mut() {
        group.drawn = targets.first().and_then(|t| drawn_by(&mut trace, *t, seed));
    }
    let own = model.sources().get(FileId(0)).map_or("", |file| file.name());
    let sources = model.sources();
    let line = |span: Span| {
        let file = sources.get(span.file)?;
        file.text()
            .get(file.line_range(file.line_index(span.start as usize)))
            .map(|line| line.trim().to_owned())
    };
    let written = |span| [sources.locate(span), line(span).unwrap_or_default()];
    let absent = trace
        .undrawn()
        .into_iter()
        .map(written)
        .filter(|[place, _]| place.strip_prefix(own).is_some_and(|rest| rest.starts_with(':')))
        .collect();
    let mut observed: Vec<String> =
        trace.observations().iter().map(|(a, _)| without_keys(&a.to_string())).collect();
    observed.sort();
    observed.dedup();
    Explanation { groups: groups.into_values().map(|(group, _)| group).collect(), observed, absent }
}

/// Measures the rendering work of a proposal of a choice, once caches are filled.
fn drawn_by(trace: &mut Trace, t: Target, seed: u64) -> Option<Work> {
    let (mut last, mut drawing): (Option<Work>, u32) = (None, 0);
    for step in 0..TRIES {
        let draws = Draws { key: StreamKey::new(seed, 0, Purpose::PREDICT), step, substream: 0 };
        let before = work();
        let done = trace.regenerate(&[t], draws).is_ok();
        trace.rollback();
        let spent = work() - before;
        let draws_some = spent.whole + spent.partial > 0;
        if done && (draws_some || drawing == 0) {
            last = Some(spent);
            drawing += u32::from(draws_some);
        }
        if drawing == WANTED {
            break;
        }
    }
    last
}

/// Removes the keys from an address.
fn without_keys(address: &str) -> String {
    let mut depth = 0;
    address
        .chars()
        .filter(|c| {
            depth += i32::from(*c == '[');
            let inside = depth > 0;
            depth -= i32::from(*c == ']');
            !inside
        })
        .collect()
}

fn count(n: u64, what: &str) -> String {
    let s = if n == 1 {
        ""
    } else if what.ends_with("sh") {
        "es"
    } else {
        "s"
    };
    format!("{n} {what}{s}")
}

impl Explanation {
    /// Formats the explanation for people.
    pub fn text(&self) -> String {
        let total: usize = self.groups.iter().map(|g| g.choices).sum();
        let mut text = format!("modelled: {}, compared with ", count(total as u64, "choice"));
        text += &if self.observed.is_empty() { "nothing".into() } else { self.observed.join(", ") };
        text += "\n\nproposed\n";
        let row = |g: &Group| {
            let alone = match g.alone {
                [0, _] => "-".into(),
                [n, accepted] => format!("{n}, {:.0}%", 100.0 * accepted as f64 / n as f64),
            };
            vec![format!("  {}", g.name), g.choices.to_string(), alone]
        };
        let head =
            ["  choices", "of them", "single-site proposals, accepted"].map(str::to_owned).to_vec();
        text +=
            &aligned(&std::iter::once(head).chain(self.groups.iter().map(row)).collect::<Vec<_>>());
        let mut by: BTreeMap<&[String], Vec<&str>> = BTreeMap::new();
        self.groups.iter().for_each(|g| by.entry(&g.kernels).or_default().push(&g.name));
        for (kernels, names) in by {
            let kernels = if kernels.is_empty() {
                "no kernel: the plan does not select them".into()
            } else {
                kernels.join(", ")
            };
            text += &wrapped(&format!("{} by {kernels}", names.join(", ")));
        }
        text += "\nredrawn, for one proposal of\n";
        for g in &self.groups {
            text += &wrapped(&format!("{}: {}", g.name, redrawn(g.drawn.as_ref())));
        }
        text += "\nskipped\n";
        let skipped = self.skipped();
        text += &if skipped.is_empty() {
            "  nothing\n".into()
        } else {
            skipped.iter().map(|s| wrapped(s)).collect::<String>()
        };
        text
    }

    /// Lists what was left out, and why.
    fn skipped(&self) -> Vec<String> {
        let absent = |[place, text]: &[String; 2]| {
            format!(
                "{place} `{text}`: not sampled, since no observation depends on it in this state"
            )
        };
        let mut all: Vec<String> = self.absent.iter().map(absent).collect();
        let most = |of: fn(&Work) -> u64| {
            self.groups.iter().filter_map(|g| g.drawn.as_ref().map(of)).max().unwrap_or(0)
        };
        let [closed, outside, hidden] =
            [most(|w| w.closed), most(|w| w.outside), most(|w| w.hidden)];
        if closed > 0 {
            all.push("back faces of closed bodies: hidden by the front faces".into());
        }
        if outside > 0 {
            all.push(format!("{}: outside the picture", count(outside, "mesh")));
        }
        if hidden > 0 {
            all.push(format!("{}: entirely hidden by stationary meshes", count(hidden, "mesh")));
        }
        all
    }

    /// Formats the explanation for programs.
    pub fn json(&self) -> Value {
        let drawn = |w: &Work| {
            json!({
                "pictures_whole": w.whole, "pictures_in_part": w.partial, "meshes_drawn": w.drawn,
                "meshes_kept": w.kept, "meshes_outside": w.outside, "meshes_hidden": w.hidden,
                "triangles": w.triangles, "triangles_of_closed_bodies": w.closed, "pixels": w.pixels,
            })
        };
        let group = |g: &Group| {
            json!({
                "address": g.name, "choices": g.choices, "kernels": g.kernels, "proposals": g.alone[0],
                "accepted": g.alone[1], "one_proposal_draws": g.drawn.as_ref().map(drawn),
            })
        };
        json!({
            "observed": self.observed,
            "choices": self.groups.iter().map(group).collect::<Vec<_>>(),
            "skipped": self.skipped(),
        })
    }
}

/// Describes the rendering work of one proposal.
fn redrawn(w: Option<&Work>) -> String {
    let Some(w) = w else { return "impossible in this state".into() };
    let pictures = w.whole + w.partial;
    if pictures == 0 {
        return format!("nothing redrawn in {TRIES} proposals");
    }
    let mut s = format!("{} drawn ({})", count(w.drawn, "mesh"), count(w.triangles, "triangle"));
    s += &format!(", {} kept", w.kept);
    s += &match (w.whole, w.partial) {
        (0, _) => format!(", in part of the picture ({})", count(w.pixels, "pixel")),
        (n, 0) => format!(", {} drawn at once", count(n, "picture")),
        (n, m) => format!(", {} drawn at once, {m} in part", count(n, "picture")),
    };
    s
}

/// Wraps and indents a paragraph.
fn wrapped(text: &str) -> String {
    let (mut out, mut line) = (String::new(), String::from(" "));
    for word in text.split(' ') {
        if line.chars().count() + 1 + word.chars().count() > COLUMNS && line.trim() != "" {
            out += &line;
            out.push('\n');
            line = "   ".into();
        }
        line.push(' ');
        line += word;
    }
    out + &line + "\n"
}
