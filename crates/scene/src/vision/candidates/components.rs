//! Connected pixels of the same label.

/// Pixels of the same label, one after the other in a row; `end` is one past the last.
#[derive(Clone, Copy)]
struct Run<L> {
    start: usize,
    end: usize,
    label: L,
}

/// Returns the component number of every pixel of a picture of width `w`, and the sizes of
/// the components: 4-connected pixels of the same label, numbered in the order of their first
/// pixels.
pub fn components<L: Copy + PartialEq>(w: usize, labels: &[L]) -> (Vec<u32>, Vec<usize>) {
    let mut runs: Vec<Run<L>> = Vec::new();
    // Trees of runs, each below an earlier one; the root is the first of its component.
    let mut tree: Vec<u32> = Vec::new();
    let mut above = 0..0;
    for (j, row) in labels.chunks(w.max(1)).enumerate() {
        let first = runs.len();
        let mut start = j * w;
        for same in row.chunk_by(PartialEq::eq) {
            runs.push(Run { start, end: start + same.len(), label: same[0] });
            tree.push(tree.len() as u32);
            start += same.len();
        }
        let (mut a, mut b) = (above.start, first);
        while a < above.end && b < runs.len() {
            let (upper, lower) = (runs[a], runs[b]);
            if upper.label == lower.label {
                let roots = [root(&mut tree, a as u32), root(&mut tree, b as u32)];
                tree[roots[0].max(roots[1]) as usize] = roots[0].min(roots[1]);
            }
            // The one that ends first touches nothing further; of two that end together, both.
            a += usize::from(upper.end + w <= lower.end);
            b += usize::from(lower.end <= upper.end + w);
        }
        above = first..runs.len();
    }
    let (mut of, mut sizes) = (Vec::with_capacity(labels.len()), Vec::new());
    for (r, run) in runs.iter().enumerate() {
        // What a run is below was numbered before.
        tree[r] = match tree[r] as usize {
            root if root == r => {
                sizes.push(0);
                sizes.len() as u32 - 1
            }
            earlier => tree[earlier],
        };
        of.resize(run.end, tree[r]);
        sizes[tree[r] as usize] += run.end - run.start;
    }
    (of, sizes)
}

/// Returns the root of a run's tree, and halves the way to it.
fn root(tree: &mut [u32], mut r: u32) -> u32 {
    while tree[r as usize] != r {
        let next = tree[tree[r as usize] as usize];
        tree[r as usize] = next;
        r = next;
    }
    r
}
