//! Log densities of the pixels of a depth map, kept from one rendered map to the next.
//!
//! Invariant: the sum is that of a new tally, bit for bit: each run of pixels has a sum of
//! its own, which is added anew where a pixel has changed.

use super::DepthLikelihood;

/// Number of pixels whose sum is kept.
const RUN: usize = 64;

/// The rendered depths and the log density at each pixel. Belongs to one likelihood.
#[derive(Debug, Clone, Default)]
pub struct DepthTally {
    rendered: Vec<f32>,
    logs: Vec<f64>,
    /// By run of pixels.
    sums: Vec<f64>,
}

impl DepthTally {
    /// The sum of the log densities, computed where the rendered depth has changed.
    pub(super) fn follow(&mut self, likelihood: &DepthLikelihood, rendered: &[f32]) -> f64 {
        let known = self.rendered.len() == rendered.len();
        if !known {
            self.rendered = rendered.to_vec();
            self.logs = vec![0.0; rendered.len()];
            self.sums = vec![0.0; rendered.len().div_ceil(RUN)];
        }
        let observed = likelihood.observed.data.chunks(RUN);
        let lists = self.rendered.chunks_mut(RUN).zip(rendered.chunks(RUN)).zip(observed);
        let kept = self.logs.chunks_mut(RUN).zip(&mut self.sums);
        for (((before, now), observed), (logs, sum)) in lists.zip(kept) {
            let differs = |(a, b): (&f32, &f32)| u32::from(a.to_bits() != b.to_bits());
            if known && before.iter().zip(now).map(differs).sum::<u32>() == 0 {
                continue;
            }
            for (((before, now), observed), log) in
                before.iter_mut().zip(now).zip(observed).zip(&mut *logs)
            {
                if !known || before.to_bits() != now.to_bits() {
                    *before = *now;
                    *log = likelihood.log_density(f64::from(*observed), f64::from(*now));
                }
            }
            *sum = logs.iter().sum();
        }
        self.sums.iter().sum()
    }
}
