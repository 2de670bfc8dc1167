//! Moments of recorded quantities, available while a chain runs.

use indexmap::IndexMap;
use pcadlang_inference::draws::{Column, DrawRow, Sink};
use pcadlang_workbench::score::Normal;
use std::io;
use std::sync::{Arc, Mutex, PoisonError};

/// The number of draws so far, their means, and sums of squared deviations (Welford
/// 1962).
#[derive(Clone, Debug, Default)]
pub struct RunningSums {
    names: Vec<String>,
    count: f64,
    mean: Vec<f64>,
    squares: Vec<f64>,
}

/// A sink that accumulates moments. Clones share the sums.
#[derive(Clone, Debug, Default)]
pub struct Running(Arc<Mutex<RunningSums>>);

impl Running {
    /// Returns the sums so far.
    pub fn sums(&self) -> RunningSums {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Sink for Running {
    fn columns(&mut self, columns: &[Column]) -> io::Result<()> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).names =
            columns.iter().flat_map(Column::elements).collect();
        Ok(())
    }

    fn draw(&mut self, row: &DrawRow) -> io::Result<()> {
        let mut s = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let one = RunningSums {
            names: Vec::new(),
            count: 1.0,
            mean: row.values.clone(),
            squares: vec![0.0; row.values.len()],
        };
        s.merge(&one);
        Ok(())
    }

    fn chain_done(
        &mut self,
        _chain: u32,
        _steps: u64,
        _warmup: u64,
        _seconds: f64,
    ) -> io::Result<()> {
        Ok(())
    }
}

impl RunningSums {
    /// Adds the draws of another chain (Chan, Golub and LeVeque 1979).
    pub fn merge(&mut self, o: &RunningSums) {
        if self.names.is_empty() {
            self.names.clone_from(&o.names);
        }
        let all = self.count + o.count;
        if o.count == 0.0 {
            return;
        }
        self.mean.resize(o.mean.len(), 0.0);
        self.squares.resize(o.mean.len(), 0.0);
        for (i, (mean, squares)) in o.mean.iter().zip(&o.squares).enumerate() {
            let d = mean - self.mean[i];
            self.mean[i] += d * (o.count / all);
            self.squares[i] += squares + d * d * (self.count * o.count / all);
        }
        self.count = all;
    }

    /// Returns the mean and standard deviation of each quantity; empty for fewer than two
    /// draws.
    pub fn normals(&self) -> IndexMap<String, Normal> {
        if self.count < 2.0 {
            return IndexMap::new();
        }
        let one = |(i, name): (usize, &String)| {
            let (mean, squares) = (self.mean.get(i)?, self.squares.get(i)?);
            Some((name.clone(), Normal { mean: *mean, sd: (squares / (self.count - 1.0)).sqrt() }))
        };
        self.names.iter().enumerate().filter_map(one).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_chains_are_as_one() {
        let row =
            |x: f64| DrawRow { log_joint: 0.0, values: vec![x, x * x, -x], ..DrawRow::default() };
        let mut chains = [Running::default(), Running::default()];
        for c in &mut chains {
            c.columns(&[Column::scalar("a"), Column::vector("v", 2)]).unwrap();
        }
        (0..10).for_each(|i| chains[usize::from(i > 3)].draw(&row(f64::from(i))).unwrap());
        let mut all = RunningSums::default();
        assert!(all.normals().is_empty());
        chains.iter().for_each(|c| all.merge(&c.sums()));
        let n = all.normals();
        assert_eq!(n.keys().collect::<Vec<_>>(), ["a", "v[0]", "v[1]"]);
        assert!(
            (n["a"].mean - 4.5).abs() < 1e-12
                && (n["a"].sd - 9.166_666_666_666_666f64.sqrt()).abs() < 1e-12
        );
        assert!((n["v[0]"].mean - 28.5).abs() < 1e-12 && (n["v[1]"].sd - n["a"].sd).abs() < 1e-12);
    }
}
