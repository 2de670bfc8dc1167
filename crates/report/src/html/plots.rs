//! The draws of the page's plots, small enough to lie in the page: 16 bits each between
//! the smallest and the largest, compressed. `web/src/embedded_draws.ts` reads them.

use crate::Quantity;
use crate::embedded::packed;
use serde_json::{Value, json};

/// The program that draws the plots, bundled ahead from `web/`.
const PROGRAM: &str = include_str!("../../../../web/dist/plots.js");
/// The maximum number of draws of a chain that lie in the page.
const DRAWS: usize = 1000;
/// Stands for a draw that is not finite.
const NOT_FINITE: u16 = u16::MAX;

/// Returns a draw as a step between two ends. The values are halved so that the largest
/// doubles do not overflow.
fn step(x: f64, (lo, hi): (f64, f64)) -> u16 {
    if !x.is_finite() {
        return NOT_FINITE;
    }
    let share = (0.5 * x - 0.5 * lo) / (0.5 * hi - 0.5 * lo);
    (share.clamp(0.0, 1.0) * f64::from(NOT_FINITE - 1)).round() as u16
}

/// Returns the draws as the page reads them; longer chains are thinned.
fn data(quantities: &[Quantity]) -> Value {
    let longest = quantities.iter().flat_map(|q| &q.chains).map(Vec::len).max().unwrap_or(0);
    let every = longest.div_ceil(DRAWS).max(1);
    let quantity = |q: &Quantity| {
        let all = || q.chains.iter().flatten().copied().filter(|x| x.is_finite());
        let ends = (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
        let chain = |xs: &Vec<f64>| {
            let steps = xs.iter().step_by(every).flat_map(|x| step(*x, ends).to_le_bytes());
            packed(&steps.collect::<Vec<_>>())
        };
        let chains: Vec<String> = q.chains.iter().map(chain).collect();
        json!({ "low": ends.0, "high": ends.1, "chains": chains })
    };
    json!({ "every": every, "quantities": quantities.iter().map(quantity).collect::<Vec<_>>() })
}

/// Returns the draws and the program that fills the elements of the class `plots`, in
/// order.
pub(super) fn scripts(quantities: &[Quantity]) -> String {
    // Within a script, `</` could end it.
    let (data, program) = (data(quantities), PROGRAM.replace("</script", "<\\/script"));
    format!(
        "<noscript>The plots need JavaScript.</noscript>\n\
         <script type=\"application/json\" id=\"plot-data\">{data}</script>\n\
         <script>\n{program}</script>\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::embedded::tests::unpacked;

    fn steps(chains: Vec<Vec<f64>>) -> (Value, Vec<Vec<u16>>) {
        let q = Quantity::new("x", None, chains);
        let all = data(&[q]);
        let chains = all["quantities"][0]["chains"].as_array().unwrap();
        let read = |chain: &Value| {
            unpacked(chain).chunks(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect()
        };
        let steps = chains.iter().map(read).collect();
        (all, steps)
    }

    #[test]
    fn draws_are_steps_between_their_ends() {
        let (all, read) = steps(vec![vec![1.0, f64::NAN, 3.0], vec![2.0, f64::INFINITY]]);
        assert_eq!(read, [vec![0, NOT_FINITE, 65534], vec![32767, NOT_FINITE]]);
        assert_eq!((&all["every"], &all["quantities"][0]["high"]), (&json!(1), &json!(3.0)));
        assert_eq!(steps(vec![vec![-f64::MAX, 0.0, f64::MAX]]).1, [[0, 32767, 65534]]);
        // Equal draws, and none.
        assert_eq!(steps(vec![vec![2.0; 2], vec![]]).1, [vec![0; 2], vec![]]);
        assert!(steps(vec![vec![f64::NAN]]).0["quantities"][0]["low"].is_null());
    }

    #[test]
    fn long_chains_are_thinned() {
        let (all, read) = steps(vec![(0..2500).map(f64::from).collect(), vec![500.0; 10]]);
        assert_eq!((&all["every"], read[0].len(), read[1].len()), (&json!(3), 834, 4));
    }
}
