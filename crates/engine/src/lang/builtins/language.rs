//! The language's own table: the rows of all files here.

use super::linear::{definite, matrix};
use super::{
    Builtin, Row, Table, covariance, data, distributions, examples, forms, inference, interp, list,
    log_density, math, operators, reduce,
};

/// The language's own built-ins, in the order of the reference.
pub(super) fn all() -> impl Iterator<Item = Builtin> {
    let functions: [&[Row]; 7] = [
        operators::TABLE,
        math::TABLE,
        reduce::TABLE,
        list::TABLE,
        interp::TABLE,
        matrix::TABLE,
        definite::TABLE,
    ];
    let rest: [&[Row]; 5] =
        [log_density::TABLE, covariance::TABLE, forms::TABLE, data::TABLE, inference::TABLE];
    let rows = |tables: Vec<&'static [Row]>| tables.into_iter().flatten().map(Builtin::from);
    let all = rows(functions.into()).chain(distributions::all()).chain(rows(rest.into()));
    all.map(|builtin| Builtin { example: examples::of(&builtin.name), ..builtin })
}

impl Default for Table {
    /// The built-ins of the language alone.
    fn default() -> Self {
        Table::empty().with(all())
    }
}
