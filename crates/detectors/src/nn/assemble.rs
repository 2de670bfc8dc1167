//! Builds operators from the entries of a file and checks them against their tensors, so
//! that running them cannot fail.

use super::NetworkError;
use super::convolution::Convolution;
use super::depthwise::Depthwise;
use super::file::File;
use super::flatbuffer::Table;
use super::operator::Operator;
use super::resampling::Alignment;
use super::schema::{TRANSPOSED, code};
use super::shape::{Clip, Size, Window};
use super::transposed::Transposed;

/// The maximum side of a window, and the maximum stride.
pub(super) const LONGEST: usize = 64;

/// An operator in the file: its options, inputs and output.
pub(super) struct Entry<'a> {
    pub code: i32,
    pub custom: &'a [u8],
    pub options: Option<Table<'a>>,
    pub inputs: Vec<usize>,
    pub output: usize,
}

type Checked<T> = Result<T, Rejection>;

/// The reason why an operator is rejected.
pub(super) enum Rejection {
    File(NetworkError),
    Operator(String),
}

impl From<NetworkError> for Rejection {
    fn from(e: NetworkError) -> Self {
        Rejection::File(e)
    }
}

impl From<&str> for Rejection {
    fn from(why: &str) -> Self {
        Rejection::Operator(why.into())
    }
}

impl<'a> Entry<'a> {
    fn byte(&self, i: usize) -> Checked<u8> {
        Ok(self.options.map_or(Ok(0), |o| o.u8(i))?)
    }

    fn number(&self, i: usize, default: i32) -> Checked<i32> {
        Ok(self.options.map_or(Ok(default), |o| o.i32(i, default))?)
    }

    fn size(&self, i: usize, default: i32) -> Checked<usize> {
        match usize::try_from(self.number(i, default)?) {
            Ok(n @ 1..=LONGEST) => Ok(n),
            _ => Err("a window or stride has an invalid size".into()),
        }
    }

    /// Returns a window of this size. The options start with the padding, then the
    /// strides along columns and rows.
    fn window(&self, size: [usize; 2]) -> Checked<Window> {
        if size.iter().any(|s| !(1..=LONGEST).contains(s)) {
            return Err("a window has an invalid size".into());
        }
        let same = match self.byte(0)? {
            0 => true,
            1 => false,
            _ => return Err("unknown padding".into()),
        };
        let stride = [self.size(2, 1)?, self.size(1, 1)?];
        Ok(Window { size, stride, same, shift: [0, 0] })
    }

    fn clip(&self, i: usize) -> Checked<Clip> {
        match self.byte(i)? {
            0 => Ok(Clip::NONE),
            1 => Ok(Clip { lo: 0.0, hi: f32::INFINITY }),
            3 => Ok(Clip { lo: 0.0, hi: 6.0 }),
            _ => Err("unknown activation".into()),
        }
    }
}

