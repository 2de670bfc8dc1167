//! Networks from ONNX files that map a picture to a map of contours or objects, run by
//! `rten`. A network must take one picture and return a map of one channel with the same
//! aspect ratio. The last bits of a network's output depend on the processor's
//! instructions.

#[cfg(test)]
mod tests;

use crate::options::{NetworkOptions, Output};
use pcadlang_scene::vision::photo::fitted;
use pcadlang_scene::vision::{ContourDetector, Photo, Shows, SoftMap, VisionError};
use rten::{DataType, Dimension, Model, NodeId, Value, ValueType};
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Networks that accept any size get sides that are multiples of this, because most halve
/// their picture up to five times.
const MULTIPLE: u32 = 32;
/// The maximum side of a network's fixed input or of its output, pixels.
const SIDE: usize = 4096;

/// A network that maps a picture to a soft map.
pub struct Network {
    model: Model,
    input: NodeId,
    takes: Takes,
    output: NodeId,
    /// The output's name in messages.
    called: String,
    options: NetworkOptions,
}

/// The input format of a network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Takes {
    /// The channels are the last dimension, not the second.
    channels_last: bool,
    /// 1: grey; 3: colours.
    channels: usize,
    /// Its fixed width and height, if any.
    width: Option<u32>,
    height: Option<u32>,
}

impl fmt::Debug for Network {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Network")
            .field("takes", &self.takes)
            .field("output", &self.called)
            .finish_non_exhaustive()
    }
}

fn wrong(message: impl fmt::Display) -> VisionError {
    VisionError::Detector(message.to_string())
}

/// Runs library code that may panic on unchecked files.
fn guarded<T>(what: &str, work: impl FnOnce() -> Result<T, VisionError>) -> Result<T, VisionError> {
    catch_unwind(AssertUnwindSafe(work))
        .unwrap_or_else(|_| Err(wrong(format!("the network cannot be {what}"))))
}

impl Network {
    /// Reads an ONNX file.
    ///
    /// If the file is damaged, has unknown operators, takes anything but one picture, or
    /// lacks the output that the options name.
    pub fn read(bytes: &[u8], options: &NetworkOptions) -> Result<Network, VisionError> {
        let model = guarded("read", || {
            Model::load(bytes.to_vec()).map_err(|e| wrong(format!("cannot read the network: {e}")))
        })?;
        let &[input] = model.input_ids() else {
            let n = model.input_ids().len();
            return Err(wrong(format!(
                "the network takes {n} inputs; it must take one, a picture"
            )));
        };
        let takes = takes(&model, input)?;
        let (output, called) = output(&model, &options.output)?;
        if let Some(shape) = model.node_info(output).and_then(|n| n.shape()) {
            let sizes: Option<Vec<usize>> = shape
                .iter()
                .map(|d| match d {
                    Dimension::Fixed(n) => Some(*n),
                    Dimension::Symbolic(_) => None,
                })
                .collect();
            // This is the declared shape; the actual output is checked again.
            if let (Some(sizes), Some(width), Some(height)) = (sizes, takes.width, takes.height) {
                side_lengths(&sizes, (width, height))
                    .map_err(|why| wrong(format!("the output `{called}` {why}")))?;
            }
        }
        Ok(Network { model, input, takes, output, called, options: options.clone() })
    }

    fn unfit(&self, why: &str) -> VisionError {
        wrong(format!("the output `{}` {why}", self.called))
    }

