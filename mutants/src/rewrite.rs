//! Rewrites a file with its mutants built in: `(if on(7) { changed } else { original })`,
//! nested where mutants are nested.

use crate::find::Mutant;
use std::ops::Range;

/// Returns the text of a file with these numbered mutants built in, and the resulting
/// range of each.
pub fn rewritten(text: &str, mutants: &[(usize, &Mutant)]) -> (String, Vec<(Range<usize>, usize)>) {
    let mut r = Rewrite { text, out: String::with_capacity(text.len() * 2), places: Vec::new() };
    let mut sorted = mutants.to_vec();
    sorted.sort_by_key(|(_, m)| (m.range.start, std::cmp::Reverse(m.range.end)));
    r.range(0..text.len(), &sorted, &[]);
    (r.out, r.places)
}

struct Rewrite<'a> {
    text: &'a str,
    out: String,
    places: Vec<(Range<usize>, usize)>,
}

impl Rewrite<'_> {
    /// Writes a range with the mutants in it, which are sorted, outer ones first. Some
    /// parts are replaced; mutants that overlap these are left out.
    fn range(
        &mut self,
        range: Range<usize>,
        mutants: &[(usize, &Mutant)],
        replaced: &[(Range<usize>, String)],
    ) {
        let mut at = range.start;
        let mut rest = mutants;
        loop {
            let next_part = replaced.iter().find(|(r, _)| r.start >= at && r.end <= range.end);
            let next = rest.iter().position(|(_, m)| m.range.start >= at);
            let mutant = next.map(|i| (i, rest[i]));
            match (next_part, mutant) {
                (Some((part, new)), m)
                    if m.is_none_or(|(_, (_, m))| part.start <= m.range.start) =>
                {
                    self.out.push_str(&self.text[at..part.start]);
                    self.out.push_str(new);
                    at = part.end;
                    if part.is_empty() {
                        return self.range_after(at..range.end, rest, replaced, part);
                    }
                }
                (_, Some((i, (id, m)))) => {
                    self.out.push_str(&self.text[at..m.range.start]);
                    let inside: Vec<(usize, &Mutant)> = rest[i + 1..]
                        .iter()
                        .filter(|(_, o)| o.range.end <= m.range.end)
                        .copied()
                        .collect();
                    let begin = self.out.len();
                    self.out.push_str(&format!("(if crate::mutation::on({id}) {{ "));
                    // A mutant inside must not hide the replacement.
                    let beside = |o: &Mutant| {
                        let meets =
                            |r: &Range<usize>| o.range.start < r.end && r.start < o.range.end;
                        !m.replaced.iter().any(|(r, _)| meets(r))
                    };
                    let others: Vec<_> =
                        inside.iter().filter(|(_, o)| beside(o)).copied().collect();
                    self.range(m.range.clone(), &others, &m.replaced);
                    self.out.push_str(" } else { ");
                    self.range(m.range.clone(), &inside, &[]);
                    self.out.push_str(" })");
                    self.places.push((begin..self.out.len(), id));
                    at = m.range.end;
                    rest = &rest[i + 1..];
                }
                _ => break,
            }
        }
        self.out.push_str(&self.text[at..range.end]);
    }

    /// Continues after an insertion.
    fn range_after(
        &mut self,
        range: Range<usize>,
        mutants: &[(usize, &Mutant)],
        replaced: &[(Range<usize>, String)],
        done: &Range<usize>,
    ) {
        let later: Vec<_> =
            replaced.iter().filter(|(r, _)| r.start > done.start).cloned().collect();
        self.range(range, mutants, &later);
    }
}