impl<'a> File<'a> {
    /// Returns the operator of an entry, and the inputs that it reads when it runs.
    pub fn operator(&mut self, e: &Entry) -> Checked<(Operator<'a>, Vec<usize>)> {
        let first = *e.inputs.first().ok_or("it has no input")?;
        let (input, output) = (self.shapes[first].clone(), self.shapes[e.output].clone());
        let pictures =
            || Size::of(&input).zip(Size::of(&output)).ok_or("its tensors are not single images");
        let one = |operator: Operator<'a>| Ok((operator, vec![first]));
        let fits = |holds: bool| {
            if holds {
                Ok(())
            } else {
                Err(Rejection::from("the shapes of its tensors do not match"))
            }
        };
        match e.code {
            code::CONVOLUTION | code::DEPTHWISE => {
                let (from, to) = pictures()?;
                let [dilation_at, clip_at] =
                    if e.code == code::CONVOLUTION { [4, 3] } else { [5, 4] };
                if (e.number(dilation_at, 1)?, e.number(dilation_at + 1, 1)?) != (1, 1) {
                    return Err("dilation is not supported".into());
                }
                let [_, weights, ..] = e.inputs[..] else { return Err("it has no weights".into()) };
                let [outer, height, width, inner] = self.shapes[weights][..] else {
                    return Err("its weights do not have four dimensions".into());
                };
                let window = e.window([height, width])?;
                fits(window.output(from, to.channels) == Some(to))?;
                let clip = e.clip(clip_at)?;
                let biases = self.biases(e, to.channels)?;
                if e.code == code::CONVOLUTION {
                    fits((outer, inner) == (to.channels, from.channels))?;
                    let depth = height * width * inner;
                    let weights = (self.weights(weights, to.channels)?, depth);
                    return one(Operator::Convolution(Convolution::new(
                        window, weights, &biases, clip,
                    )));
                }
                let weights = self.numbers(weights)?;
                fits((outer, inner) == (1, to.channels) && from.channels == to.channels)?;
                one(Operator::Depthwise(Depthwise { window, weights, biases, clip }))
            }
            code::CUSTOM if e.custom == TRANSPOSED => {
                let (from, to) = pictures()?;
                let [_, weights, _] = e.inputs[..] else {
                    return Err("it has no weights and biases".into());
                };
                let [outer, height, width, inner] = self.shapes[weights][..] else {
                    return Err("its weights do not have four dimensions".into());
                };
                let stride = [to.height / from.height, to.width / from.width];
                fits(stride.iter().all(|s| (1..=LONGEST).contains(s)))?;
                fits([height, width].iter().all(|s| (1..=LONGEST).contains(s)))?;
                let window = Window { size: [height, width], stride, same: true, shift: [0, 0] };
                let biases = self.biases(e, to.channels)?;
                let weights = self.numbers(weights)?;
                let transposed = Transposed { window, weights, biases };
                fits(
                    (outer, inner) == (to.channels, from.channels) && transposed.output(from) == to,
                )?;
                one(Operator::Transposed(transposed))
            }
            code::PAD => {
                let (from, to) = pictures()?;
                let [_, by] = e.inputs[..] else { return Err("it has no padding widths".into()) };
                let by: Vec<usize> = self
                    .integers(by)?
                    .into_iter()
                    .filter_map(|p| usize::try_from(p).ok())
                    .collect();
                let [0, 0, top, bottom, left, right, near, far] = by[..] else {
                    return Err("its padding widths are not those of an image".into());
                };
                let sides = [
                    (from.height, top, bottom),
                    (from.width, left, right),
                    (from.channels, near, far),
                ];
                let padded = sides.map(|(n, a, b)| n.checked_add(a).and_then(|n| n.checked_add(b)));
                fits(padded == [Some(to.height), Some(to.width), Some(to.channels)])?;
                one(Operator::Pad { before: [top, left, near], value: 0.0 })
            }
            code::MAX_POOL | code::AVERAGE_POOL => {
                let (from, to) = pictures()?;
                let window = e.window([e.size(4, 0)?, e.size(3, 0)?])?;
                fits(window.output(from, from.channels) == Some(to))?;
                one(Operator::Pool { window, largest: e.code == code::MAX_POOL, clip: e.clip(5)? })
            }
            code::MEAN => {
                let from = Size::of(&input).ok_or("its input is not an image")?;
                let [_, axes] = e.inputs[..] else { return Err("it has no axes".into()) };
                fits(
                    self.integers(axes)? == [1, 2]
                        && output.iter().product::<usize>() == from.channels,
                )?;
                one(Operator::Mean)
            }
            code::RESIZE => {
                let (from, to) = pictures()?;
                fits(from.channels == to.channels)?;
                one(Operator::Resize(match (e.byte(2)?, e.byte(3)?) {
                    (_, 1..) => Alignment::HalfPixels,
                    (1.., _) => Alignment::Corners,
                    _ => Alignment::First,
                }))
            }
            code::DEPTH_TO_SPACE => {
                let (from, to) = pictures()?;
                let side = e.size(0, 0)?;
                fits((from.height * side, from.width * side) == (to.height, to.width))?;
                fits(from.channels == to.channels * side * side)?;
                one(Operator::DepthToSpace(side))
            }
            code::CONCATENATION => {
                let axis = e.number(0, 0)?;
                let axis = if axis < 0 { axis + output.len() as i32 } else { axis };
                let along = usize::try_from(axis)
                    .ok()
                    .filter(|a| *a < output.len())
                    .ok_or("its dimension does not exist")?;
                let mut whole = 0;
                for t in &e.inputs {
                    let shape = &self.shapes[*t];
                    fits(shape.len() == output.len())?;
                    fits(
                        shape
                            .iter()
                            .zip(&output)
                            .enumerate()
                            .all(|(i, (a, b))| i == along || a == b),
                    )?;
                    whole += shape[along];
                }
                fits(whole == output[along])?;
                match e.byte(1)? {
                    0 => Ok((Operator::Concatenate(along), e.inputs.clone())),
                    _ => Err("unknown activation".into()),
                }
            }
            code::ADD | code::MULTIPLY => {
                let [a, b] = e.inputs[..] else { return Err("it does not have two inputs".into()) };
                let (a_shape, b_shape) = (&self.shapes[a], &self.shapes[b]);
                let (long, short) =
                    if a_shape.iter().product::<usize>() >= b_shape.iter().product::<usize>() {
                        (a_shape, b_shape)
                    } else {
                        (b_shape, a_shape)
                    };
                // The same shape, one number per channel, or a single number.
                let channels =
                    short.iter().rposition(|n| *n != 1).map_or(&[][..], |last| &short[last..]);
                let broadcast = short.iter().filter(|n| **n != 1).count() <= 1
                    && (channels.is_empty()
                        || long.last() == channels.last() && short.last() == channels.last());
                fits((long == short || broadcast) && *long == output)?;
                let clip = e.clip(0)?;
                Ok((
                    if e.code == code::ADD {
                        Operator::Add(clip)
                    } else {
                        Operator::Multiply(clip)
                    },
                    vec![a, b],
                ))
            }
            code::RESHAPE => {
                fits(input.iter().product::<usize>() == output.iter().product::<usize>())?;
                one(Operator::Reshape)
            }
            code::SIGMOID | code::RELU | code::HARD_SWISH => {
                fits(input == output)?;
                one(match e.code {
                    code::SIGMOID => Operator::Sigmoid,
                    code::RELU => Operator::Relu,
                    _ => Operator::HardSwish,
                })
            }
            _ => Err("unsupported operator".into()),
        }
    }

    /// Returns the third input, with a number for each channel; zeros if it is missing.
    fn biases(&mut self, e: &Entry, channels: usize) -> Checked<Vec<f32>> {
        let Some(t) = e.inputs.get(2) else { return Ok(vec![0.0; channels]) };
        let biases = self.numbers(*t)?;
        if biases.len() == channels {
            Ok(biases)
        } else {
            Err("the number of biases does not match its channels".into())
        }
    }
}