    /// Converts the photograph to the network's input format.
    fn picture(&self, photo: &Photo, width: u32, height: u32) -> Result<Value, VisionError> {
        let NetworkOptions { bgr, white, mean, spread, .. } = self.options;
        let mut rgb = photo.srgb(width, height);
        for p in &mut rgb {
            if bgr {
                p.swap(0, 2);
            }
            if self.takes.channels == 1 {
                let [red, blue] = if bgr { [p[2], p[0]] } else { [p[0], p[2]] };
                // Luma of Rec. 601, which most grey pictures use.
                *p = [0.299 * red + 0.587 * p[1] + 0.114 * blue; 3];
            }
            *p = std::array::from_fn(|c| (white * p[c] - mean[c]) / spread[c]);
        }
        let n = self.takes.channels;
        let (w, h) = (width as usize, height as usize);
        let (shape, data) = match self.takes.channels_last {
            true => (
                [1, h, w, n],
                rgb.iter().flat_map(|p| p[..n].iter().copied()).collect::<Vec<f32>>(),
            ),
            false => ([1, n, h, w], (0..n).flat_map(|c| rgb.iter().map(move |p| p[c])).collect()),
        };
        Value::from_shape(shape, data).map_err(wrong)
    }
}

impl ContourDetector for Network {
    /// Computes the map of a photograph, at the network's own size or else at a longer
    /// side of at most about `size` pixels, with sides rounded to multiples of 32.
    ///
    /// # Errors
    /// If the network fails, or returns anything but a map of one channel in the aspect
    /// ratio of its input.
    fn map(&self, photo: &Photo, size: u32) -> Result<SoftMap, VisionError> {
        let own = fitted(photo.width(), photo.height(), size);
        let round = |n: u32| ((n + MULTIPLE / 2) / MULTIPLE * MULTIPLE).max(MULTIPLE);
        let width = self.takes.width.unwrap_or_else(|| round(own.0));
        let height = self.takes.height.unwrap_or_else(|| round(own.1));
        let input = self.picture(photo, width, height)?;
        let given = guarded("run on this picture", || {
            let given = self.model.run(vec![(self.input, input.into())], &[self.output], None);
            given.map_err(|e| wrong(format!("the network failed: {e}")))
        })?;
        let value =
            given.into_iter().next().ok_or_else(|| wrong("the network produced no output"))?;
        let (shape, mut values) =
            numbers(value).ok_or_else(|| self.unfit("is not in single precision"))?;
        let (width, height) =
            side_lengths(&shape, (width, height)).map_err(|why| self.unfit(&why))?;
        if values.iter().any(|v| !v.is_finite()) {
            return Err(self.unfit("has values that are not finite"));
        }
        if self.options.logits {
            values.iter_mut().for_each(|v| *v = 1.0 / (1.0 + libm::expf(-*v)));
        }
        let (least, most) =
            values.iter().fold((0.0f32, 0.0f32), |(a, b), v| (a.min(*v), b.max(*v)));
        if least < -0.01 || most > 1.01 {
            return Err(self.unfit(&format!(
                "has values from {least} to {most}, not from 0 to 1; if they are log odds, set logits = true"
            )));
        }
        Ok(SoftMap { width, height, values, shows: self.options.shows })
    }

    fn sigma(&self) -> f32 {
        match self.options.shows {
            Shows::Contours => 1.0,
            Shows::Objects => 1.6,
        }
    }

    /// HED's best threshold against human outlines is 0.65; a few more edges help where the
    /// object is dim.
    fn strength(&self) -> f32 {
        0.5
    }
}

