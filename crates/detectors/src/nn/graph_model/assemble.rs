//! Builds operators from the nodes of a graph model and checks them against their inputs,
//! so that running them cannot fail.
//!
//! Graph models transpose images around each convolution. Here a transposed tensor is a
//! view of the one that is stored, and numbers are moved only where an operator needs them
//! in an order.

use super::super::NetworkError;
use super::super::assemble::{LONGEST, Rejection};
use super::super::convolution::Convolution;
use super::super::network::{Effort, Layer, MOST_NUMBERS};
use super::super::operator::Operator;
use super::super::resampling::Alignment;
use super::super::shape::{Clip, Size, Window};
use super::super::weights::Weights;
use super::constants::Constant;
use super::file::Node;
use std::collections::HashMap;
use std::sync::Arc;

/// The maximum number of elements of integer constants, which are shapes and the like.
const MOST_INTEGERS: usize = 64;
/// The order of an image's dimensions: where rows, columns and channels are if channels
/// come first, and the reverse.
const CHANNELS_LAST: [usize; 4] = [0, 2, 3, 1];
const CHANNELS_FIRST: [usize; 4] = [0, 3, 1, 2];

type Checked<T> = Result<T, Rejection>;

/// A tensor with its dimensions in another order than stored.
#[derive(Clone, Debug)]
pub(super) struct View {
    tensor: usize,
    /// For each dimension, the stored one.
    order: Vec<usize>,
}

impl View {
    /// Returns this view with its dimensions in an order.
    fn ordered(&self, order: &[usize]) -> View {
        View { tensor: self.tensor, order: order.iter().map(|d| self.order[*d]).collect() }
    }
}

/// A node's output.
#[derive(Clone, Debug)]
pub(super) enum Value<'a> {
    Floats(Constant<'a>),
    Integers(Arc<[i32]>),
    Tensor(View),
}

/// The network so far.
#[derive(Default)]
pub(super) struct Assembly<'a> {
    pub layers: Vec<Layer<'a>>,
    pub shapes: Vec<Vec<usize>>,
    pub constants: HashMap<usize, Vec<f32>>,
    pub input: Option<usize>,
    /// The height and width of the input, if they are not the model's.
    pub image: Option<[usize; 2]>,
    /// By what the model's heights and widths are then multiplied and divided.
    scale: Option<[[usize; 2]; 2]>,
    pub effort: Effort,
    /// The number of constant elements that were read or stored.
    read: usize,
}

fn fits(holds: bool) -> Checked<()> {
    if holds { Ok(()) } else { Err("the shapes of its inputs do not match".into()) }
}

fn integers<'a>(inputs: &'a [&Value], i: usize) -> Checked<&'a [i32]> {
    match inputs.get(i) {
        Some(Value::Integers(values)) => Ok(values),
        _ => Err("an input is not a constant of integers".into()),
    }
}

fn tensor<'a>(inputs: &'a [&Value], i: usize) -> Checked<&'a View> {
    match inputs.get(i) {
        Some(Value::Tensor(view)) => Ok(view),
        _ => Err("an input is missing or constant".into()),
    }
}

/// Returns the dimension at an index, which counts from the end if it is negative.
fn dimension(at: &[i32], rank: usize) -> Checked<usize> {
    let [at] = at[..] else { return Err("expected one dimension".into()) };
    let from_start = if at < 0 { i64::from(at) + rank as i64 } else { i64::from(at) };
    let found = usize::try_from(from_start).ok().filter(|d| *d < rank);
    found.ok_or_else(|| "its dimension does not exist".into())
}

/// Returns integers as sizes of at least `least`.
fn sizes(values: &[i32], least: i32) -> Checked<Vec<usize>> {
    let all = values.iter().map(|v| usize::try_from(*v).ok().filter(|_| *v >= least));
    all.collect::<Option<_>>().ok_or_else(|| "a size is out of range".into())
}

