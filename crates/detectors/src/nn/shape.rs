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

    /// Returns the number of pixels.
    pub fn pixels(self) -> usize {
        self.height * self.width
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
    /// Rows and columns of padding above and to the left, besides.
    pub shift: [usize; 2],
}

impl Window {
    /// True if it has one pixel, and takes each pixel of an image.
    pub fn is_pixel(&self) -> bool {
        (self.size, self.stride, self.shift) == ([1, 1], [1, 1], [0, 0])
    }

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
        let own = match self.same {
            true => [pad(from.height, to.height, 0), pad(from.width, to.width, 1)],
            false => [0, 0],
        };
        [own[0] + self.shift[0], own[1] + self.shift[1]]
    }

    /// Fills `patch` with the numbers under a window, by its rows, columns and channels, from the
    /// number `start` on; those outside the image are 0.
    pub fn copy(
        &self,
        input: &[f32],
        from: Size,
        before: [usize; 2],
        (row, column): (usize, usize),
        start: usize,
        patch: &mut [f32],
    ) {
        // A row of the window is one piece of the image's.
        let line = self.size[1] * from.channels;
        let left = (column * self.stride[1]) as isize - before[1] as isize;
        let inside = |at: isize| at.clamp(0, from.width as isize) as usize * from.channels;
        let (first, last) = (inside(left), inside(left + self.size[1] as isize));
        // Where that piece begins in the window's row.
        let lead = (-left).max(0) as usize * from.channels;
        let (mut at, end) = (start, start + patch.len());
        while at < end {
            let (ky, within) = (at / line, at % line);
            let next = end.min((ky + 1) * line);
            let to = &mut patch[at - start..next - start];
            let y = (row * self.stride[0] + ky).checked_sub(before[0]);
            match y.filter(|y| *y < from.height) {
                Some(y) if last > first => {
                    let image = &input[y * from.width * from.channels..];
                    // The part from `a` to `b` of the window's row lies inside the image.
                    let (a, b) = (lead.max(within), (lead + last - first).min(within + to.len()));
                    if a >= b {
                        to.fill(0.0);
                    } else {
                        to[..a - within].fill(0.0);
                        to[a - within..b - within]
                            .copy_from_slice(&image[first + a - lead..first + b - lead]);
                        to[b - within..].fill(0.0);
                    }
                }
                _ => to.fill(0.0),
            }
            at = next;
        }
    }

    /// Returns the rows of the window that lie inside the image, with their positions there, for a
    /// row of the output.
    pub fn rows(
        &self,
        from: Size,
        above: usize,
        row: usize,
    ) -> impl Iterator<Item = (usize, usize)> + Clone + use<> {
        let top = row * self.stride[0];
        let first = above.saturating_sub(top);
        let end = (from.height + above).saturating_sub(top).min(self.size[0]);
        (first..end).map(move |ky| (ky, top + ky - above))
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
