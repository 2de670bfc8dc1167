//! The operators of a network, on tensors.

use super::convolution::Convolution;
use super::depthwise::Depthwise;
use super::resampling::{self, Alignment};
use super::shape::{Clip, Size, Window};
use super::transposed::Transposed;

/// An operator with its parameters.
#[derive(Debug)]
pub(super) enum Operator<'a> {
    Convolution(Convolution<'a>),
    Depthwise(Depthwise),
    Transposed(Transposed),
    /// A value around an image: the numbers above, to the left, and before the first
    /// channel.
    Pad {
        before: [usize; 3],
        value: f32,
    },
    Pool {
        window: Window,
        largest: bool,
        clip: Clip,
    },
    Mean,
    Resize(Alignment),
    DepthToSpace(usize),
    /// Concatenates tensors along this dimension.
    Concatenate(usize),
    /// Reinterprets the numbers in another shape.
    Reshape,
    /// Element-wise; the shorter operand is repeated, e.g. one number per channel.
    Add(Clip),
    Multiply(Clip),
    Sigmoid,
    Relu,
    /// Multiplies negative numbers by this, from 0 to 1.
    LeakyRelu(f32),
    HardSwish,
    /// The part of a tensor along a dimension, from an index on.
    Slice {
        along: usize,
        start: usize,
    },
    /// Reorders dimensions: that dimension of the input is at this place of the output.
    Transpose(Vec<usize>),
}

/// A tensor during a run.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tensor<'a> {
    pub shape: &'a [usize],
    pub values: &'a [f32],
}

/// 1 / (1 + e^-x).
pub fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + libm::expf(-x))
}

impl Operator<'_> {
    /// Fills `out`, of this shape, from the inputs. Shapes were checked when the network
    /// was read. `own` is memory of the operator's, [`Operator::memory`] elements or more.
    pub fn run(&self, inputs: &[Tensor], shape: &[usize], own: &mut [f32], out: &mut [f32]) {
        let Some(first) = inputs.first() else { return };
        let pictures = Size::of(first.shape).zip(Size::of(shape));
        match (self, pictures) {
            (Operator::Convolution(c), Some((from, to))) => c.run(first.values, from, to, own, out),
            (Operator::Depthwise(c), Some((from, to))) => c.run(first.values, from, to, out),
            (Operator::Transposed(c), Some((from, to))) => c.run(first.values, from, to, out),
            (Operator::Pad { before, value }, Some((from, to))) => {
                resampling::pad(first.values, from, to, *before, *value, out)
            }
            (Operator::Pool { window, largest, clip }, Some((from, to))) => {
                resampling::pool(first.values, from, to, window, *largest, out);
                clip.apply(out);
            }
            (Operator::Resize(alignment), Some((from, to))) => {
                resampling::resize(first.values, from, to, *alignment, out)
            }
            (Operator::DepthToSpace(side), Some((from, to))) => {
                resampling::depth_to_space(first.values, from, to, *side, out)
            }
            (Operator::Mean, _) => {
                if let Some(from) = Size::of(first.shape) {
                    resampling::mean(first.values, from, out)
                }
            }
            (Operator::Concatenate(along), _) => concatenate(inputs, *along, out),
            (Operator::Add(clip), _) => {
                combine(inputs, out, |a, b| a + b);
                clip.apply(out);
            }
            (Operator::Multiply(clip), _) => {
                combine(inputs, out, |a, b| a * b);
                clip.apply(out);
            }
            (Operator::Reshape, _) => out.copy_from_slice(first.values),
            (Operator::Sigmoid, _) => each(first.values, out, sigmoid),
            (Operator::Relu, _) => each(first.values, out, |x| x.max(0.0)),
            (Operator::LeakyRelu(slope), _) => each(first.values, out, |x| x.max(slope * x)),
            (Operator::Slice { along, start }, _) => slice(*first, shape, *along, *start, out),
            (Operator::Transpose(order), _) => transpose(*first, shape, order, out),
            (Operator::HardSwish, _) => each(first.values, out, hard_swish),
            // Rejected when the network was read.
            (_, None) => {}
        }
    }

    /// The number of elements that it needs while it runs, beside inputs and output.
    pub fn memory(&self, input: &[usize], output: &[usize]) -> usize {
        match (self, Size::of(input).zip(Size::of(output))) {
            (Operator::Convolution(c), Some((from, to))) => c.memory(from, to),
            _ => 0,
        }
    }

    /// True if [`Operator::run_within`] can replace its input by its output, number by number.
    pub fn works_within(&self) -> bool {
        use Operator::{Add, HardSwish, LeakyRelu, Multiply, Relu, Reshape, Sigmoid};
        matches!(self, Add(_) | Multiply(_) | Reshape | Sigmoid | Relu | LeakyRelu(_) | HardSwish)
    }

    /// Replaces an input, the longer one, by the output; gives the same as [`Operator::run`].
    pub fn run_within(&self, other: Option<Tensor>, values: &mut [f32]) {
        let other = other.map_or(&[][..], |t| t.values);
        match self {
            Operator::Add(clip) => {
                combine_within(values, other, |a, b| a + b);
                clip.apply(values);
            }
            Operator::Multiply(clip) => {
                combine_within(values, other, |a, b| a * b);
                clip.apply(values);
            }
            Operator::Sigmoid => values.iter_mut().for_each(|v| *v = sigmoid(*v)),
            Operator::Relu => values.iter_mut().for_each(|v| *v = v.max(0.0)),
            Operator::LeakyRelu(slope) => values.iter_mut().for_each(|v| *v = v.max(slope * *v)),
            Operator::HardSwish => values.iter_mut().for_each(|v| *v = hard_swish(*v)),
            // The same numbers.
            _ => {}
        }
    }

    /// The number of multiplications to fill `out` numbers.
    pub fn work(&self, inputs: &[&[usize]], out: usize) -> usize {
        let channels = inputs.first().and_then(|s| s.last()).copied().unwrap_or(1);
        let window = |w: &Window| w.size[0] * w.size[1];
        match self {
            Operator::Convolution(c) => out.saturating_mul(window(&c.window) * channels),
            Operator::Transposed(c) => out.saturating_mul(window(&c.window) * channels),
            Operator::Depthwise(c) => out.saturating_mul(window(&c.window)),
            Operator::Pool { window: w, .. } => out.saturating_mul(window(w)),
            Operator::Mean => inputs.iter().map(|s| s.iter().product::<usize>()).sum(),
            _ => out,
        }
    }
}

