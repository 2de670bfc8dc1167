//! Decompresses views (`EXT_meshopt_compression`, `KHR_meshopt_compression`; the codecs are
//! those of appendix A of these extensions).
//!
//! The filters of normals and colours are left out, because neither is read.

use super::json::Meshopt;

const SHORT: &str = "it is truncated";
const WRONG: &str = "it is not of the stated mode";

/// The bytes that are still to be read.
struct Source<'a>(&'a [u8]);

impl<'a> Source<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], String> {
        let (head, rest) = self.0.split_at_checked(count).ok_or(SHORT)?;
        self.0 = rest;
        Ok(head)
    }

    fn byte(&mut self) -> Result<u8, String> {
        Ok(self.take(1)?[0])
    }

    /// An unsigned number in groups of 7 bits, the lowest first (LEB128).
    fn number(&mut self) -> Result<u32, String> {
        let mut all = 0;
        for shift in (0..35).step_by(7) {
            let byte = self.byte()?;
            all |= u32::from(byte & 127) << shift;
            if byte < 128 {
                return Ok(all);
            }
        }
        Err(WRONG.into())
    }

    fn end(&self) -> Result<(), String> {
        if self.0.is_empty() { Ok(()) } else { Err(WRONG.into()) }
    }
}

/// Returns the bytes of a compressed view, at most `most`.
///
/// # Errors
/// What is wrong with the view, as the end of a sentence.
pub(super) fn decompress(m: &Meshopt, bytes: &[u8], most: usize) -> Result<Vec<u8>, String> {
    if m.count.checked_mul(m.byte_stride).is_none_or(|all| all > most) {
        return Err(format!("it has {} elements of {} bytes", m.count, m.byte_stride));
    }
    let short = matches!(m.byte_stride, 2 | 4);
    match &*m.mode {
        "ATTRIBUTES" if m.byte_stride.is_multiple_of(4) && (4..=256).contains(&m.byte_stride) => {
            let mut out = attributes(bytes, m.count, m.byte_stride)?;
            match m.filter.as_deref() {
                Some("QUATERNION") if m.byte_stride == 8 => {
                    out.as_chunks_mut().0.iter_mut().for_each(quaternion);
                }
                Some("EXPONENTIAL") => out.as_chunks_mut().0.iter_mut().for_each(exponential),
                _ => {}
            }
            Ok(out)
        }
        "TRIANGLES" if short && m.count.is_multiple_of(3) => {
            triangles(bytes, m.count / 3).map(|all| written(&all, m.byte_stride))
        }
        "INDICES" if short => sequence(bytes, m.count).map(|all| written(&all, m.byte_stride)),
        mode => Err(format!("the mode {mode} with {} bytes is unknown", m.byte_stride)),
    }
}

fn written(indices: &[u32], stride: usize) -> Vec<u8> {
    indices.iter().flat_map(|i| i.to_le_bytes().into_iter().take(stride)).collect()
}

