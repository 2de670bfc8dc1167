//! Chains that fail: as diagnostics, or as a sentence where the other chains go on.

use super::Model;
use indexmap::IndexMap;
use pcadlang_engine::lang::error::RunError;
use pcadlang_inference::{ChainError, ChainResult, NoStart, StartError};
use pcadlang_syntax::diag::{Diagnostic, Error, IntoDiagnostic, Severity};

/// The chains of a run, without those that found no state to start from.
#[derive(Debug)]
pub struct Started {
    /// The results of those that ran.
    pub chains: Vec<ChainResult>,
    /// The place of each of them among the chains of the run, from 0.
    pub places: Vec<usize>,
    /// Sentences on the others, and on those that started without what `force` sets.
    pub warnings: Vec<String>,
}

impl Model {
    /// Separates the chains of a run that ran from those that could not start.
    ///
    /// # Errors
    /// If none could start, or one failed later.
    #[doc(hidden)]
    pub fn started(&self, results: Vec<Result<ChainResult, ChainError>>) -> Result<Started, Error> {
        let (all, mut first) = (results.len(), None);
        let mut started = Started { chains: vec![], places: vec![], warnings: vec![] };
        // Chains of the same fate share a sentence.
        let mut fates: IndexMap<String, Vec<String>> = IndexMap::new();
        for (i, result) in results.into_iter().enumerate() {
            let fate = match result {
                Ok(mut chain) => {
                    let by = chain.contradicted.take();
                    started.chains.push(chain);
                    started.places.push(i);
                    let Some(by) = by else { continue };
                    let by = self.chain_error(ChainError::Start(StartError::Impossible(by)));
                    format!("started without what `force` sets, with which {}", in_short(&by))
                }
                Err(e) if e.is_of_the_start() => {
                    let e = self.chain_error(e);
                    let fate = format!("could not start and is left out: {}", in_short(&e));
                    first = first.or(Some(e));
                    fate
                }
                Err(e) => return Err(self.chain_error(e)),
            };
            fates.entry(fate).or_default().push((i + 1).to_string());
        }
        let told = |(fate, chains): (String, Vec<String>)| match &chains[..] {
            [one] => format!("chain {one} of {all} {fate}"),
            some => {
                let fate = fate.replacen(" is left out", " are left out", 1);
                format!("chains {} of {all} {fate}", some.join(", "))
            }
        };
        started.warnings = fates.into_iter().map(told).collect();
        match first {
            Some(e) if started.chains.is_empty() => Err(e),
            _ => Ok(started),
        }
    }

    /// Converts a failure at run time to diagnostics.
    pub fn run_error(&self, e: RunError) -> Error {
        Error { diagnostics: vec![e.into_diagnostic()], sources: self.sources().clone() }
    }

    /// Converts the failure of a chain to diagnostics.
    pub fn chain_error(&self, e: ChainError) -> Error {
        let plain = |message: String| Diagnostic::new(Severity::Error, message);
        let d = match e {
            ChainError::Run(e) | ChainError::Start(StartError::Run(e)) => e.into_diagnostic(),
            ChainError::Start(StartError::Impossible(zero)) => impossible(&zero),
            ChainError::Sink(e) => plain(format!("cannot write draws: {e}")),
            ChainError::Checkpoint(e) => plain(format!("cannot resume a chain: {e}")),
        };
        Error { diagnostics: vec![d], sources: self.sources().clone() }
    }
}

/// Says what has probability zero in the states that were tried.
fn impossible(zero: &NoStart) -> Diagnostic {
    let mut d = Diagnostic::new(Severity::Error, format!("cannot start any chain: {zero}"));
    for (i, term) in zero.terms.iter().take(5).enumerate() {
        let why = term.outside.as_ref().map(|why| format!(": {why}")).unwrap_or_default();
        d = match i {
            0 => d.primary(term.span, format!("the log density of {} is -inf{why}", term.address)),
            _ => d.secondary(term.span, format!("so is that of {}{why}", term.address)),
        };
    }
    if zero.terms.len() > 5 {
        d = d.note(format!("and {} more", zero.terms.len() - 5));
    }
    if !zero.drawn.is_empty() {
        let drawn: Vec<String> = zero.drawn.iter().map(|(a, v)| format!("{a} = {v}")).collect();
        d = d.note(format!("in the last draw, {}", drawn.join(", ")));
    }
    d.hint(match zero.terms.first().is_some_and(|t| t.outside.is_some()) {
        true => {
            "check the data, or observe them under a distribution whose support contains them for \
             the values that the prior draws"
        }
        false => {
            "no state that was drawn fulfils it: give choices a prior of values that do, or start \
             chains at such values with `force @x = …;`"
        }
    })
}

/// An error as a part of a sentence: what is wrong, where and why.
fn in_short(e: &Error) -> String {
    let Some(d) = e.diagnostics.first() else { return String::new() };
    let said = d.message.strip_prefix("cannot start any chain: ").unwrap_or(&d.message);
    match d.labels.iter().find(|l| l.primary) {
        Some(l) if l.text.is_empty() => format!("{said} ({})", e.sources.locate(l.span)),
        Some(l) => format!("{said}; {} ({})", l.text, e.sources.locate(l.span)),
        None => said.to_owned(),
    }
}
