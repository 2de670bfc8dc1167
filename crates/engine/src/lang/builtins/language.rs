//! The language's own table: the rows of all files here.

use super::linear::{definite, matrix};
use super::{
    Builtin, Row, Table, covariance, data, distributions, examples, forms, interp, list,
    log_density, math, operators, plans, reduce,
};

impl Table {
    /// The built-ins of the language with these kernels, in the order of the reference.
    pub fn with_kernels(kernels: impl IntoIterator<Item = Builtin>) -> Self {
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
            [math::NORMAL, log_density::TABLE, covariance::TABLE, forms::TABLE, data::TABLE];
        let rows = |tables: Vec<&'static [Row]>| tables.into_iter().flatten().map(Builtin::from);
        let shown = |builtin: Builtin| Builtin { example: examples::of(&builtin.name), ..builtin };
        let own = rows(functions.into()).chain(distributions::all()).chain(rows(rest.into()));
        let plans = rows(vec![plans::TABLE]);
        Table::empty()
            .with(own.map(shown).chain(kernels).chain(plans.map(shown)))
            .with_forms(distributions::forms())
    }
}

impl Default for Table {
    /// The built-ins of the language without kernels.
    fn default() -> Self {
        Table::with_kernels([])
    }
}
