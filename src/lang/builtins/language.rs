//! The language's own table: the rows of all files here.

use super::linear::{definite, matrix};
use super::{
    Builtin, Row, Table, covariance, data, distributions, examples, forms, inference, interp, list,
    log_density, math, operators, reduce,
};

/// The language's own built-ins, in the order of the reference.
pub(super) fn all() -> impl Iterator<Item = Builtin> {
    let own: [&[Row]; 13] = [
        operators::TABLE,
        math::TABLE,
        reduce::TABLE,
        list::TABLE,
        interp::TABLE,
        matrix::TABLE,
        definite::TABLE,
        distributions::TABLE,
        log_density::TABLE,
        covariance::TABLE,
        forms::TABLE,
        data::TABLE,
        inference::TABLE,
    ];
    own.into_iter().flatten().map(|row| {
        let builtin = Builtin::from(row);
        Builtin { example: examples::of(row.name), ..builtin }
    })
}

impl Default for Table {
    /// The built-ins of the language alone.
    fn default() -> Self {
        Table::empty().with(all())
    }
}
