//! "Did you mean …?": the known name most similar to an unknown one.

/// Returns the candidate most similar to `name`, if it is similar enough to be a likely
/// typo.
///
/// The distance is the restricted Damerau–Levenshtein distance (optimal string
/// alignment): insertions, deletions, substitutions and swaps of neighbours cost 1 each;
/// differences in case are free. It may be at most a third of the longer name's length,
/// rounded down, so names of up to two letters must match except for case. Ties go to the
/// earlier candidate.
pub fn nearest<'a, I>(name: &str, candidates: I) -> Option<&'a str>
where
    I: IntoIterator<Item = &'a str>,
{
    let wanted = letters(name);
    let mut best: Option<(usize, &str)> = None;
    for candidate in candidates {
        let letters = letters(candidate);
        let limit = wanted.len().max(letters.len()) / 3;
        if wanted.len().abs_diff(letters.len()) > limit {
            continue;
        }
        let distance = distance(&wanted, &letters);
        if distance <= limit && best.is_none_or(|(least, _)| distance < least) {
            best = Some((distance, candidate));
        }
    }
    best.map(|(_, candidate)| candidate)
}

fn letters(name: &str) -> Vec<char> {
    // Bounds the cost; names that are longer than this are not typos of known ones.
    name.chars().take(128).flat_map(char::to_lowercase).collect()
}

fn distance(a: &[char], b: &[char]) -> usize {
    // Three rows of the dynamic programming table: i - 2, i - 1 and i.
    let mut before: Vec<usize> = vec![0; b.len() + 1];
    let mut last: Vec<usize> = (0..=b.len()).collect();
    let mut row = last.clone();
    for i in 1..=a.len() {
        row[0] = i;
        for j in 1..=b.len() {
            let substitute = last[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            let mut least = substitute.min(last[j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                least = least.min(before[j - 2] + 1);
            }
            row[j] = least;
        }
        std::mem::swap(&mut before, &mut last);
        std::mem::swap(&mut last, &mut row);
    }
    last[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The textbook recursion, exponential in time.
    fn slow(a: &[char], b: &[char]) -> usize {
        match (a, b) {
            ([], _) => b.len(),
            (_, []) => a.len(),
            ([a0, a @ ..], [b0, b @ ..]) => {
                let mut least =
                    (slow(a, b) + usize::from(a0 != b0)).min(slow(a, &[&[*b0], b].concat()) + 1);
                least = least.min(slow(&[&[*a0], a].concat(), b) + 1);
                match (a, b) {
                    ([a1, a @ ..], [b1, b @ ..]) if a0 == b1 && a1 == b0 => {
                        least.min(slow(a, b) + 1)
                    }
                    _ => least,
                }
            }
        }
    }

    #[test]
    fn distance_equals_the_textbook_recursion() {
        let words = [
            "", "a", "ab", "ba", "abc", "acb", "cab", "bca", "aab", "abab", "baba", "abcd", "dcba",
            "bacd",
        ];
        for a in words {
            for b in words {
                assert_eq!(
                    distance(&letters(a), &letters(b)),
                    slow(&letters(a), &letters(b)),
                    "{a} {b}"
                );
            }
        }
    }

    #[test]
    fn slips_are_found_and_strangers_are_not() {
        let known = ["normal", "uniform", "log_joint", "sigma", "S_L", "view", "at"];
        let hint = |name| nearest(name, known);
        assert_eq!(hint("nomral"), Some("normal"));
        assert_eq!(hint("Normal"), Some("normal"));
        assert_eq!(hint("unifrom"), Some("uniform"));
        assert_eq!(hint("logjoint"), Some("log_joint"));
        assert_eq!(hint("S_R"), Some("S_L"));
        assert_eq!(hint("veiw"), Some("view"));
        assert_eq!(hint("x"), None);
        assert_eq!(hint("it"), None, "two letters: everything would be near");
        assert_eq!(hint("gamma"), None);
        assert_eq!(hint(""), None);
    }

    #[test]
    fn ties_go_to_the_earlier_candidate() {
        assert_eq!(nearest("abx", ["abc", "abd"]), Some("abc"));
        assert_eq!(nearest("abx", ["abd", "abc"]), Some("abd"));
    }
}
