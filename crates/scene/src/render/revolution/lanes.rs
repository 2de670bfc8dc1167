//! Numbers and conditions for several lines of sight or chords at a time: arrays of a
//! fixed length, so that loops over them are vectorised.

/// How many at a time.
pub(super) const LANES: usize = 8;

/// A number for each.
pub(super) type Row = [f64; LANES];

/// For each, all bits set or none.
pub(super) type Mask = [u64; LANES];

/// All bits set or none.
#[inline(always)]
pub(super) fn mask(on: bool) -> u64 {
    if on { u64::MAX } else { 0 }
}

/// True if any condition holds.
#[inline(always)]
pub(super) fn any(mask: &Mask) -> bool {
    let mut all = 0;
    for bits in mask {
        all |= bits;
    }
    all != 0
}

/// The opposite numbers.
#[inline(always)]
pub(super) fn reversed(way: &Row) -> Row {
    let mut out = [0.0; LANES];
    for i in 0..LANES {
        out[i] = -way[i];
    }
    out
}
