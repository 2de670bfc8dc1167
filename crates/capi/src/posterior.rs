//! The draws of a run.

use crate::failure::{attempt, free, handle, text};
use pcadlang::Posterior;
use pcadlang_report::Quantity;
use serde_json::{Map, Value, json};
use std::ffi::{CString, c_char};

/// The draws of a run: numbers by name, chain by chain.
pub struct PcadPosterior {
    quantities: Vec<Quantity>,
    draws: usize,
}

impl PcadPosterior {
    /// Cuts chains to the length of the shortest, as under a time limit they differ.
    pub(crate) fn new(posterior: &Posterior) -> PcadPosterior {
        let mut quantities = posterior.quantities();
        let lengths = quantities.iter().flat_map(|q| q.chains.iter().map(Vec::len));
        let draws = lengths.min().unwrap_or(0);
        quantities.iter_mut().flat_map(|q| &mut q.chains).for_each(|c| c.truncate(draws));
        PcadPosterior { quantities, draws }
    }
}

/// The number of chains; 0 for null.
///
/// # Safety
/// `posterior` is null or a posterior of this library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pcad_chains(posterior: *const PcadPosterior) -> usize {
    // SAFETY: the caller's promise.
    let posterior = unsafe { posterior.as_ref() };
    posterior.and_then(|p| p.quantities.first()).map_or(0, |q| q.chains.len())
}

/// The number of draws of each chain; 0 for null.
///
/// # Safety
/// `posterior` is null or a posterior of this library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pcad_draws(posterior: *const PcadPosterior) -> usize {
    // SAFETY: the caller's promise.
    unsafe { posterior.as_ref() }.map_or(0, |p| p.draws)
}

/// Copies the draws of a quantity, one chain after the other, and returns their number: chains
/// times draws. An element of a vector is named `name[i]`. If there is not enough room nothing is
/// copied; 0 for an error.
///
/// # Safety
/// `posterior` is null or a posterior of this library, `name` null or a text that ends with a zero
/// byte, `out` null or room for `room` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pcad_read(
    posterior: *const PcadPosterior,
    name: *const c_char,
    out: *mut f64,
    room: usize,
) -> usize {
    let read = || {
        // SAFETY: the caller's promise.
        let (posterior, name) =
            unsafe { (handle("posterior", posterior)?, text("the name", name)?) };
        let found = posterior.quantities.iter().find(|q| q.name == name);
        let found = found.ok_or_else(|| {
            let all: Vec<&str> = posterior.quantities.iter().map(|q| q.name.as_str()).collect();
            format!("no quantity {name:?} was recorded; there are: {}", all.join(", "))
        })?;
        let all = found.chains.concat();
        if room >= all.len() && !out.is_null() {
            // SAFETY: there is room, and what was allocated here does not overlap it.
            unsafe { std::ptr::copy_nonoverlapping(all.as_ptr(), out, all.len()) };
        }
        Ok(all.len())
    };
    attempt(read).unwrap_or(0)
}

/// Returns the summary of every quantity as JSON: mean, sd, quantiles, Monte Carlo errors,
/// effective sample sizes and R-hat. The text belongs to the caller, who gives it to
/// `pcad_text_free`.
///
/// # Safety
/// `posterior` is null or a posterior of this library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pcad_summary(posterior: *const PcadPosterior) -> *mut c_char {
    let summary = || {
        // SAFETY: the caller's promise.
        let posterior = unsafe { handle("posterior", posterior) }?;
        let all = posterior.quantities.iter().map(|q| (q.name.clone(), json!(q.summary)));
        let text = Value::Object(all.collect::<Map<_, _>>()).to_string();
        CString::new(text).map_err(|e| e.to_string())
    };
    attempt(summary).map_or(std::ptr::null_mut(), CString::into_raw)
}

/// Gives a text back; null is allowed.
///
/// # Safety
/// `text` is null or from `pcad_summary`, and not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pcad_text_free(text: *mut c_char) {
    if !text.is_null() {
        // SAFETY: it came from `CString::into_raw`, and the caller promises that this is its last use.
        drop(unsafe { CString::from_raw(text) });
    }
}

/// Gives a posterior back; null is allowed.
///
/// # Safety
/// `posterior` is null or a posterior of this library that is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pcad_posterior_free(posterior: *mut PcadPosterior) {
    // SAFETY: the caller's promise.
    unsafe { free(posterior) }
}
