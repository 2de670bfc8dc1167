//! Selections: the choices that a kernel applies to.

use crate::lang::address::{Address, AddressSegment};
use crate::lang::key::Key;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A set of choices, by address, tag or kind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Selector {
    /// Every choice.
    All,
    /// No choice.
    Nothing,
    /// Choices at or below an address pattern.
    Address(Pattern),
    /// Choices with a tag, and its value if given.
    Tag {
        /// The tag's name.
        name: Arc<str>,
        /// The tag's value.
        value: Option<Key>,
    },
    /// Choices of a kind: the predefined tags that every choice has by its distribution.
    Kind(ChoiceKind),
    /// Choices in either.
    Union(Box<Selector>, Box<Selector>),
    /// Choices in both.
    Both(Box<Selector>, Box<Selector>),
    /// Choices in the first but not in the second.
    Minus(Box<Selector>, Box<Selector>),
}

/// Kinds of choices, by distribution.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ChoiceKind {
    /// `$continuous`
    Continuous,
    /// `$discrete`: at least in part.
    Discrete,
    /// `$gaussian`: normal, mv_normal, gp.
    Gaussian,
    /// `$finite`: discrete with finitely many values.
    Finite,
}

/// An address with wildcards.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pattern {
    /// Its segments.
    pub segments: Vec<PatternSegment>,
}

/// One segment of a pattern.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum PatternSegment {
    /// `**`: any number of segments.
    Deep,
    /// A name (or any), an occurrence, and leading keys.
    Segment {
        /// The name; `None` for `*`.
        name: Option<Arc<str>>,
        /// The occurrence.
        occurrence: u32,
        /// The keys; `None` for `[*]`.
        keys: Vec<Option<Key>>,
    },
}

/// Facts about a choice when it is registered, or about an observation for `project`.
#[derive(Clone, Debug)]
pub(crate) struct Facts {
    /// True if it is a choice; kinds apply to choices only.
    pub choice: bool,
    pub address: Address,
    pub tags: Vec<(Arc<str>, Option<Key>)>,
    pub discrete: bool,
    pub finite: bool,
    pub gaussian: bool,
}

impl Pattern {
    /// Returns the pattern of this address and everything below it.
    pub fn exact(address: &Address) -> Self {
        let segment = |s: &AddressSegment| PatternSegment::Segment {
            name: Some(Arc::clone(&s.name)),
            occurrence: s.occurrence,
            keys: s.keys.iter().cloned().map(Some).collect(),
        };
        Pattern { segments: address.segments.iter().map(segment).collect() }
    }

    /// True if it can match an address whose last segments have these names: its last
    /// names occur among them, in order.
    fn may_match(&self, last: &[&str]) -> bool {
        let fits = |rest: &[PatternSegment]| {
            let mut names = last.iter();
            rest.iter().all(|s| match s {
                PatternSegment::Deep => true,
                PatternSegment::Segment { name, .. } => {
                    names.any(|n| name.as_ref().is_none_or(|name| &**name == *n))
                }
            })
        };
        (0..self.segments.len()).any(|i| fits(&self.segments[i..]))
    }

    /// True if an address is selected: it matches, or is below one that matches.
    pub fn matches(&self, address: &Address) -> bool {
        matches(&self.segments, &address.segments)
    }
}

fn matches(pattern: &[PatternSegment], address: &[AddressSegment]) -> bool {
    match pattern.split_first() {
        None => true,
        Some((PatternSegment::Deep, rest)) => {
            rest.is_empty() || (0..=address.len()).any(|skip| matches(rest, &address[skip..]))
        }
        Some((PatternSegment::Segment { name, occurrence, keys }, rest)) => {
            let Some((first, below)) = address.split_first() else { return false };
            let named = name
                .as_ref()
                .is_none_or(|n| *n == first.name && occurrence.max(&1) == &first.occurrence.max(1));
            let keyed = keys.len() <= first.keys.len()
                && (rest.is_empty() || keys.len() == first.keys.len())
                && keys.iter().zip(&first.keys).all(|(p, k)| p.as_ref().is_none_or(|p| p == k));
            named && keyed && matches(rest, below)
        }
    }
}

impl Selector {
    /// True if it selects this address by address patterns alone; kinds and tags select
    /// nothing.
    pub(crate) fn names(&self, address: &Address) -> bool {
        match self {
            Selector::All => true,
            Selector::Address(p) => p.matches(address),
            Selector::Union(a, b) => a.names(address) || b.names(address),
            Selector::Both(a, b) => a.names(address) && b.names(address),
            Selector::Minus(a, b) => a.names(address) && !b.names(address),
            _ => false,
        }
    }

