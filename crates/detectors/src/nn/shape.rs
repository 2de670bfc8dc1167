//! Geometry of operators on images: sizes, windows and strides.

/// The height, width and number of channels of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Size {
    pub height: usize,
    pub width: usize,
    pub channels: usize,
}

impl Size {
    /// Returns the size of a tensor that holds one image: 1 x height x width x channels.
    pub fn of(shape: &[usize]) -> Option<Size> {
        match *shape {
            [1, height, width, channels] if height > 0 && width > 0 && channels > 0 => {
                Some(Size { height, width, channels })
            }
            _ => None,
        }
    }

    #[cfg(test)]
    pub fn len(self) -> usize {
        self.height * self.width * self.channels
    }

    /// Returns the channels of a pixel.
    pub fn pixel(self, values: &[f32], row: usize, column: usize) -> &[f32] {
        &values[(row * self.width + column) * self.channels..][..self.channels]
    }

    pub fn pixel_mut(self, values: &mut [f32], row: usize, column: usize) -> &mut [f32] {
        &mut values[(row * self.width + column) * self.channels..][..self.channels]
    }
}

/// The window of a convolution or pooling, and how it moves over an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Window {
    /// Rows and columns of the window, and of the stride.
    pub size: [usize; 2],
    pub stride: [usize; 2],
    /// True if the image is padded so that there is a window for each stride (`SAME`), false if
    /// it is not padded (`VALID`).
    pub same: bool,
}

impl Window {
    /// Returns the number of windows along rows or columns; `None` if none fits.
    fn count(&self, along: usize, n: usize) -> Option<usize> {
        let (k, s) = (self.size[along], self.stride[along]);
        if self.same { Some(n.div_ceil(s)) } else { Some(n.checked_sub(k)? / s + 1) }
    }

    /// Returns the size of the output, with one value for each window and channel.
    pub fn output(&self, from: Size, channels: usize) -> Option<Size> {
        Some(Size {
            height: self.count(0, from.height)?,
            width: self.count(1, from.width)?,
            channels,
        })
    }

    /// Returns the number of rows and columns of padding above and to the left of the
    /// image.
    pub fn before(&self, from: Size, to: Size) -> [usize; 2] {
        let pad = |n: usize, m: usize, i: usize| {
            ((m - 1) * self.stride[i] + self.size[i]).saturating_sub(n) / 2
        };
        if self.same {
            [pad(from.height, to.height, 0), pad(from.width, to.width, 1)]
        } else {
            [0, 0]
        }
    }

    /// Calls `f` with each row and column of the window that lies inside the image, and
    /// its position there.
    pub fn each(
        &self,
        from: Size,
        before: [usize; 2],
        (row, column): (usize, usize),
        mut f: impl FnMut(usize, usize, usize, usize),
    ) {
        for ky in 0..self.size[0] {
            let Some(y) =
                (row * self.stride[0] + ky).checked_sub(before[0]).filter(|y| *y < from.height)
            else {
                continue;
            };
            for kx in 0..self.size[1] {
                if let Some(x) = (column * self.stride[1] + kx)
                    .checked_sub(before[1])
                    .filter(|x| *x < from.width)
                {
                    f(ky, kx, y, x);
                }
            }
        }
    }
}

/// The bounds to which an operator's results are clipped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Clip {
    pub lo: f32,
    pub hi: f32,
}

impl Clip {
    pub const NONE: Clip = Clip { lo: f32::NEG_INFINITY, hi: f32::INFINITY };

    pub fn apply(self, values: &mut [f32]) {
        if self != Clip::NONE {
            values.iter_mut().for_each(|v| *v = v.max(self.lo).min(self.hi));
        }
    }
}