impl<'a> Assembly<'a> {
    /// Adds a node; returns its outputs.
    pub fn node(
        &mut self,
        node: &Node,
        inputs: &[&Value<'a>],
        constants: &HashMap<String, Constant<'a>>,
    ) -> Checked<Vec<Value<'a>>> {
        let view = match &*node.op {
            "Const" => {
                let stored = constants.get(&node.name).ok_or("its values are missing")?;
                return Ok(vec![constant(stored)?]);
            }
            "Identity" => return Ok(vec![(*inputs.first().ok_or("it has no input")?).clone()]),
            "SparseToDense" => return Ok(vec![Value::Integers(dense(inputs)?)]),
            "Add" | "AddV2" => match inputs {
                [Value::Integers(a), Value::Integers(b)] => {
                    fits(a.len() == b.len())?;
                    let sums = a.iter().zip(b.iter()).map(|(a, b)| a.checked_add(*b));
                    let sums = sums.collect::<Option<_>>().ok_or("a sum is out of range")?;
                    return Ok(vec![Value::Integers(sums)]);
                }
                [Value::Tensor(a), Value::Tensor(b)] => self.add(a, b)?,
                [Value::Tensor(a), Value::Floats(b)] | [Value::Floats(b), Value::Tensor(a)] => {
                    self.add_constant(a, b)?
                }
                _ => return Err("it does not have two inputs of one kind".into()),
            },
            "SplitV" => return self.split(inputs),
            "Placeholder" => self.placeholder(node)?,
            "Transpose" => {
                let x = tensor(inputs, 0)?;
                let order = sizes(integers(inputs, 1)?, 0)?;
                let mut sorted = order.clone();
                sorted.sort_unstable();
                fits(sorted.into_iter().eq(0..x.order.len()))?;
                x.ordered(&order)
            }
            "LeakyRelu" => {
                let slope = node.number("alpha").filter(|s| (0.0..=1.0).contains(s));
                let slope = slope.ok_or("its slope is not from 0 to 1")?;
                self.each(Operator::LeakyRelu(slope), tensor(inputs, 0)?)?
            }
            "Sigmoid" => self.each(Operator::Sigmoid, tensor(inputs, 0)?)?,
            "Reshape" => self.reshape(tensor(inputs, 0)?, integers(inputs, 1)?)?,
            "ConcatV2" => self.concatenate(inputs)?,
            "Pad" | "PadV2" => self.pad(inputs)?,
            "Conv2D" => self.convolution(node, inputs)?,
            "MaxPool" => {
                let (x, from) = self.image(node, tensor(inputs, 0)?)?;
                let size = self::image(node, "ksize")?;
                let window = window(node, size)?;
                let to = window.output(from, from.channels);
                let pool = Operator::Pool { window, largest: true, clip: Clip::NONE };
                self.put_image(node, pool, x, to)?
            }
            "ResizeBilinear" => {
                let x = self.plain(tensor(inputs, 0)?)?;
                let from = Size::of(&self.shapes[x]).ok_or("its input is not an image")?;
                let to = sizes(integers(inputs, 1)?, 1)?;
                let [height, width] = to[..] else { return Err("expected two sizes".into()) };
                let [height, width] = self.scaled([height, width])?;
                let alignment = match (node.flag("half_pixel_centers"), node.flag("align_corners"))
                {
                    (true, false) => Alignment::HalfPixels,
                    (false, true) => Alignment::Corners,
                    (false, false) => Alignment::First,
                    (true, true) => return Err("unknown alignment".into()),
                };
                let shape = vec![1, height, width, from.channels];
                self.put(Operator::Resize(alignment), vec![x], shape)?
            }
            _ => return Err("unsupported operator".into()),
        };
        Ok(vec![Value::Tensor(view)])
    }

    /// Adds a tensor of this shape.
    fn tensor(&mut self, shape: Vec<usize>) -> Result<View, NetworkError> {
        let size = shape.iter().try_fold(1usize, |n, s| n.checked_mul(*s));
        match size {
            Some(1..=MOST_NUMBERS) if shape.len() <= 8 => {}
            _ => return Err(NetworkError::TooLarge(format!("a tensor of shape {shape:?}"))),
        }
        let order = (0..shape.len()).collect();
        self.shapes.push(shape);
        Ok(View { tensor: self.shapes.len() - 1, order })
    }

    /// Adds an operator with an output of this shape.
    fn put(
        &mut self,
        operator: Operator<'a>,
        inputs: Vec<usize>,
        shape: Vec<usize>,
    ) -> Result<View, NetworkError> {
        let view = self.tensor(shape)?;
        let read: Vec<&[usize]> = inputs.iter().map(|t| &self.shapes[*t][..]).collect();
        let size = self.shapes[view.tensor].iter().product();
        self.effort.add(&operator, &read, size)?;
        self.layers.push(Layer { operator, inputs, output: view.tensor });
        Ok(view)
    }

