//! `pcadlang` for C, and for languages that call C: programs, models, runs and their draws.
//!
//! Every function may be called from any thread; a program is for one thread at a time, models
//! and posteriors may be shared. What a function returns by pointer belongs to the caller, who
//! gives it back to the function `…_free` of its type. A null pointer or -1 is an error, which
//! [`pcad_error`] describes. No call unwinds into C.
//!
//! This is the one crate of the project, beside the extension module for Python, that C calls:
//! texts, arrays and handles cross as raw pointers, which only unsafe code can follow. Each
//! function checks for null and says in its contract what else must hold.

#![warn(missing_docs)]

mod failure;
mod posterior;
mod program;

pub use failure::pcad_error;
pub use posterior::{
    PcadPosterior, pcad_chains, pcad_draws, pcad_posterior_free, pcad_read, pcad_summary,
    pcad_text_free,
};
pub use program::{
    PcadModel, PcadOptions, PcadProgram, pcad_compile, pcad_model_free, pcad_observe_array,
    pcad_observe_file, pcad_observe_number, pcad_observe_pixels, pcad_open, pcad_parse,
    pcad_program_free, pcad_sample, pcad_set,
};
