//! Settings of a run, and the file that says which of them to try.

use indexmap::IndexMap;
use pcadlang_numerics::rng::{Purpose, StreamKey};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// The settings of a run: everything but the machine that affects speed and accuracy.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Setting {
    /// A program that replaces the one on the command line.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub program: Option<String>,
    /// The number of chains.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub chains: Option<u32>,
    /// The total time, in seconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<f64>,
    /// Steps after warm-up.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steps: Option<u64>,
    /// Steps of warm-up.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub warmup: Option<u64>,
    /// Parameter values, as in a program.
    #[serde(skip_serializing_if = "IndexMap::is_empty")]
    pub set: IndexMap<String, String>,
}

/// The reason why a file of settings cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlanError {
    /// The file does not have the required form.
    #[error("{0}")]
    Form(String),
    /// A setting other than a parameter has an invalid value.
    #[error("`{name}` cannot be {value}: expected {expected}")]
    Value {
        /// The setting.
        name: String,
        /// Its value.
        value: String,
        /// The valid values.
        expected: &'static str,
    },
}

type Knobs = IndexMap<String, Value>;
type Axes = IndexMap<String, Vec<Value>>;

/// A file of settings. Names other than `program`, `chains`, `time`, `steps` and `warmup`
/// are names of parameters.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Plan {
    /// The purpose of the file, for readers.
    pub about: String,
    /// The values that all settings start from.
    pub base: Knobs,
    /// Names whose values are combined with each other and with every setting that does
    /// not set them itself.
    pub cross: Axes,
    /// Names that, one at a time, take other values than in `base`.
    pub vary: Axes,
    /// Settings that change several values at once.
    pub also: Vec<Knobs>,
    /// The number of additional settings in which every name of `vary` takes a random one
    /// of its values or that of the base.
    pub random: usize,
    /// True if these settings are for comparison only: they are in the table, but never
    /// become presets. For example, they may reduce the measured error at the expense of
    /// other qualities.
    pub compare: bool,
}

impl Plan {
    /// Reads a file of settings.
    ///
    /// # Errors
    /// If it does not have the form of a [`Plan`].
    pub fn from_json(text: &str) -> Result<Plan, PlanError> {
        serde_json::from_str(text).map_err(|e| PlanError::Form(e.to_string()))
    }

    /// Returns all distinct settings, the base first.
    ///
    /// # Errors
    /// If a value is invalid.
    pub fn settings(&self) -> Result<Vec<Setting>, PlanError> {
        let mut changes: Vec<Knobs> = vec![Knobs::new()];
        for (name, values) in &self.vary {
            changes.extend(values.iter().map(|v| Knobs::from([(name.clone(), v.clone())])));
        }
        changes.extend(self.also.iter().cloned());
        let mut random = StreamKey::new(1, 0, Purpose::REPLICATE).stream(0, 0, 0);
        for _ in 0..self.random {
            let mut one = Knobs::new();
            for (name, values) in self.vary.iter().filter(|(_, values)| !values.is_empty()) {
                // One of the choices is to keep the value of the base.
                match random.index(values.len() + 1) {
                    i if i < values.len() => drop(one.insert(name.clone(), values[i].clone())),
                    _ => {}
                }
            }
            changes.push(one);
        }
        for (name, values) in &self.cross {
            let with = |change: &Knobs, v: &Value| {
                let mut change = change.clone();
                change.entry(name.clone()).or_insert_with(|| v.clone());
                change
            };
            // Changes that set the name themselves become duplicates, which are removed
            // below.
            changes = changes.iter().flat_map(|c| values.iter().map(move |v| with(c, v))).collect();
        }
        let mut all: Vec<Setting> = Vec::new();
        for change in changes {
            let mut setting = Setting::default();
            for (name, value) in self.base.iter().chain(&change) {
                setting.put(name, value)?;
            }
            if !all.contains(&setting) {
                all.push(setting);
            }
        }
        Ok(all)
    }
}

