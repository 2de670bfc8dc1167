//! Weights of convolutions, which stay in the form of their file: a part of them is decoded
//! when it is multiplied.

/// The number of weights per column that are decoded and summed before the next part, so that
/// they and the rows stay in the nearest cache.
pub(super) const DEEP: usize = 256;

/// How a number is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Half,
    Float,
}

/// The weights of each output channel: by window row, window column and input channel.
#[derive(Debug)]
pub(super) enum Weights<'a> {
    /// In the file, one output channel after the other.
    ByOutput(Numbers<'a>),
    /// In the file, those of all output channels together.
    ByInput(Numbers<'a>),
    /// Those other than 0.
    Sparse(Sparse),
}

/// Numbers in a file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Numbers<'a> {
    kind: Kind,
    bytes: &'a [u8],
}

impl<'a> Numbers<'a> {
    pub fn new(kind: Kind, bytes: &'a [u8]) -> Numbers<'a> {
        Numbers { kind, bytes }
    }

    pub fn len(self) -> usize {
        match self.kind {
            Kind::Half => self.bytes.len() / 2,
            Kind::Float => self.bytes.len() / 4,
        }
    }

    pub fn are_finite(self) -> bool {
        match self.kind {
            // All bits of the exponent are set in what is not.
            Kind::Half => {
                let halves = self.bytes.as_chunks::<2>().0.iter();
                halves.fold(0, |n, b| n | u16::from(u16::from_le_bytes(*b) & 0x7c00 == 0x7c00)) == 0
            }
            Kind::Float => {
                let mut floats = self.bytes.as_chunks::<4>().0.iter();
                floats.all(|b| f32::from_le_bytes(*b).is_finite())
            }
        }
    }

    /// Returns all of them.
    pub fn all(self) -> Vec<f32> {
        match self.kind {
            Kind::Half => {
                let halves = self.bytes.as_chunks::<2>().0.iter();
                halves.map(|b| half::f16::from_le_bytes(*b).to_f32()).collect()
            }
            Kind::Float => {
                let floats = self.bytes.as_chunks::<4>().0.iter();
                floats.map(|b| f32::from_le_bytes(*b)).collect()
            }
        }
    }

    /// Fills `out` with those from an index on, which are finite.
    #[inline(always)]
    fn part(self, from: usize, out: &mut [f32]) {
        match self.kind {
            Kind::Half => {
                let halves = self.bytes[2 * from..][..2 * out.len()].as_chunks::<2>().0;
                out.iter_mut().zip(halves).for_each(|(o, b)| *o = of_half(u16::from_le_bytes(*b)));
            }
            Kind::Float => {
                let floats = self.bytes[4 * from..][..4 * out.len()].as_chunks::<4>().0;
                out.iter_mut().zip(floats).for_each(|(o, b)| *o = f32::from_le_bytes(*b));
            }
        }
    }
}

/// Returns the finite number that a half stands for, exactly. Without branches, so that many are
/// converted at a time.
#[inline(always)]
fn of_half(bits: u16) -> f32 {
    let (sign, size) = (u32::from(bits & 0x8000) << 16, u32::from(bits & 0x7fff));
    // The exponent is counted from -112 + 15; without one, the number is a multiple of 2^-24.
    let normal = (size << 13) + (112 << 23);
    let small = (size as i32 as f32 * f32::from_bits(103 << 23)).to_bits();
    f32::from_bits(sign | if size < 0x400 { small } else { normal })
}

/// Weights other than 0: those of output channel o are from `starts[o]` to `starts[o + 1]`.
#[derive(Debug)]
pub(super) struct Sparse {
    starts: Vec<usize>,
    /// The place of each among those of its channel.
    places: Vec<u16>,
    values: Vec<f32>,
}

impl Sparse {
    /// Takes all weights of each channel, one channel after the other; `None` if there are too
    /// many for a channel.
    pub fn new(weights: &[f32], channels: usize) -> Option<Sparse> {
        let mut sparse = Sparse { starts: vec![0], places: Vec::new(), values: Vec::new() };
        for row in weights.chunks_exact((weights.len() / channels.max(1)).max(1)) {
            for (k, w) in row.iter().enumerate().filter(|(_, w)| **w != 0.0) {
                sparse.places.push(u16::try_from(k).ok()?);
                sparse.values.push(*w);
            }
            sparse.starts.push(sparse.values.len());
        }
        sparse.places.shrink_to_fit();
        sparse.values.shrink_to_fit();
        Some(sparse)
    }
}

impl Weights<'_> {
    /// Fills a part of a panel: the weights from `start` on, of `depth` per channel, of the
    /// channels from `first` on, of `channels` in all. Those of channels that do not exist may be
    /// anything.
    #[inline(always)]
    pub fn panel<const P: usize>(
        &self,
        (start, depth): (usize, usize),
        (first, channels): (usize, usize),
        panel: &mut [[f32; P]],
    ) {
        let width = P.min(channels - first);
        match self {
            Weights::ByInput(numbers) => {
                for (k, row) in panel.iter_mut().enumerate() {
                    let at = (start + k) * channels + first;
                    match width == P {
                        true => numbers.part(at, &mut row[..P]),
                        false => numbers.part(at, &mut row[..width]),
                    }
                }
            }
            Weights::ByOutput(numbers) => {
                let mut of_one = [0.0; DEEP];
                let of_one = &mut of_one[..panel.len()];
                for o in 0..width {
                    numbers.part((first + o) * depth + start, of_one);
                    panel.iter_mut().zip(&*of_one).for_each(|(row, w)| row[o] = *w);
                }
            }
            Weights::Sparse(s) => {
                panel.as_flattened_mut().fill(0.0);
                for o in 0..width {
                    let channel = s.starts[first + o]..s.starts[first + o + 1];
                    let (places, values) = (&s.places[channel.clone()], &s.values[channel]);
                    let from = places.partition_point(|k| usize::from(*k) < start);
                    for (k, w) in places[from..].iter().zip(&values[from..]) {
                        let Some(row) = panel.get_mut(usize::from(*k) - start) else { break };
                        row[o] = *w;
                    }
                }
            }
        }
    }
}