    /// Counts elements of constants, up to the limit.
    fn count(&mut self, elements: usize) -> Checked<()> {
        self.read = self.read.saturating_add(elements);
        match self.read {
            0..=MOST_NUMBERS => Ok(()),
            _ => Err(Rejection::File(NetworkError::TooLarge("its constants".into()))),
        }
    }

    /// Returns the floats of a constant.
    fn floats(&mut self, c: &Constant) -> Checked<Vec<f32>> {
        self.count(c.len())?;
        let values = c.floats().ok_or("an input is of integers")?.all();
        if values.iter().any(|v| v.is_nan()) {
            return Err("a constant is not a number".into());
        }
        Ok(values)
    }

    fn shape(&self, view: &View) -> Vec<usize> {
        view.order.iter().map(|d| self.shapes[view.tensor][*d]).collect()
    }

    /// Returns the tensor of a view, stored in the order of its dimensions.
    pub fn plain(&mut self, view: &View) -> Result<usize, NetworkError> {
        if view.order.iter().copied().eq(0..view.order.len()) {
            return Ok(view.tensor);
        }
        let (order, shape) = (view.order.clone(), self.shape(view));
        Ok(self.put(Operator::Transpose(order), vec![view.tensor], shape)?.tensor)
    }

    /// Returns the tensor of a view of the same rank, stored as that of another view is.
    fn stored_like(&mut self, view: &View, like: &View) -> Result<usize, NetworkError> {
        let mut places = vec![0; like.order.len()];
        like.order.iter().enumerate().for_each(|(i, d)| places[*d] = i);
        self.plain(&view.ordered(&places))
    }

    fn each(&mut self, operator: Operator<'a>, x: &View) -> Checked<View> {
        let shape = self.shapes[x.tensor].clone();
        let made = self.put(operator, vec![x.tensor], shape)?;
        Ok(View { order: x.order.clone(), ..made })
    }

    fn placeholder(&mut self, node: &Node) -> Checked<View> {
        let mut shape = node.shape("shape").ok_or("it has no fixed shape")?;
        if let Some(image) = self.image {
            let [_, _, height, width] = &mut shape[..] else {
                return Err("it is not an image".into());
            };
            self.scale = Some([image, [*height, *width]]);
            [*height, *width] = image;
        }
        let view = self.tensor(shape)?;
        if self.input.replace(view.tensor).is_some() {
            return Err("the network has more than one input".into());
        }
        Ok(view)
    }

    /// Returns a height and width of the model for the input as it is.
    fn scaled(&self, size: [usize; 2]) -> Checked<[usize; 2]> {
        let Some([to, from]) = self.scale else { return Ok(size) };
        let mut scaled = [0; 2];
        for (i, scaled) in scaled.iter_mut().enumerate() {
            let product = size[i].checked_mul(to[i]).filter(|n| from[i] > 0 && n % from[i] == 0);
            *scaled = product.ok_or("its input cannot have this size")? / from[i];
        }
        Ok(scaled)
    }

    fn add(&mut self, a: &View, b: &View) -> Checked<View> {
        fits(self.shape(a) == self.shape(b))?;
        let other = self.stored_like(b, a)?;
        let shape = self.shapes[a.tensor].clone();
        let sum = self.put(Operator::Add(Clip::NONE), vec![a.tensor, other], shape)?;
        Ok(View { order: a.order.clone(), ..sum })
    }

    /// Adds one number, or one for each channel.
    fn add_constant(&mut self, x: &View, c: &Constant) -> Checked<View> {
        let (shape, rank) = (self.shape(x), x.order.len());
        fits(c.shape.len() <= rank)?;
        let skipped = rank - c.shape.len();
        let along: Vec<usize> =
            (0..c.shape.len()).filter(|i| c.shape[*i] != 1).map(|i| i + skipped).collect();
        match along[..] {
            [] => {}
            [d] => {
                fits(c.shape[d - skipped] == shape[d])?;
                if x.order[d] + 1 != rank {
                    return Err("only one number or one for each channel can be added".into());
                }
            }
            _ => return Err("only one number or one for each channel can be added".into()),
        }
        let values = self.floats(c)?;
        let constant = self.tensor(vec![values.len()])?.tensor;
        self.constants.insert(constant, values);
        let shape = self.shapes[x.tensor].clone();
        let sum = self.put(Operator::Add(Clip::NONE), vec![x.tensor, constant], shape)?;
        Ok(View { order: x.order.clone(), ..sum })
    }

