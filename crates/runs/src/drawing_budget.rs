//! Limits how often the states of a run are drawn, so that drawing does not slow its chains.

use crate::job::machine_threads;
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Minimum time between two states.
const BETWEEN: Duration = Duration::from_millis(200);
/// Maximum time between two states.
const MOST: Duration = Duration::from_secs(2);
/// Maximum fraction of the machine's threads for drawing.
const SHARE: f64 = 0.025;
/// The number of recent states whose times are kept.
const REMEMBERED: usize = 8;

/// The time that recent states took to draw, and when the next one may be drawn.
#[derive(Debug, Default)]
pub struct DrawingBudget {
    next: Option<Instant>,
    /// The times of the last states. Their minimum estimates the cost of one: chains that use
    /// the whole machine delay most of them.
    took: VecDeque<Duration>,
}

impl DrawingBudget {
    /// Records the time that the last state took.
    pub fn took(&mut self, time: Duration) {
        self.took.push_back(time);
        if self.took.len() > REMEMBERED {
            self.took.pop_front();
        }
        let cost = self.took.iter().min().copied().unwrap_or_default();
        let rest = cost.div_f64(SHARE * machine_threads() as f64);
        self.next = Some(Instant::now() + rest.clamp(BETWEEN, MOST));
    }

    /// Returns the time until the next state may be drawn; zero for the first one.
    pub fn rest(&self) -> Duration {
        self.next.map_or(Duration::ZERO, |n| n.saturating_duration_since(Instant::now()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_costs_more_comes_less_often() {
        let mut r = DrawingBudget::default();
        assert_eq!(r.rest(), Duration::ZERO);
        let near = |r: &DrawingBudget, t: Duration| t - r.rest() < Duration::from_millis(50);
        r.took(Duration::from_micros(10));
        assert!(near(&r, BETWEEN));
        let mut r = DrawingBudget::default();
        r.took(Duration::from_secs(100));
        assert!(near(&r, MOST));
        // One that was held up does not count.
        r.took(Duration::from_micros(10));
        assert!(near(&r, BETWEEN));
    }
}