/// Determines the input format from the network's declaration.
fn takes(model: &Model, input: NodeId) -> Result<Takes, VisionError> {
    let info = model.node_info(input).ok_or_else(|| wrong("the network has no input"))?;
    if info.dtype().is_some_and(|t| t != ValueType::Tensor(DataType::Float)) {
        return Err(wrong("the network's input is not in single precision"));
    }
    let Some(shape) = info.shape() else {
        // Without a declaration: colours, channels first, as in most networks.
        return Ok(Takes { channels_last: false, channels: 3, width: None, height: None });
    };
    let shown = || {
        let sizes: Vec<String> = shape
            .iter()
            .map(|d| match d {
                Dimension::Fixed(n) => n.to_string(),
                Dimension::Symbolic(name) => name.clone(),
            })
            .collect();
        format!("[{}]", sizes.join(", "))
    };
    let [batch, second, third, last] = &shape[..] else {
        return Err(wrong(format!(
            "the network takes {}; the input must have 4 dimensions",
            shown()
        )));
    };
    if matches!(batch, Dimension::Fixed(n) if *n != 1) {
        return Err(wrong(format!(
            "the network takes {}; it must take one picture at a time",
            shown()
        )));
    }
    let count = |d: &Dimension| match d {
        Dimension::Fixed(n @ (1 | 3)) => Some(*n),
        _ => None,
    };
    let (channels_last, channels, height, width) = match (count(second), count(last)) {
        (Some(n), _) => (false, n, third, last),
        (None, Some(n)) => (true, n, second, third),
        (None, None) if matches!(second, Dimension::Symbolic(_)) => (false, 3, third, last),
        _ => {
            return Err(wrong(format!(
                "the network takes {}; it must take 1 or 3 channels",
                shown()
            )));
        }
    };
    let side = |d: &Dimension| match d {
        Dimension::Fixed(n) if (1..=SIDE).contains(n) => Ok(Some(*n as u32)),
        Dimension::Fixed(_) => {
            Err(wrong(format!("the network takes {}; sides may be 1 to {SIDE}", shown())))
        }
        Dimension::Symbolic(_) => Ok(None),
    };
    Ok(Takes { channels_last, channels, width: side(width)?, height: side(height)? })
}

/// Returns the output that is the map, and its name.
fn output(model: &Model, which: &Output) -> Result<(NodeId, String), VisionError> {
    let all: Vec<(NodeId, String)> = model
        .output_ids()
        .iter()
        .enumerate()
        .map(|(i, id)| {
            let name = model.node_info(*id).and_then(|n| n.name().map(str::to_owned));
            (*id, name.unwrap_or_else(|| (i + 1).to_string()))
        })
        .collect();
    let names = || all.iter().map(|(_, n)| n.as_str()).collect::<Vec<_>>().join(", ");
    let found = match which {
        Output::Last => all.last(),
        Output::Number(n) => n.checked_sub(1).and_then(|i| all.get(i)),
        Output::Named(name) => all.iter().find(|(_, n)| n == name),
    };
    found.cloned().ok_or_else(|| match which {
        Output::Last => wrong("the network has no output"),
        Output::Number(n) => {
            wrong(format!("the network has no output {n}; it has {}: {}", all.len(), names()))
        }
        Output::Named(name) => {
            wrong(format!("the network has no output `{name}`; it has {}", names()))
        }
    })
}

/// Returns the shape and the numbers of an output.
fn numbers(value: Value) -> Option<(Vec<usize>, Vec<f32>)> {
    fn of<const N: usize>((shape, data): ([usize; N], Vec<f32>)) -> (Vec<usize>, Vec<f32>) {
        (shape.to_vec(), data)
    }
    let four = value.clone().into_shape_vec::<f32, 4>().map(of);
    let three = || value.clone().into_shape_vec::<f32, 3>().map(of);
    let two = || value.clone().into_shape_vec::<f32, 2>().map(of);
    let other = || value.clone().into_shape_vec::<f32, 1>().map(of);
    four.or_else(|_| three()).or_else(|_| two()).or_else(|_| other()).ok()
}

/// Returns width and height of a map of one channel in the aspect ratio of a picture, or
/// an error message.
fn side_lengths(shape: &[usize], (width, height): (u32, u32)) -> Result<(u32, u32), String> {
    let (h, w) = match *shape {
        [h, w] | [1, h, w] | [1, 1, h, w] | [1, h, w, 1] => (h, w),
        _ => {
            return Err(format!(
                "is {shape:?}, not a map of one channel such as [1, 1, {height}, {width}]"
            ));
        }
    };
    let (a, b) = (w as u64 * u64::from(height), h as u64 * u64::from(width));
    // Rounding may cause a difference of a pixel.
    if w == 0 || h == 0 || w > SIDE || h > SIDE || a.abs_diff(b) > u64::from(width.max(height)) {
        return Err(format!(
            "is {w} x {h} pixels, which does not match the aspect ratio of the picture, {width} x {height}"
        ));
    }
    Ok((w as u32, h as u32))
}