    /// True if its address patterns may select an address whose last segments have these
    /// names, with any keys.
    pub(crate) fn may_name(&self, last: &[&str]) -> bool {
        match self {
            Selector::All => true,
            Selector::Address(p) => p.may_match(last),
            Selector::Union(a, b) => a.may_name(last) || b.may_name(last),
            Selector::Both(a, b) => a.may_name(last) && b.may_name(last),
            Selector::Minus(a, _) => a.may_name(last),
            _ => false,
        }
    }

    /// True if the address is needed to decide.
    pub(crate) fn needs_address(&self) -> bool {
        match self {
            Selector::Address(_) => true,
            Selector::Union(a, b) | Selector::Both(a, b) | Selector::Minus(a, b) => {
                a.needs_address() || b.needs_address()
            }
            _ => false,
        }
    }

    pub(crate) fn selects(&self, facts: &Facts) -> bool {
        match self {
            Selector::All => true,
            Selector::Nothing => false,
            Selector::Address(p) => p.matches(&facts.address),
            Selector::Tag { name, value } => {
                facts.tags.iter().any(|(n, v)| n == name && (value.is_none() || v == value))
            }
            Selector::Kind(ChoiceKind::Continuous) => facts.choice && !facts.discrete,
            Selector::Kind(ChoiceKind::Discrete) => facts.discrete,
            Selector::Kind(ChoiceKind::Gaussian) => facts.gaussian,
            Selector::Kind(ChoiceKind::Finite) => facts.finite,
            Selector::Union(a, b) => a.selects(facts) || b.selects(facts),
            Selector::Both(a, b) => a.selects(facts) && b.selects(facts),
            Selector::Minus(a, b) => a.selects(facts) && !b.selects(facts),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segment(name: &str, keys: &[&str]) -> AddressSegment {
        let keys = keys.iter().map(|k| Key::Str(Arc::from(*k))).collect();
        AddressSegment { name: Arc::from(name), occurrence: 1, keys }
    }

    fn pattern(text: &[(Option<&str>, &[Option<&str>])]) -> Pattern {
        let segments = text.iter().map(|(name, keys)| match name {
            Some("**") => PatternSegment::Deep,
            _ => PatternSegment::Segment {
                name: name.map(Arc::from),
                occurrence: 1,
                keys: keys.iter().map(|k| k.map(|k| Key::Str(Arc::from(k)))).collect(),
            },
        });
        Pattern { segments: segments.collect() }
    }

    #[test]
    fn a_pattern_selects_what_it_names_and_everything_below() {
        let a = Address {
            segments: vec![segment("pose", &["arm"]), segment("bone", &[]), segment("rot", &["z"])],
        };
        assert!(pattern(&[(Some("pose"), &[])]).matches(&a));
        assert!(pattern(&[(Some("pose"), &[Some("arm")])]).matches(&a));
        assert!(!pattern(&[(Some("pose"), &[Some("leg")])]).matches(&a));
        assert!(
            pattern(&[(Some("pose"), &[None]), (Some("bone"), &[]), (Some("rot"), &[])])
                .matches(&a)
        );
        assert!(
            !pattern(&[(Some("pose"), &[]), (Some("bone"), &[])]).matches(&a),
            "inner keys are not skipped"
        );
        assert!(pattern(&[(Some("**"), &[]), (Some("rot"), &[Some("z")])]).matches(&a));
        assert!(!pattern(&[(Some("**"), &[]), (Some("rot"), &[Some("x")])]).matches(&a));
        assert!(pattern(&[(None, &[None]), (Some("bone"), &[])]).matches(&a));
        assert!(!pattern(&[(Some("pos"), &[])]).matches(&a));
    }

    #[test]
    fn what_a_selector_names_it_may_name() {
        let a = Address {
            segments: vec![segment("pose", &["arm"]), segment("bone", &[]), segment("rot", &["z"])],
        };
        let exact = Selector::Address(Pattern::exact(&a));
        let below = Selector::Address(pattern(&[(Some("pose"), &[None]), (Some("**"), &[])]));
        let (all, nothing) = (Box::new(Selector::All), Box::new(Selector::Nothing));
        for s in [
            Selector::All,
            exact.clone(),
            below.clone(),
            Selector::Union(Box::new(below), nothing.clone()),
            Selector::Both(all.clone(), Box::new(exact)),
            Selector::Minus(all, nothing),
        ] {
            assert!(s.names(&a), "{s:?}");
            assert!(s.may_name(&["bone", "rot"]) && s.may_name(&["rot"]), "{s:?}");
        }
        for s in [Selector::Nothing, Selector::Kind(ChoiceKind::Discrete)] {
            assert!(!s.names(&a) && !s.may_name(&["rot"]), "{s:?}");
        }
    }
}
