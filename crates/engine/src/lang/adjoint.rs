//! Adjoints: the derivatives of a number with respect to a value, in the value's shape.
//! They flow backwards through a program when a gradient is taken (reverse mode).

use pcadlang_numerics::num::accumulate;
use std::sync::Arc;

/// The derivatives of a number with respect to a value.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Adjoint {
    /// Zero, whatever the shape.
    #[default]
    Zero,
    /// With respect to a number.
    Num(f64),
    /// With respect to an array of numbers. For a distribution: with respect to its
    /// parameters, in the order of its constructor. For an object or a likelihood: as its
    /// type defines.
    Array(Vec<f64>),
    /// With respect to some of the points of a list, such as the vertices of a mesh: each the
    /// number of a point and the derivatives with respect to its three coordinates. Those of a
    /// point that is there several times add up.
    Points(Vec<(u32, [f64; 3])>),
    /// With respect to the elements of an array.
    List(Vec<Adjoint>),
    /// With respect to some fields of a record.
    Record(Vec<(Arc<str>, Adjoint)>),
    /// There is a dependence whose derivative is not known.
    Unknown,
}

impl Adjoint {
    /// True if it is zero.
    pub fn is_zero(&self) -> bool {
        matches!(self, Adjoint::Zero)
    }

    /// True if any part of it is unknown.
    pub fn is_unknown(&self) -> bool {
        match self {
            Adjoint::Unknown => true,
            Adjoint::List(all) => all.iter().any(Adjoint::is_unknown),
            Adjoint::Record(all) => all.iter().any(|(_, a)| a.is_unknown()),
            _ => false,
        }
    }

    /// Returns the derivative with respect to a number; 0 if this is not the adjoint of a
    /// number.
    pub fn number(&self) -> f64 {
        if let Adjoint::Num(g) = self { *g } else { 0.0 }
    }

    /// Returns the adjoint of element `i` of an array.
    pub fn element(&self, i: usize) -> Adjoint {
        match self {
            Adjoint::Array(gs) => gs.get(i).map_or(Adjoint::Zero, |g| Adjoint::Num(*g)),
            Adjoint::List(all) => all.get(i).cloned().unwrap_or_default(),
            Adjoint::Unknown => Adjoint::Unknown,
            _ => Adjoint::Zero,
        }
    }

    /// Returns the adjoint of a field of a record.
    pub fn field(&self, name: &str) -> Adjoint {
        match self {
            Adjoint::Record(all) => {
                all.iter().find(|(n, _)| **n == *name).map(|(_, a)| a.clone()).unwrap_or_default()
            }
            Adjoint::Unknown => Adjoint::Unknown,
            _ => Adjoint::Zero,
        }
    }

    /// Returns the derivatives with respect to an array of `n` numbers.
    pub fn numbers(&self, n: usize) -> Vec<f64> {
        match self {
            Adjoint::Array(gs) if gs.len() == n => gs.clone(),
            other => (0..n).map(|i| other.element(i).number()).collect(),
        }
    }

    /// Multiplies all of it by a factor.
    pub fn scale(&mut self, factor: f64) {
        if factor == 1.0 {
            return;
        }
        match self {
            Adjoint::Num(g) => *g *= factor,
            Adjoint::Array(gs) => gs.iter_mut().for_each(|g| *g *= factor),
            Adjoint::Points(all) => {
                all.iter_mut().flat_map(|(_, g)| g).for_each(|g| *g *= factor);
            }
            Adjoint::List(all) => all.iter_mut().for_each(|a| a.scale(factor)),
            Adjoint::Record(all) => all.iter_mut().for_each(|(_, a)| a.scale(factor)),
            Adjoint::Zero | Adjoint::Unknown => {}
        }
    }