fn each(values: &[f32], out: &mut [f32], f: impl Fn(f32) -> f32) {
    out.iter_mut().zip(values).for_each(|(o, v)| *o = f(*v));
}

/// Applies `f` element by element; the shorter operand is repeated.
fn combine(inputs: &[Tensor], out: &mut [f32], f: impl Fn(f32, f32) -> f32) {
    let [a, b] = inputs else { return };
    let (long, short) = if a.values.len() >= b.values.len() { (a, b) } else { (b, a) };
    for (out, long) in
        out.chunks_mut(short.values.len()).zip(long.values.chunks(short.values.len()))
    {
        out.iter_mut().zip(long.iter().zip(short.values)).for_each(|(o, (x, y))| *o = f(*x, *y));
    }
}

/// The same in the place of the longer one.
fn combine_within(long: &mut [f32], short: &[f32], f: impl Fn(f32, f32) -> f32) {
    for long in long.chunks_mut(short.len().max(1)) {
        long.iter_mut().zip(short).for_each(|(x, y)| *x = f(*x, *y));
    }
}

fn hard_swish(x: f32) -> f32 {
    x * (x + 3.0).clamp(0.0, 6.0) / 6.0
}

fn concatenate(inputs: &[Tensor], along: usize, out: &mut [f32]) {
    let run = |t: &Tensor| t.shape[along..].iter().product::<usize>();
    let whole: usize = inputs.iter().map(run).sum();
    for (i, line) in out.chunks_exact_mut(whole).enumerate() {
        let mut at = 0;
        for t in inputs {
            let n = run(t);
            line[at..at + n].copy_from_slice(&t.values[i * n..(i + 1) * n]);
            at += n;
        }
    }
}

/// Copies the part of a tensor that starts at an index of a dimension and has this shape.
fn slice(t: Tensor, shape: &[usize], along: usize, start: usize, out: &mut [f32]) {
    let inner: usize = shape[along + 1..].iter().product();
    let (part, whole) = (shape[along] * inner, t.shape[along] * inner);
    for (out, line) in out.chunks_exact_mut(part).zip(t.values.chunks_exact(whole)) {
        out.copy_from_slice(&line[start * inner..][..part]);
    }
}

/// Reorders the dimensions of a tensor to get this shape.
fn transpose(t: Tensor, shape: &[usize], order: &[usize], out: &mut [f32]) {
    let strides: Vec<usize> =
        order.iter().map(|d| t.shape[d + 1..].iter().product::<usize>()).collect();
    let (Some((last, outer)), Some(step)) = (shape.split_last(), strides.last()) else {
        return out.copy_from_slice(t.values);
    };
    let mut index = vec![0; outer.len()];
    let mut at = 0;
    for line in out.chunks_exact_mut(*last) {
        line.iter_mut().enumerate().for_each(|(i, o)| *o = t.values[at + i * step]);
        // The next line: the last outer dimension runs fastest.
        for d in (0..outer.len()).rev() {
            index[d] += 1;
            at += strides[d];
            if index[d] < outer[d] {
                break;
            }
            at -= index[d] * strides[d];
            index[d] = 0;
        }
    }
}