impl Setting {
    /// Returns a name that identifies the setting: all values that it sets, with the
    /// parameters last, in the order of the file.
    pub fn name(&self) -> String {
        let own = [
            self.program.clone().map(|p| format!("program={p}")),
            self.chains.map(|n| format!("chains={n}")),
            self.time.map(|t| format!("time={t}")),
            self.steps.map(|n| format!("steps={n}")),
            self.warmup.map(|n| format!("warmup={n}")),
        ];
        let set = self.set.iter().map(|(name, value)| format!("{name}={value}"));
        let all: Vec<String> = own.into_iter().flatten().chain(set).collect();
        if all.is_empty() { "defaults".into() } else { all.join(" ") }
    }

    /// Checks whether the setting can be run, because it may come from a hand-written
    /// file.
    ///
    /// # Errors
    /// If the number of chains or the time is out of range.
    pub fn check(&self) -> Result<(), PlanError> {
        let mut again = Setting::default();
        let known =
            [("chains", self.chains.map(Value::from)), ("time", self.time.map(Value::from))];
        known
            .into_iter()
            .filter_map(|(name, value)| Some((name, value?)))
            .try_for_each(|(n, v)| again.put(n, &v))
    }

    fn put(&mut self, name: &str, value: &Value) -> Result<(), PlanError> {
        let fails = |expected| PlanError::Value {
            name: name.to_owned(),
            value: value.to_string(),
            expected,
        };
        let whole = || value.as_u64().ok_or(fails("a whole number"));
        match name {
            "program" => {
                self.program =
                    Some(value.as_str().ok_or(fails("the name of a program"))?.to_owned())
            }
            "chains" => {
                let n = value
                    .as_u64()
                    .and_then(|n| u32::try_from(n).ok())
                    .filter(|n| (1..=1024).contains(n));
                self.chains = Some(n.ok_or(fails("a whole number from 1 to 1024"))?);
            }
            "time" => {
                let t = value.as_f64().filter(|t| *t > 0.0 && *t < 1e7);
                self.time = Some(t.ok_or(fails("seconds"))?);
            }
            "steps" => self.steps = Some(whole()?),
            "warmup" => self.warmup = Some(whole()?),
            _ => {
                let text = match value {
                    Value::String(s) => s.clone(),
                    other => other.to_string(),
                };
                self.set.insert(name.to_owned(), text);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_at_a_time_and_each_with_each() {
        let plan = Plan::from_json(
            r#"{"base": {"chains": 4, "size": 128}, "cross": {"time": [1, 3]}, "vary": {"size": [64, 128], "chains": [2]},
                "also": [{"size": 64, "colours": false}, {"time": 30}]}"#,
        );
        let names: Vec<String> =
            plan.unwrap().settings().unwrap().iter().map(Setting::name).collect();
        assert_eq!(
            names,
            [
                "chains=4 time=1 size=128",
                "chains=4 time=3 size=128",
                "chains=4 time=1 size=64",
                "chains=4 time=3 size=64",
                "chains=2 time=1 size=128",
                "chains=2 time=3 size=128",
                "chains=4 time=1 size=64 colours=false",
                "chains=4 time=3 size=64 colours=false",
                "chains=4 time=30 size=128",
            ]
        );
    }

    #[test]
    fn random_settings_are_the_same_every_time() {
        let text =
            r#"{"vary": {"a": [1, 2, 3, 4], "b": [1, 2, 3, 4], "c": ["x", "y"]}, "random": 30}"#;
        let all = Plan::from_json(text).unwrap().settings().unwrap();
        assert_eq!(all, Plan::from_json(text).unwrap().settings().unwrap());
        assert!(all.iter().filter(|s| s.set.len() == 3).count() > 5);
    }

    #[test]
    fn what_cannot_be_is_said() {
        let of =
            |text: &str| Plan::from_json(text).and_then(|p| p.settings()).unwrap_err().to_string();
        assert_eq!(
            of(r#"{"base": {"chains": 0}}"#),
            "`chains` cannot be 0: expected a whole number from 1 to 1024"
        );
        assert_eq!(of(r#"{"vary": {"time": [-1]}}"#), "`time` cannot be -1: expected seconds");
        assert!(of(r#"{"bass": {}}"#).starts_with("unknown field `bass`, expected one of"));
    }
}