    /// Adds another adjoint of the same shape.
    pub fn add(&mut self, other: Adjoint) {
        match (&mut *self, other) {
            (_, Adjoint::Zero) | (Adjoint::Unknown, _) => {}
            (Adjoint::Zero, other) => *self = other,
            (Adjoint::Num(a), Adjoint::Num(b)) => *a += b,
            (Adjoint::Array(a), Adjoint::Array(b)) => accumulate(a, &b),
            (Adjoint::Points(a), Adjoint::Points(b)) => a.extend(b),
            (Adjoint::Record(_), Adjoint::Record(fields)) => {
                fields.into_iter().for_each(|(name, by)| self.add_field(&name, by));
            }
            (Adjoint::List(a), Adjoint::List(b)) if a.len() == b.len() => {
                a.iter_mut().zip(b).for_each(|(a, b)| a.add(b));
            }
            (
                Adjoint::Array(_) | Adjoint::List(_),
                other @ (Adjoint::Array(_) | Adjoint::List(_)),
            ) => {
                let n = match &other {
                    Adjoint::List(all) => all.len(),
                    Adjoint::Array(gs) => gs.len(),
                    _ => 0,
                };
                (0..n).for_each(|i| self.add_element(n, i, other.element(i)));
            }
            _ => *self = Adjoint::Unknown,
        }
    }

    /// Adds to the adjoint of element `i` of an array of `n`.
    pub fn add_element(&mut self, n: usize, i: usize, by: Adjoint) {
        match (&mut *self, by) {
            (_, Adjoint::Zero) | (Adjoint::Unknown, _) => {}
            (Adjoint::Zero, Adjoint::Num(g)) => {
                let mut all = vec![0.0; n];
                if let Some(a) = all.get_mut(i) {
                    *a = g;
                }
                *self = Adjoint::Array(all);
            }
            (Adjoint::Array(all), Adjoint::Num(g)) => {
                if all.len() < n {
                    all.resize(n, 0.0);
                }
                if let Some(a) = all.get_mut(i) {
                    *a += g;
                }
            }
            (Adjoint::List(all), by) => {
                if all.len() < n {
                    all.resize(n, Adjoint::Zero);
                }
                if let Some(a) = all.get_mut(i) {
                    a.add(by);
                }
            }
            (Adjoint::Zero, by) => {
                let mut all = vec![Adjoint::Zero; n];
                if let Some(a) = all.get_mut(i) {
                    *a = by;
                }
                *self = Adjoint::List(all);
            }
            (Adjoint::Array(gs), by) => {
                let all = gs.iter().map(|g| Adjoint::Num(*g)).collect();
                *self = Adjoint::List(all);
                self.add_element(n, i, by);
            }
            _ => *self = Adjoint::Unknown,
        }
    }

    /// Adds to the adjoint of a field of a record.
    pub fn add_field(&mut self, name: &Arc<str>, by: Adjoint) {
        if by.is_zero() {
            return;
        }
        match &mut *self {
            Adjoint::Zero => *self = Adjoint::Record(vec![(Arc::clone(name), by)]),
            Adjoint::Record(all) => match all.iter_mut().find(|(n, _)| n == name) {
                Some((_, a)) => a.add(by),
                None => all.push((Arc::clone(name), by)),
            },
            _ => *self = Adjoint::Unknown,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_become_lists_when_they_must() {
        let mut a = Adjoint::Zero;
        a.add_element(3, 1, Adjoint::Num(2.0));
        assert_eq!(a, Adjoint::Array(vec![0.0, 2.0, 0.0]));
        a.add(Adjoint::Array(vec![1.0, 1.0, 1.0]));
        a.add_element(3, 0, Adjoint::Zero);
        assert_eq!(a.numbers(3), [1.0, 3.0, 1.0]);
        let mut rows = Adjoint::Zero;
        rows.add_element(2, 1, Adjoint::Array(vec![5.0]));
        assert_eq!((rows.element(0), rows.element(1)), (Adjoint::Zero, Adjoint::Array(vec![5.0])));
    }

    #[test]
    fn points_may_be_there_twice() {
        let mut a = Adjoint::List(vec![Adjoint::Zero, Adjoint::Points(vec![(7, [1.0; 3])])]);
        a.add(Adjoint::List(vec![
            Adjoint::Array(vec![4.0]),
            Adjoint::Points(vec![(2, [2.0; 3]), (7, [3.0; 3])]),
        ]));
        a.scale(2.0);
        assert_eq!(a.element(0), Adjoint::Array(vec![8.0]));
        assert_eq!(
            a.element(1),
            Adjoint::Points(vec![(7, [2.0; 3]), (2, [4.0; 3]), (7, [6.0; 3])])
        );
    }
}
