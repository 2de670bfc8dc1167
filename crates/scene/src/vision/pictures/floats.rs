//! Pictures of numbers, as depths are stored: grey TIFF and one channel of OpenEXR. Numbers are
//! those of the file; colours, deep data and tiles of several resolutions are not read.

use super::photo::Limits;
use crate::vision::error::VisionError;
use exr::meta::MetaData;
use exr::prelude::{AnyChannel, FlatSamples, ReadChannels, ReadLayers, read};
use std::io::Cursor;
use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult};

/// A number for every pixel, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Numbers {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// The numbers.
    pub values: Vec<f64>,
    /// True if the file holds whole numbers.
    pub whole: bool,
}

/// The depth that renderers write where they saw nothing: Blender's depth pass has 1e10.
const NOTHING: f64 = 1e9;

/// True if bytes begin as those of a TIFF file do.
pub fn is_tiff(bytes: &[u8]) -> bool {
    [b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"].iter().any(|m| bytes.starts_with(*m))
}

/// True if bytes begin as those of an OpenEXR file do.
pub fn is_exr(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x76\x2f\x31\x01")
}

/// Reads the first picture of a TIFF file: grey, of 16 bits or more, whole numbers or floats.
///
/// # Errors
/// Damaged or too large files; colours; 8 bits.
pub fn tiff(bytes: &[u8], limits: &Limits) -> Result<Numbers, VisionError> {
    let damaged = |e: tiff::TiffError| VisionError::Damaged(e.to_string());
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(damaged)?;
    let (width, height) = decoder.dimensions().map_err(damaged)?;
    limits.check(width, height)?;
    let mut bounds = tiff::decoder::Limits::default();
    bounds.decoding_buffer_size = limits.max_bytes() as usize;
    bounds.intermediate_buffer_size = limits.max_bytes() as usize;
    let mut decoder = decoder.with_limits(bounds);
    match decoder.colortype().map_err(damaged)? {
        ColorType::Gray(16 | 32 | 64) => {}
        other => {
            return Err(VisionError::Damaged(format!(
                "the TIFF file holds {other:?}; it must be grey, of 16 bits or more"
            )));
        }
    }
    let picture = decoder.read_image().map_err(damaged)?;
    let whole = !matches!(
        picture,
        DecodingResult::F16(_) | DecodingResult::F32(_) | DecodingResult::F64(_)
    );
    let values = match picture {
        DecodingResult::U8(v) => v.into_iter().map(f64::from).collect(),
        DecodingResult::I8(v) => v.into_iter().map(f64::from).collect(),
        DecodingResult::U16(v) => v.into_iter().map(f64::from).collect(),
        DecodingResult::I16(v) => v.into_iter().map(f64::from).collect(),
        DecodingResult::U32(v) => v.into_iter().map(f64::from).collect(),
        DecodingResult::I32(v) => v.into_iter().map(f64::from).collect(),
        DecodingResult::U64(v) => v.into_iter().map(|x| x as f64).collect(),
        DecodingResult::I64(v) => v.into_iter().map(|x| x as f64).collect(),
        DecodingResult::F16(v) => v.into_iter().map(f64::from).collect(),
        DecodingResult::F32(v) => v.into_iter().map(f64::from).collect(),
        DecodingResult::F64(v) => v,
    };
    Ok(Numbers { width, height, values, whole })
}

/// Reads the depths of an OpenEXR file: the channel `Z` or `depth`, `V` (a single value) or `Y`
/// (grey) of any layer, or the only channel, or R of a picture whose R, G and B are the same.
/// Numbers from 1e9 are infinite. What the data window leaves of the picture is 0.
///
/// # Errors
/// Damaged or too large files; several channels of which none is known to hold depths.
pub fn exr(bytes: &[u8], limits: &Limits) -> Result<Numbers, VisionError> {
    let damaged = |e: exr::error::Error| VisionError::Damaged(e.to_string());
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(damaged)?;
    let mut numbers = 0;
    for header in &meta.headers {
        let sides = [header.layer_size.0, header.layer_size.1];
        let [w, h] = sides.map(|n| u32::try_from(n).unwrap_or(u32::MAX));
        limits.check(w, h)?;
        numbers += u64::from(w) * u64::from(h) * header.channels.list.len() as u64;
    }
    if numbers > limits.max_pixels.saturating_mul(4) {
        return Err(VisionError::Damaged(format!(
            "the OpenEXR file has {numbers} numbers; save the channel of depths alone"
        )));
    }
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(damaged)?;
    let window = image.attributes.display_window;
    let [width, height] =
        [window.size.0, window.size.1].map(|n| u32::try_from(n).unwrap_or(u32::MAX));
    limits.check(width, height)?;
    let all =
        || image.layer_data.iter().flat_map(|l| l.channel_data.list.iter().map(move |c| (l, c)));
    let (layer, channel) =
        chosen(all().map(|(_, c)| c)).and_then(|i| all().nth(i)).ok_or_else(|| {
            let names: Vec<String> = all().map(|(_, c)| c.name.to_string()).take(12).collect();
            VisionError::Damaged(format!(
                "the OpenEXR file has the channels {}; one must be called Z, depth, V or Y",
                names.join(", ")
            ))
        })?;
    if (channel.sampling.0, channel.sampling.1) != (1, 1) {
        return Err(VisionError::Damaged("the channel of depths is subsampled".into()));
    }
    let far = |v: f64| if v >= NOTHING { f64::INFINITY } else { v };
    let at = layer.attributes.layer_position - window.position;
    let mut values = vec![0.0; width as usize * height as usize];
    let row = layer.size.0.max(1);
    for (i, v) in samples(&channel.sample_data).enumerate() {
        let [x, y] = [(i % row) as i64 + at.0 as i64, (i / row) as i64 + at.1 as i64];
        if (0..i64::from(width)).contains(&x)
            && let Some(to) =
                usize::try_from(y * i64::from(width) + x).ok().and_then(|k| values.get_mut(k))
        {
            *to = far(v);
        }
    }
    let whole = matches!(channel.sample_data, FlatSamples::U32(_));
    Ok(Numbers { width, height, values, whole })
}

fn samples(all: &FlatSamples) -> Box<dyn Iterator<Item = f64> + '_> {
    match all {
        FlatSamples::F16(v) => Box::new(v.iter().map(|x| x.to_f64())),
        FlatSamples::F32(v) => Box::new(v.iter().map(|x| f64::from(*x))),
        FlatSamples::U32(v) => Box::new(v.iter().map(|x| f64::from(*x))),
    }
}

/// The index of the channel that holds depths.
fn chosen<'a>(channels: impl Iterator<Item = &'a AnyChannel<FlatSamples>>) -> Option<usize> {
    let channels: Vec<_> = channels.collect();
    let name = |c: &AnyChannel<FlatSamples>| c.name.to_string().to_ascii_lowercase();
    // Of `ViewLayer.Depth.Z`, the last word; of `Depth.V`, both.
    let called = |wanted: &str| {
        channels.iter().position(|c| {
            let name = name(c);
            name == wanted || name.ends_with(&format!(".{wanted}"))
        })
    };
    let known = ["z", "depth", "depth.v", "v", "y"].into_iter().find_map(called);
    let same = || {
        let [r, g, b] = ["r", "g", "b"].map(called);
        let data = |i: Option<usize>| Some(&channels.get(i?)?.sample_data);
        let (one, two, three) = (data(r)?, data(g)?, data(b)?);
        let equal = |other| samples(one).map(f64::to_bits).eq(samples(other).map(f64::to_bits));
        (equal(two) && equal(three)).then_some(r).flatten()
    };
    known.or((channels.len() == 1).then_some(0)).or_else(same)
}