/// Mode 0: elements of `stride` bytes, in blocks; each byte is stored apart from the others, as
/// its difference from that of the element before.
fn attributes(bytes: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, String> {
    let (newer, padded) = match bytes.first() {
        Some(0xa0) => (false, stride.max(32)),
        Some(0xa1) => (true, (stride + stride / 4).max(24)),
        _ => return Err(WRONG.into()),
    };
    let channels = stride / 4;
    let tail = bytes.len().checked_sub(padded).filter(|at| *at >= 1).ok_or(SHORT)?;
    let (body, mut tail) = (&bytes[1..tail], &bytes[tail..]);
    let modes = if newer {
        let (rest, modes) = tail.split_at(tail.len() - channels);
        tail = rest;
        modes
    } else {
        &[]
    };
    let mut last = tail[tail.len() - stride..].to_vec();
    let mut source = Source(body);
    let mut out = Vec::new();
    while out.len() < count * stride {
        let elements = (count - out.len() / stride).min((8192 / stride) & !15).min(256);
        let control = if newer { source.take(channels)? } else { &[] };
        let start = out.len();
        let mut deltas = [[0; 256]; 4];
        for (channel, last) in last.as_chunks_mut::<4>().0.iter_mut().enumerate() {
            for (k, deltas) in deltas.iter_mut().enumerate() {
                let how = control.get(channel).map(|c| c >> (2 * k) & 3);
                byte_deltas(&mut source, how, elements, deltas)?;
            }
            if channel == 0 {
                out.resize(start + elements * stride, 0);
            }
            let mode = modes.get(channel).copied().unwrap_or_default();
            for (i, element) in out[start..].chunks_exact_mut(stride).enumerate() {
                *last = next(*last, deltas.map(|d| d[i]), mode)?;
                element[4 * channel..4 * channel + 4].copy_from_slice(last);
            }
        }
    }
    source.end()?;
    Ok(out)
}

/// Reads the differences of one byte of a block's elements. `how` is the control mode of version 1.
fn byte_deltas(
    source: &mut Source,
    how: Option<u8>,
    elements: usize,
    out: &mut [u8; 256],
) -> Result<(), String> {
    let lengths = match how {
        None => [0, 2, 4, 8],
        Some(0) => [0, 1, 2, 4],
        Some(1) => [1, 2, 4, 8],
        Some(2) => {
            out.fill(0);
            return Ok(());
        }
        Some(_) => {
            out[..elements].copy_from_slice(source.take(elements)?);
            return Ok(());
        }
    };
    let groups = elements.div_ceil(16);
    let header = source.take(groups.div_ceil(4))?;
    for (g, out) in out.as_chunks_mut::<16>().0.iter_mut().take(groups).enumerate() {
        let bits = lengths[usize::from(header[g / 4] >> (g % 4 * 2) & 3)];
        match bits {
            0 => out.fill(0),
            8 => out.copy_from_slice(source.take(16)?),
            _ => {
                let packed = source.take(2 * bits)?;
                let per_byte = 8 / bits;
                for (i, out) in out.iter_mut().enumerate() {
                    let place = i % per_byte;
                    // Single bits have the first at the low end, pairs and fours at the high end.
                    let shift = if bits == 1 { place } else { bits * (per_byte - 1 - place) };
                    let all_ones = (1u8 << bits) - 1;
                    let code = packed[i / per_byte] >> shift & all_ones;
                    *out = if code == all_ones { source.byte()? } else { code };
                }
            }
        }
    }
    Ok(())
}

/// Returns four bytes from those of the element before and their difference.
fn next(before: [u8; 4], delta: [u8; 4], mode: u8) -> Result<[u8; 4], String> {
    let halves = |x: [u8; 4]| [u16::from_le_bytes([x[0], x[1]]), u16::from_le_bytes([x[2], x[3]])];
    Ok(match (mode & 15, mode >> 4) {
        (0, 0) => std::array::from_fn(|k| {
            before[k].wrapping_add(delta[k] >> 1 ^ (delta[k] & 1).wrapping_neg())
        }),
        (1, 0) => {
            let (before, delta) = (halves(before), halves(delta));
            let [a, b] = std::array::from_fn(|k| {
                before[k].wrapping_add(delta[k] >> 1 ^ (delta[k] & 1).wrapping_neg()).to_le_bytes()
            });
            [a[0], a[1], b[0], b[1]]
        }
        (2, turn) => {
            let delta = u32::from_le_bytes(delta).rotate_right(u32::from(turn));
            (u32::from_le_bytes(before) ^ delta).to_le_bytes()
        }
        _ => return Err(WRONG.into()),
    })
}

/// The difference that a number stands for: 0, -1, 1, -2, ….
fn signed(x: u32) -> u32 {
    x >> 1 ^ (x & 1).wrapping_neg()
}

/// The last 16 items, of which the most recent is number 0.
struct Recent<T>([T; 16], usize);

impl<T: Copy> Recent<T> {
    fn push(&mut self, item: T) {
        self.0[self.1 % 16] = item;
        self.1 = (self.1 + 1) % 16;
    }

    fn get(&self, number: u8) -> T {
        self.0[(self.1 + 15 - usize::from(number)) % 16]
    }
}

/// Mode 1: the corners of triangles.
fn triangles(bytes: &[u8], count: usize) -> Result<Vec<u32>, String> {
    // Version 0 has no vertices beside the last one.
    let recent_vertices = match bytes.first() {
        Some(0xe0) => 15,
        Some(0xe1) => 13,
        _ => return Err(WRONG.into()),
    };
    let mut source = Source(&bytes[1..]);
    let codes = source.take(count)?;
    let body = source.0.len().checked_sub(16).ok_or(SHORT)?;
    let (body, table) = source.0.split_at(body);
    source.0 = body;
    let mut edges = Recent([(u32::MAX, u32::MAX); 16], 0);
    let mut vertices = Recent([u32::MAX; 16], 0);
    let (mut fresh, mut last) = (0u32, 0u32);
    let mut out = Vec::with_capacity(3 * count);
    for code in codes {
        let (high, low) = (code >> 4, code & 15);
        if high < 15 {
            let (a, b) = edges.get(high);
            let c = if low == 0 {
                take(&mut fresh)
            } else if low < recent_vertices {
                vertices.get(low)
            } else {
                last = match low {
                    13 => last.wrapping_sub(1),
                    14 => last.wrapping_add(1),
                    _ => last.wrapping_add(signed(source.number()?)),
                };
                last
            };
            if low == 0 || low >= recent_vertices {
                vertices.push(c);
            }
            edges.push((c, b));
            edges.push((a, c));
            out.extend([a, b, c]);
            continue;
        }
        let stated = low >= 14;
        let pair = if stated { source.byte()? } else { table[usize::from(low)] };
        if stated && pair == 0 {
            fresh = 0;
        }
        let mut corner = |how: u8| -> Result<u32, String> {
            match how {
                0 => Ok(take(&mut fresh)),
                15 if stated => {
                    last = last.wrapping_add(signed(source.number()?));
                    Ok(last)
                }
                _ => Ok(vertices.get(how - 1)),
            }
        };
        let a = corner(if low == 15 { 15 } else { 0 })?;
        let (b, c) = (corner(pair >> 4)?, corner(pair & 15)?);
        vertices.push(a);
        for (how, v) in [(pair >> 4, b), (pair & 15, c)] {
            if how == 0 || how == 15 {
                vertices.push(v);
            }
        }
        edges.push((b, a));
        edges.push((c, b));
        edges.push((a, c));
        out.extend([a, b, c]);
    }
    source.end()?;
    Ok(out)
}

/// Returns the next vertex that no triangle has used yet.
fn take(fresh: &mut u32) -> u32 {
    let own = *fresh;
    *fresh = own.wrapping_add(1);
    own
}

/// Mode 2: indices, each as its difference from one of two others.
fn sequence(bytes: &[u8], count: usize) -> Result<Vec<u32>, String> {
    if !matches!(bytes.first(), Some(0xd0 | 0xd1)) {
        return Err(WRONG.into());
    }
    let end = bytes.len().checked_sub(4).filter(|end| *end >= 1).ok_or(SHORT)?;
    let mut source = Source(&bytes[1..end]);
    if count > source.0.len() {
        return Err(SHORT.into());
    }
    let mut last = [0u32; 2];
    let mut out = Vec::with_capacity(count);
    for _ in 0..count {
        let code = source.number()?;
        let last = &mut last[code as usize & 1];
        *last = last.wrapping_add(signed(code >> 1));
        out.push(*last);
    }
    source.end()?;
    Ok(out)
}

/// The filter of rotations: three components, and which one is left out.
fn quaternion(x: &mut [u8; 8]) {
    let at = |k: usize| i16::from_le_bytes([x[2 * k], x[2 * k + 1]]);
    let (one, most) = (f32::from(at(3) | 3), at(3) as usize & 3);
    let [a, b, c] = [0, 1, 2].map(|k| f32::from(at(k)) / one * std::f32::consts::FRAC_1_SQRT_2);
    let d = (1.0 - a * a - b * b - c * c).max(0.0).sqrt();
    for (k, v) in [d, a, b, c].into_iter().enumerate() {
        let place = 2 * ((most + k) % 4);
        x[place..place + 2].copy_from_slice(&((v * 32767.0).round() as i16).to_le_bytes());
    }
}

/// The filter of floats: a mantissa of 24 bits and an exponent of 8.
fn exponential(x: &mut [u8; 4]) {
    let all = i32::from_le_bytes(*x);
    let exponent = (all >> 24).clamp(-126, 127);
    let value = 2f32.powi(exponent) * (all << 8 >> 8) as f32;
    *x = value.to_le_bytes();
}
