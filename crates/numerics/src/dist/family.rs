//! The rows of the table of families, and the macro that turns its rows into the
//! type of all distributions, their constructors and their documentation.

use super::{Datum, Dist, Distribution, ParamError};

/// The kind of values that a parameter takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum ParamKind {
    /// A number, or an array of numbers for a product of distributions.
    Numbers,
    Number,
    Integer,
    Bool,
    Array,
    Distribution,
    Covariance,
    Any,
}

/// A parameter of a family.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ParamDoc {
    /// The name in the language.
    pub name: &'static str,
    /// The kind of values.
    pub kind: ParamKind,
    /// A description in one sentence.
    pub doc: &'static str,
    /// The default as it is written; `None` for a required parameter.
    pub default: Option<&'static str>,
    /// The unit, or empty.
    pub unit: &'static str,
}

/// The kind of value that a draw from a family is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Drawn {
    /// A number, or an array if a parameter is one.
    Elementwise,
    /// An array.
    Array,
    /// An array, by a matrix whose factor is worth keeping.
    Correlated,
    /// Not known from the parameters.
    Unknown,
}

/// A family of distributions.
#[derive(Clone, Copy, Debug)]
pub struct Family {
    /// The name in the language.
    pub name: &'static str,
    /// The family that this one is another parametrisation of, by its last parameter:
    /// programs call it by that name.
    pub form_of: Option<&'static str>,
    /// A description in one sentence.
    pub doc: &'static str,
    /// The parameters, in order.
    pub params: &'static [ParamDoc],
    /// The support, in words.
    pub support: &'static str,
    /// The density or probability.
    pub formula: &'static str,
    /// The kind of value that a draw is.
    pub drawn: Drawn,
    /// The family as functions of numbers, if all parameters are numbers.
    pub numbers: Option<Numbers>,
}

/// A family as functions of its parameters, all of them numbers.
#[derive(Clone, Copy, Debug)]
pub struct Numbers {
    /// Makes the distribution.
    pub make: fn(&[f64]) -> Result<Dist, ParamError>,
    /// Returns the log density of a number; `None` if a parameter is outside its domain.
    pub log_density: fn(&[f64], f64) -> Option<f64>,
}

impl Numbers {
    pub(super) const fn of<T, const N: usize>() -> Numbers
    where
        T: Named + Distribution + Into<Dist> + TryFrom<[f64; N], Error = ParamError>,
    {
        Numbers {
            make: |params| made::<T, N>(params).map(Into::into),
            log_density: |params, x| {
                made::<T, N>(params).ok().map(|d| d.log_density(&Datum::Num(x)))
            },
        }
    }
}

#[inline]
fn made<T, const N: usize>(params: &[f64]) -> Result<T, ParamError>
where
    T: Named + TryFrom<[f64; N], Error = ParamError>,
{
    match <[f64; N]>::try_from(params) {
        Ok(params) => T::try_from(params),
        Err(_) => Err(T::bad("the parameters", params.len(), "must be as many as documented")),
    }
}

/// A family with a row in the table.
pub trait Named {
    /// The name in the language, by which errors call it.
    const NAME: &'static str;

    /// Returns the error that a parameter violates this rule.
    fn bad(parameter: &'static str, value: impl ToString, rule: &'static str) -> ParamError {
        ParamError::new(Self::NAME, parameter, value, rule)
    }
}

