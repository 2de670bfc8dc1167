//! How often the states of a run may be drawn beside its chains, without slowing them down.

use crate::job::machine_threads;
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// The least time between two states.
const BETWEEN: Duration = Duration::from_millis(200);
/// The longest time between two states.
const MOST: Duration = Duration::from_secs(2);
/// The part of the machine that may go to them.
const SHARE: f64 = 0.025;
/// The number of states whose times are remembered.
const REMEMBERED: usize = 8;

/// An account of what drawing costs.
#[derive(Debug, Default)]
pub struct Ration {
    next: Option<Instant>,
    /// How long the last states took. The least of these times is near to what one costs:
    /// beside chains that use the whole machine, drawing takes longer than that.
    took: VecDeque<Duration>,
}

impl Ration {
    /// Notes how long the last state took.
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
        let mut r = Ration::default();
        assert_eq!(r.rest(), Duration::ZERO);
        let near = |r: &Ration, t: Duration| t - r.rest() < Duration::from_millis(50);
        r.took(Duration::from_micros(10));
        assert!(near(&r, BETWEEN));
        let mut r = Ration::default();
        r.took(Duration::from_secs(100));
        assert!(near(&r, MOST));
        // One that was held up does not count.
        r.took(Duration::from_micros(10));
        assert!(near(&r, BETWEEN));
    }
}
