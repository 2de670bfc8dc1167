//! Presets: settings chosen from a front, by quality or by available time, with the
//! measurements behind them.

use super::rows::{self, Row};
use super::setting::Setting;
use pcadlang_inference::Search;
use serde::{Deserialize, Serialize};

/// The desired balance of accuracy and time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Quality {
    /// The fastest setting on the front with at most 1.5 times the error of the most
    /// accurate one.
    Fast,
    /// The fastest with at most 1.15 times that error.
    Balanced,
    /// The most accurate.
    Accurate,
}

impl Quality {
    /// All qualities, fastest first.
    pub const ALL: [Quality; 3] = [Quality::Fast, Quality::Balanced, Quality::Accurate];

    /// Returns the name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Quality::Fast => "fast",
            Quality::Balanced => "balanced",
            Quality::Accurate => "accurate",
        }
    }

    /// Returns the allowed error, as a multiple of the smallest one.
    fn factor(self) -> f64 {
        match self {
            Quality::Fast => 1.5,
            Quality::Balanced => 1.15,
            Quality::Accurate => 1.0,
        }
    }
}

/// A setting on the front, with its measurements.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Preset {
    /// The setting.
    #[serde(flatten)]
    pub setting: Setting,
    /// What its start and warm-up make in any case.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub search: Option<Search>,
    /// The time of a run in seconds, the mean over cases.
    pub seconds: f64,
    /// The error, the mean over cases.
    pub error: f64,
    /// The 90 % interval of the error over cases.
    pub interval: [f64; 2],
    /// The number of cases.
    pub cases: usize,
}

/// The measured settings of a program.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Presets {
    /// A reference to the measurements, for readers.
    pub about: String,
    /// The name of the error measure.
    pub error: String,
    /// The `data` items that must be given for the presets to apply.
    #[serde(default)]
    pub needs: Vec<String>,
    /// The front, fastest first.
    pub front: Vec<Preset>,
}

/// A chosen preset and the reason.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice<'a> {
    /// The setting with its measurements.
    pub preset: &'a Preset,
    /// The option it was chosen for.
    pub wanted: String,
}

impl Preset {
    /// Returns the front of the given settings. The table may contain others, which are
    /// ignored.
    pub fn front(settings: &[Setting], rows: &[Row]) -> Vec<Preset> {
        let own = |row: &Row| settings.iter().find(|s| s.name() == row.setting);
        let (rows, settings): (Vec<Row>, Vec<&Setting>) =
            rows.iter().filter_map(|r| Some((r.clone(), own(r)?))).unzip();
        let preset = |i: usize| Preset {
            setting: settings[i].clone(),
            search: None,
            seconds: rounded(rows[i].seconds),
            error: rounded(rows[i].error),
            interval: [rounded(rows[i].low), rounded(rows[i].high)],
            cases: rows[i].cases,
        };
        let mut front: Vec<Preset> = rows::front(&rows).into_iter().map(preset).collect();
        front.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
        front
    }
}

impl Presets {
    /// Returns the preset for a quality; `None` if the front is empty.
    pub fn of_quality(&self, quality: Quality) -> Option<Choice<'_>> {
        let least = self.front.iter().map(|p| p.error).min_by(f64::total_cmp)?;
        let preset = self.front.iter().find(|p| p.error <= least * quality.factor())?;
        Some(Choice { preset, wanted: format!("--quality {}", quality.name()) })
    }

    /// Returns the best preset for a time limit in seconds: the one with the smallest
    /// error among those whose runs had this limit or a lower one, or the fastest if
    /// there are none.
    pub fn of_time(&self, seconds: f64) -> Option<Choice<'_>> {
        let within =
            self.front.iter().filter(|p| p.setting.time.unwrap_or(p.seconds) <= seconds * 1.001);
        let preset = within.min_by(|a, b| a.error.total_cmp(&b.error)).or(self.front.first())?;
        Some(Choice { preset, wanted: format!("--time {seconds}s") })
    }
}

fn rounded(x: f64) -> f64 {
    (x * 1e4).round() / 1e4
}

#[cfg(test)]
mod tests {
    use super::super::runs::{Mark, RunRecord};
    use super::*;

    fn presets(all: &[(f64, f64)]) -> Presets {
        let one = |&(time, error): &(f64, f64)| Preset {
            search: None,
            setting: Setting { time: Some(time), ..Setting::default() },
            seconds: time + 0.1,
            error,
            interval: [error, error],
            cases: 10,
        };
        Presets { front: all.iter().map(one).collect(), ..Presets::default() }
    }

    #[test]
    fn names_are_places_on_the_front() {
        let p = presets(&[(0.5, 0.30), (1.0, 0.14), (3.0, 0.113), (30.0, 0.10)]);
        let time = |c: Option<Choice>| c.unwrap().preset.setting.time.unwrap();
        assert_eq!(Quality::ALL.map(|q| time(p.of_quality(q))), [1.0, 3.0, 30.0]);
        assert_eq!(
            [0.1, 0.5, 2.0, 5.0, 100.0].map(|t| time(p.of_time(t))),
            [0.5, 0.5, 1.0, 3.0, 30.0]
        );
        assert!(presets(&[]).of_quality(Quality::Fast).is_none());
    }

    #[test]
    fn others_in_the_table_are_passed_over() {
        let own = Setting { time: Some(2.0), ..Setting::default() };
        let other =
            Setting { program: Some("b.pcad".into()), time: Some(1.0), ..Setting::default() };
        let run = |setting: &Setting, error: f64| RunRecord {
            setting: setting.name(),
            marks: vec![Mark { at: None, seconds: setting.time.unwrap(), error: Some(error) }],
            ..RunRecord::default()
        };
        let settings = [own.clone(), other.clone()];
        // The other one is better, and is on the front of the table.
        let table = rows::rows(&settings, &[run(&own, 0.2), run(&other, 0.1)]);
        assert_eq!(table.iter().map(|r| r.front).collect::<Vec<_>>(), [false, true]);
        let front = Preset::front(std::slice::from_ref(&own), &table);
        assert_eq!(front.iter().map(|p| (&p.setting, p.error)).collect::<Vec<_>>(), [(&own, 0.2)]);
    }

    #[test]
    fn they_are_kept_as_text() {
        let p = presets(&[(0.5, 0.25)]);
        let text = serde_json::to_string(&p).unwrap();
        assert_eq!(serde_json::from_str::<Presets>(&text).unwrap(), p);
        assert!(text.contains(r#""time":0.5,"seconds":0.6"#), "{text}");
    }
}