/// Declares the families. Each row has
///
/// - the name in the language, and the type of its distributions;
/// - `inline` or `shared`: whether a [`Dist`] holds it as such or behind a pointer;
/// - `numbers` if all of its parameters are numbers, otherwise `other`;
/// - the parameters: for `numbers`, each with the check of `param.rs` that it passes
///   before `of` makes the distribution; for `other`, each with its [`ParamKind`];
/// - what users read about it;
/// - what is `drawn`, if not [`Drawn::Elementwise`];
/// - the family that it is another form `of`, see [`Family::form_of`].
///
/// Inline families of numbers are also scored in batches. The macro is given a `$` for
/// the macro `each` that it defines.
macro_rules! families {
    (
        $d:tt
        $(
            $name:ident: $stored:ident $params:ident $Family:ident {
                $($p:ident: $check:ident, $pdoc:literal
                    $(, default $default:literal)? $(, unit $unit:literal)?;)*
            }
            doc $doc:literal
            on $support:literal
            density $formula:literal
            $(drawn $drawn:ident)?
            $(form of $of:ident)?;
        )*
    ) => {
        /// A distribution of any family, at most 48 bytes: most scalar families are
        /// stored inline, the others behind a pointer.
        #[derive(Clone, Debug)]
        #[allow(missing_docs)]
        pub enum Dist {
            $($Family(family!(type $stored $Family)),)*
            Product(Arc<Product>),
            /// A distribution provided by a host program.
            Custom(Arc<dyn Distribution>),
        }

        /// Evaluates the same expression for every family.
        macro_rules! each {
            ($d dist:expr, $d one:ident => $d body:expr) => {
                match $d dist {
                    $(Dist::$Family($d one) => $d body,)*
                    Dist::Product($d one) => $d body,
                    Dist::Custom($d one) => $d body,
                }
            };
        }
        pub(super) use each;

        /// All families, except products of distributions.
        pub const FAMILIES: &[Family] = &[
            $(Family {
                name: stringify!($name),
                form_of: family!(option $(stringify!($of))?),
                doc: $doc,
                params: &[$(ParamDoc {
                    name: stringify!($p),
                    kind: family!(kind $params $check),
                    doc: $pdoc,
                    default: family!(option $($default)?),
                    unit: concat!($($unit)?),
                }),*],
                support: $support,
                formula: $formula,
                drawn: family!(drawn $($drawn)?),
                numbers: family!(numbers $params $Family $($p)*),
            },)*
        ];

        /// Returns the batch of distributions that are all of one family with this many
        /// parameters.
        pub(super) fn component(parts: &[Dist], width: usize) -> Option<Box<dyn Component>> {
            match parts.first()? {
                $(Dist::$Family(_) => family!(batch $stored $params $Family parts width $($p)*),)*
                Dist::Product(_) | Dist::Custom(_) => None,
            }
        }

        $(
            impl Named for $Family {
                const NAME: &'static str = family!(called $name $($of)?);
            }

            impl From<$Family> for Dist {
                #[inline]
                fn from(d: $Family) -> Dist {
                    Dist::$Family(d.into())
                }
            }

            family!(new $params $Family $($p: $check)*);
        )*
    };
}

/// The parts of a row that depend on how its distributions are stored and made.
macro_rules! family {
    (type inline $Family:ident) => { $Family };
    (type shared $Family:ident) => { Arc<$Family> };
    (kind numbers $check:ident) => { ParamKind::Numbers };
    (kind other $kind:ident) => { ParamKind::$kind };
    (drawn) => { Drawn::Elementwise };
    (drawn $drawn:ident) => { Drawn::$drawn };
    (option) => { None };
    (option $default:expr) => { Some($default) };
    (called $name:ident) => { stringify!($name) };
    (called $name:ident $of:ident) => { stringify!($of) };
    (count $($p:ident)*) => { [$(stringify!($p)),*].len() };
    (numbers numbers $Family:ident $($p:ident)*) => {
        Some(Numbers::of::<$Family, { family!(count $($p)*) }>())
    };
    (numbers other $Family:ident $($p:ident)*) => { None };
    (batch inline numbers $Family:ident $parts:ident $width:ident $($p:ident)*) => {
        Members::<$Family, { family!(count $($p)*) }>::component($parts, $width, |d| match d {
            Dist::$Family(d) => Some(d),
            _ => None,
        })
    };
    (batch $stored:ident $params:ident $Family:ident $parts:ident $width:ident $($p:ident)*) => {
        None
    };
    (new numbers $Family:ident $($p:ident: $check:ident)*) => {
        impl $Family {
            /// Creates the distribution; fails if a parameter is outside its domain,
            /// which [`FAMILIES`] describes.
            #[inline]
            pub fn new($($p: f64),*) -> Result<$Family, ParamError> {
                $(let $p = param::$check(Self::NAME, stringify!($p), $p)?;)*
                $Family::of($($p),*)
            }
        }

        impl TryFrom<[f64; family!(count $($p)*)]> for $Family {
            type Error = ParamError;

            #[inline]
            fn try_from([$($p),*]: [f64; family!(count $($p)*)]) -> Result<$Family, ParamError> {
                $Family::new($($p),*)
            }
        }
    };
    (new other $Family:ident $($p:ident: $kind:ident)*) => {};
}

pub(super) use {families, family};
