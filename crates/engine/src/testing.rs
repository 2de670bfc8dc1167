//! For unit tests: programs of numbers, from their text.

use pcadlang_engine::lang::load::{Nowhere, load_text};
use pcadlang_engine::lang::lower::{Compiled, Inputs, compile};
use pcadlang_engine::trace::{Draws, Limits, Trace};
use pcadlang_numerics::rng::{Purpose, StreamKey};
use pcadlang_syntax::diag::{SourceMap, render};
use std::sync::Arc;

/// Compiles a program without data.
pub fn compiled(text: &str) -> Compiled {
    let mut sources = SourceMap::new();
    let done = load_text("<program>", text, &Nowhere, &mut sources).and_then(|loaded| {
        let inputs = Inputs {
            builtins: Arc::new(crate::table()),
            sets: &[],
            data: Default::default(),
            read: &|_, path, _, _| panic!("{path} is read"),
            needs_data: true,
            defaults: Default::default(),
            eager: Default::default(),
        };
        compile(&loaded, inputs, &mut sources)
    });
    done.unwrap_or_else(|d| panic!("{}", render(&sources, &d, false)))
}

/// Draws once from the prior of a program; observations are scored.
pub fn trace(text: &str, seed: u64) -> Trace {
    draw(text, seed, 0)
}

/// Draws from the prior; draws of different indices are independent.
pub fn draw(text: &str, seed: u64, index: u64) -> Trace {
    let draws = Draws { key: StreamKey::new(seed, 0, Purpose::START), step: index, substream: 0 };
    Trace::simulate(compiled(text).code, draws, Limits::default())
        .unwrap_or_else(|e| panic!("{e:?}"))
}
