//! The numbers of a state that are tested: its choices by address, and the log joint
//! density.
//!
//! Invariant: a reading has one number for each name. A choice that a state does not have
//! reads as -infinity, below every value, so that readings are functions of the state
//! even if choices come and go.

use indexmap::IndexMap;
use pcadlang_engine::trace::{Selector, Trace};

/// The most numbers of choices that are tested: those that most states have.
const MOST: usize = 100;

#[derive(Debug)]
pub(super) struct Quantities {
    places: IndexMap<(u64, usize), usize>,
    /// The name of each number.
    pub names: Vec<String>,
    /// How many further numbers there are, beyond [`MOST`].
    pub left_out: usize,
}

impl Quantities {
    /// Collects the numbers that occur in several states.
    pub fn of<'a>(traces: impl Iterator<Item = &'a mut Trace>) -> Quantities {
        let mut found = IndexMap::new();
        for trace in traces {
            let all = trace.select(&Selector::All);
            for t in trace.targets(all) {
                let (hash, count) = (trace.address_hash(*t), trace.value(*t).numbers().len());
                for i in 0..count {
                    let entry =
                        found.entry((hash, i)).or_insert_with(|| (trace.address(*t), count, 0));
                    entry.1 = count.max(entry.1);
                    entry.2 += 1;
                }
            }
        }
        let mut found: Vec<_> = found.into_iter().collect();
        found.sort_by(|a, b| b.1.2.cmp(&a.1.2).then_with(|| (&a.1.0, a.0.1).cmp(&(&b.1.0, b.0.1))));
        let left_out = found.len().saturating_sub(MOST);
        found.truncate(MOST);
        found.sort_by(|a, b| (&a.1.0, a.0.1).cmp(&(&b.1.0, b.0.1)));
        let called = |(at, (address, count, _)): &(
            (u64, usize),
            (pcadlang_engine::trace::Address, usize, u32),
        )| {
            match count {
                1 => address.to_string(),
                _ => format!("{address}[{}]", at.1),
            }
        };
        let mut names: Vec<String> = found.iter().map(called).collect();
        names.push("log joint".into());
        let places = found.into_iter().enumerate().map(|(i, (at, _))| (at, i)).collect();
        Quantities { places, names, left_out }
    }

    /// Reads the numbers of a state.
    pub fn read(&self, trace: &mut Trace) -> Vec<f64> {
        let mut out = vec![f64::NEG_INFINITY; self.names.len()];
        let all = trace.select(&Selector::All);
        for t in trace.targets(all) {
            let hash = trace.address_hash(*t);
            if !self.places.contains_key(&(hash, 0)) {
                continue;
            }
            for (i, x) in trace.value(*t).numbers().into_iter().enumerate() {
                if let Some(place) = self.places.get(&(hash, i)).and_then(|k| out.get_mut(*k)) {
                    *place = if x.is_nan() { f64::NEG_INFINITY } else { x };
                }
            }
        }
        if let Some(last) = out.last_mut() {
            *last = trace.log_joint();
        }
        out
    }
}

/// The statistics of the data: the mean and the mean square of all observed numbers that
/// are finite.
pub(super) const OF_DATA: [&str; 2] = ["mean of the data", "mean square of the data"];

/// The statistics of a state's data; -infinity if no observed value is numeric.
pub(super) fn read_data(trace: &Trace) -> [f64; 2] {
    let (mut n, mut sums) = (0.0, [0.0; 2]);
    for o in trace.observed() {
        for x in o.value.numbers().into_iter().filter(|x| x.is_finite()) {
            n += 1.0;
            sums[0] += x;
            sums[1] += x * x;
        }
    }
    if n > 0.0 { sums.map(|s| s / n) } else { [f64::NEG_INFINITY; 2] }
}