    fn split(&mut self, inputs: &[&Value]) -> Checked<Vec<Value<'a>>> {
        let x = tensor(inputs, 0)?;
        let parts = sizes(integers(inputs, 1)?, 1)?;
        let along = x.order[dimension(integers(inputs, 2)?, x.order.len())?];
        let whole = self.shapes[x.tensor].clone();
        fits(parts.iter().sum::<usize>() == whole[along])?;
        let mut start = 0;
        let part = |size: usize| {
            let mut shape = whole.clone();
            shape[along] = size;
            let slice = Operator::Slice { along, start };
            start += size;
            let part = self.put(slice, vec![x.tensor], shape)?;
            Ok(Value::Tensor(View { order: x.order.clone(), ..part }))
        };
        parts.into_iter().map(part).collect()
    }

    fn reshape(&mut self, x: &View, wanted: &[i32]) -> Checked<View> {
        let size: usize = self.shapes[x.tensor].iter().product();
        let known: Vec<i32> = wanted.iter().copied().filter(|s| *s != -1).collect();
        let known = sizes(&known, 1)?.into_iter().try_fold(1usize, |n, s| n.checked_mul(s));
        let known = known.ok_or("its shape is too large")?;
        let unknown = wanted.iter().filter(|s| **s == -1).count();
        fits(if unknown == 0 {
            known == size
        } else {
            unknown == 1 && size.is_multiple_of(known)
        })?;
        let shape = wanted.iter().map(|s| usize::try_from(*s).unwrap_or(size / known)).collect();
        let x = self.plain(x)?;
        Ok(self.put(Operator::Reshape, vec![x], shape)?)
    }

    fn concatenate(&mut self, inputs: &[&Value]) -> Checked<View> {
        let first = tensor(inputs, 0)?;
        let count = inputs.len() - 1;
        let axis = dimension(integers(inputs, count)?, first.order.len())?;
        let mut whole = self.shape(first);
        let mut parts = vec![first.tensor];
        for i in 1..count {
            let x = tensor(inputs, i)?;
            let shape = self.shape(x);
            fits(shape.len() == whole.len())?;
            fits(shape.iter().zip(&whole).enumerate().all(|(d, (a, b))| d == axis || a == b))?;
            whole[axis] = whole[axis].checked_add(shape[axis]).ok_or("it is too large")?;
            parts.push(self.stored_like(x, first)?);
        }
        let along = first.order[axis];
        let mut shape = self.shapes[first.tensor].clone();
        shape[along] = whole[axis];
        let made = self.put(Operator::Concatenate(along), parts, shape)?;
        Ok(View { order: first.order.clone(), ..made })
    }

    fn pad(&mut self, inputs: &[&Value]) -> Checked<View> {
        let x = tensor(inputs, 0)?;
        let value = match inputs.get(2) {
            None => 0.0,
            Some(Value::Floats(c)) => match self.floats(c)?[..] {
                [value] => value,
                _ => return Err("it does not have one value".into()),
            },
            _ => return Err("its value is not a constant".into()),
        };
        let widths = sizes(integers(inputs, 1)?, 0)?;
        fits(widths.len() == 2 * x.order.len())?;
        let mut shape = self.shapes[x.tensor].clone();
        let mut before = [0; 4];
        if Size::of(&shape).is_none() || widths[..2] != [0, 0] || x.order[0] != 0 {
            return Err("its input is not a single image".into());
        }
        for (d, pair) in x.order.iter().zip(widths.as_chunks::<2>().0) {
            before[*d] = pair[0];
            let sum = shape[*d].checked_add(pair[0]).and_then(|n| n.checked_add(pair[1]));
            shape[*d] = sum.ok_or("it is too large")?;
        }
        let [_, top, left, near] = before;
        let pad = Operator::Pad { before: [top, left, near], value };
        let made = self.put(pad, vec![x.tensor], shape)?;
        Ok(View { order: x.order.clone(), ..made })
    }

    fn convolution(&mut self, node: &Node, inputs: &[&Value<'a>]) -> Checked<View> {
        let (x, from) = self.image(node, tensor(inputs, 0)?)?;
        let Some(Value::Floats(weights)) = inputs.get(1) else {
            return Err("its weights are not constants".into());
        };
        let [height, width, inner, channels] = weights.shape[..] else {
            return Err("its weights do not have four dimensions".into());
        };
        if node.sizes("dilations").is_some_and(|d| d.iter().any(|d| *d != 1)) {
            return Err("dilation is not supported".into());
        }
        let window = window(node, [height, width])?;
        fits(inner == from.channels && channels > 0)?;
        let to = window.output(from, channels);
        self.count(weights.len())?;
        let (numbers, depth) =
            (weights.floats().ok_or("an input is of integers")?, height * width * inner);
        if !numbers.are_finite() {
            return Err("a weight is not finite".into());
        }
        let (weights, biases) = ((Weights::ByInput(numbers), depth), vec![0.0; channels]);
        let convolution = Convolution::new(window, weights, &biases, Clip::NONE);
        self.put_image(node, Operator::Convolution(convolution), x, to)
    }

    /// Returns an operator's image, with channels last, and its size.
    fn image(&mut self, node: &Node, x: &View) -> Checked<(usize, Size)> {
        fits(x.order.len() == 4)?;
        let x = match channels_first(node)? {
            true => self.plain(&x.ordered(&CHANNELS_LAST))?,
            false => self.plain(x)?,
        };
        let size = Size::of(&self.shapes[x]).ok_or("its input is not a single image")?;
        Ok((x, size))
    }

    /// Adds an operator with an image as output, in the node's order of dimensions.
    fn put_image(
        &mut self,
        node: &Node,
        operator: Operator<'a>,
        x: usize,
        to: Option<Size>,
    ) -> Checked<View> {
        let to = to.ok_or("its window is larger than the image")?;
        let made = self.put(operator, vec![x], vec![1, to.height, to.width, to.channels])?;
        Ok(if channels_first(node)? { made.ordered(&CHANNELS_FIRST) } else { made })
    }
}

