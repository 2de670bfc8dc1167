//! Intervals of numbers: their ends, the part of a space between two bounds, integrals
//! over them, and the order of doubles.

use crate::dist::Support;
use crate::dist::param::MAX_INTEGER;

/// Positive nodes and weights of the Gauss-Legendre rule with 10 points on (-1, 1).
const RULE: [(f64, f64); 5] = [
    (0.148_874_338_981_631_21, 0.295_524_224_714_752_87),
    (0.433_395_394_129_247_19, 0.269_266_719_309_996_36),
    (0.679_409_568_299_024_41, 0.219_086_362_515_982_04),
    (0.865_063_366_688_984_51, 0.149_451_349_150_580_59),
    (0.973_906_528_517_171_72, 0.066_671_344_308_688_14),
];

/// Returns the ends of a space of numbers.
pub(in crate::dist) fn ends(s: &Support) -> Option<(f64, f64)> {
    Some(match s {
        Support::Real => (f64::NEG_INFINITY, f64::INFINITY),
        Support::Positive => (0.0, f64::INFINITY),
        Support::AtLeast { lo } => (*lo, f64::INFINITY),
        Support::AtMost { hi } => (f64::NEG_INFINITY, *hi),
        Support::Interval { lo, hi } => (*lo, *hi),
        Support::Integers { lo, hi } => (*lo as f64, hi.map_or(f64::INFINITY, |hi| hi as f64)),
        _ => return None,
    })
}

/// Returns the part of a space between two bounds; `None` if it is empty.
pub(in crate::dist) fn within(s: &Support, lo: f64, hi: f64) -> Option<Support> {
    let (least, most) = ends(s)?;
    let (from, to) = (least.max(lo), most.min(hi));
    if let Support::Integers { .. } = s {
        let (from, to) = (libm::ceil(from), libm::floor(to));
        if !(from <= to && from.abs() <= MAX_INTEGER) {
            return None;
        }
        let hi = (to <= MAX_INTEGER).then_some(to as i64);
        return Some(Support::Integers { lo: from as i64, hi });
    }
    if from >= to {
        return None;
    }
    Some(match (from == f64::NEG_INFINITY, to == f64::INFINITY) {
        (true, true) => Support::Real,
        (false, true) if *s == Support::Positive && from == 0.0 => Support::Positive,
        (false, true) => Support::AtLeast { lo: from },
        (true, false) => Support::AtMost { hi: to },
        (false, false) => Support::Interval { lo: from, hi: to },
    })
}

/// Returns the rank of a double among all doubles.
pub(in crate::dist) fn order(x: f64) -> i128 {
    let bits = x.to_bits();
    i128::from(if bits >> 63 == 0 { bits as i64 } else { -((bits & !(1 << 63)) as i64) })
}

/// Returns the double with this rank.
pub(in crate::dist) fn from_order(k: i128) -> f64 {
    let size = f64::from_bits(k.unsigned_abs() as u64);
    if k < 0 { -size } else { size }
}

/// Calls `f` with the nodes and weights of the rule on an interval.
pub(in crate::dist) fn each_node(from: f64, to: f64, mut f: impl FnMut(f64, f64)) {
    let (centre, half) = (0.5 * from + 0.5 * to, 0.5 * (to - from));
    for (x, w) in RULE {
        f(centre - half * x, half * w);
        f(centre + half * x, half * w);
    }
}

/// Integrates over an interval by the rule.
pub(in crate::dist) fn integral(from: f64, to: f64, f: impl Fn(f64) -> f64) -> f64 {
    let (centre, half) = (0.5 * from + 0.5 * to, 0.5 * (to - from));
    half * RULE.iter().map(|(x, w)| w * (f(centre - half * x) + f(centre + half * x))).sum::<f64>()
}