/// Returns whether an image's channels come before its rows and columns.
fn channels_first(node: &Node) -> Checked<bool> {
    match &*node.text("data_format") {
        "" | "NHWC" => Ok(false),
        "NCHW" => Ok(true),
        _ => Err("unknown order of dimensions".into()),
    }
}

/// Returns the rows and columns of an attribute with a size for each dimension.
fn image(node: &Node, name: &str) -> Checked<[usize; 2]> {
    let sizes = node.sizes(name).unwrap_or_default();
    let found = match (channels_first(node)?, &sizes[..]) {
        (false, [1, rows, columns, 1]) | (true, [1, 1, rows, columns]) => [*rows, *columns],
        _ => return Err(Rejection::Operator(format!("its `{name}` are not those of an image"))),
    };
    Ok(found)
}

fn window(node: &Node, size: [usize; 2]) -> Checked<Window> {
    let stride = image(node, "strides")?;
    if size.iter().chain(&stride).any(|s| !(1..=LONGEST).contains(s)) {
        return Err("a window or stride has an invalid size".into());
    }
    let same = match &*node.text("padding") {
        "SAME" => true,
        "VALID" => false,
        _ => return Err("unknown padding".into()),
    };
    Ok(Window { size, stride, same, shift: [0, 0] })
}

/// Returns a constant: integers are read, floats only where they are used.
fn constant<'a>(stored: &Constant<'a>) -> Checked<Value<'a>> {
    if stored.len() > MOST_INTEGERS {
        return Ok(Value::Floats(stored.clone()));
    }
    Ok(stored
        .integers()
        .map_or_else(|| Value::Floats(stored.clone()), |all| Value::Integers(all.into())))
}

/// Returns a list that has these values at these indices, and a default elsewhere.
fn dense(inputs: &[&Value]) -> Checked<Arc<[i32]>> {
    let [indices, size, values, default] = [0, 1, 2, 3].map(|i| integers(inputs, i));
    let (indices, values) = (sizes(indices?, 0)?, values?);
    let (size, default) = (sizes(size?, 0)?, default?);
    let ([size @ 0..=MOST_INTEGERS], [default]) = (&size[..], default) else {
        return Err("its result is not a short list".into());
    };
    fits(indices.len() == values.len())?;
    let mut all = vec![*default; *size];
    for (i, value) in indices.into_iter().zip(values) {
        *all.get_mut(i).ok_or("an index is out of range")? = *value;
    }
    Ok(all.into())
}
