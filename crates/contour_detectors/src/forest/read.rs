//! Parses a forest from the bytes of a file. All numbers are checked here, so that
//! evaluating a forest terminates and stays within its arrays, whatever the file
//! contains.

use super::yaml::{Token, Tokens};
use super::{Forest, ForestOptions, Node};
use flate2::bufread::MultiGzDecoder;
use std::io::{BufRead, BufReader};

/// The maximum number of bytes of text: the forest of the paper has about 200 million.
const TEXT: u64 = 1 << 30;
/// The maximum number of nodes of all trees together.
const NODES: usize = 1 << 23;
/// The maximum number of edge pixels of all leaves together.
const PIXELS: usize = 1 << 27;
/// The maximum side of a patch.
const PATCH: usize = 128;

/// True if bytes begin like a gzip file.
pub fn is_gzip(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0x1f, 0x8b])
}

/// Reads the forest of a file.
pub fn forest(bytes: &[u8]) -> Result<Forest, String> {
    match is_gzip(bytes) {
        true => parse(BufReader::with_capacity(1 << 16, MultiGzDecoder::new(bytes))),
        false => parse(bytes),
    }
}

/// The contents of a file, before checks.
#[derive(Default)]
struct Raw {
    options: Vec<(String, usize)>,
    children: Vec<u32>,
    features: Vec<u32>,
    thresholds: Vec<f32>,
    boundaries: Vec<u32>,
    pixels: Vec<u16>,
}

/// The list that the numbers after a name belong to.
#[derive(Clone, Copy, PartialEq)]
enum Part {
    Options,
    Children,
    Features,
    Thresholds,
    Boundaries,
    Pixels,
    /// An unknown name, which is ignored.
    Other,
}

fn part(name: &str) -> Part {
    match name {
        "options" => Part::Options,
        "childs" => Part::Children,
        "featureIds" => Part::Features,
        "thresholds" => Part::Thresholds,
        "edgeBoundaries" => Part::Boundaries,
        "edgeBins" => Part::Pixels,
        _ => Part::Other,
    }
}

fn parse(text: impl BufRead) -> Result<Forest, String> {
    let mut tokens = Tokens::new(text, TEXT);
    let mut raw = Raw::default();
    let (mut at, mut option) = (None, None);
    let mut seen: Vec<Part> = Vec::new();
    while let Some(token) = tokens.next()? {
        match token {
            Token::Name(name, false) => {
                let p = part(&name);
                if seen.contains(&p) {
                    return Err(tokens.wrong(format!("`{name}` occurs twice")));
                }
                if p != Part::Other {
                    seen.push(p);
                }
                (at, option) = (Some(p), None);
            }
            Token::Name(name, true) => match at {
                Some(Part::Options) if option.is_none() => option = Some(name),
                Some(Part::Other) => {}
                _ => return Err(tokens.wrong(format!("unexpected `{name}`"))),
            },
            Token::Number(x) => {
                let whole = |most: u32| match x >= 0.0 && x <= f64::from(most) && x.fract() == 0.0 {
                    true => Ok(x as u32),
                    false => {
                        Err(tokens.wrong(format!("{x} is not a whole number from 0 to {most}")))
                    }
                };
                let room = |n: usize, most: usize| match n < most {
                    true => Ok(()),
                    false => Err(tokens.wrong(format!(
                        "the forest is too large; at most {most} numbers of one kind are supported"
                    ))),
                };
                match at {
                    Some(Part::Options) => {
                        let name =
                            option.take().ok_or_else(|| tokens.wrong("an option has no name"))?;
                        room(raw.options.len(), 64)?;
                        raw.options.push((name, whole(1 << 20)? as usize));
                    }
                    Some(Part::Children) => {
                        room(raw.children.len(), NODES)?;
                        raw.children.push(whole(NODES as u32)?);
                    }
                    Some(Part::Features) => {
                        room(raw.features.len(), NODES)?;
                        raw.features.push(whole(u32::MAX)?);
                    }
                    Some(Part::Thresholds) => {
                        room(raw.thresholds.len(), NODES)?;
                        raw.thresholds.push(x as f32);
                    }
                    Some(Part::Boundaries) => {
                        room(raw.boundaries.len(), NODES + 1)?;
                        raw.boundaries.push(whole(PIXELS as u32)?);
                    }
                    Some(Part::Pixels) => {
                        room(raw.pixels.len(), PIXELS)?;
                        raw.pixels.push(whole(u32::from(u16::MAX))? as u16);
                    }
                    Some(Part::Other) => {}
                    None => {
                        return Err(tokens.wrong(
                            "a number without a name; is this the model of a structured forest?",
                        ));
                    }
                }
            }
        }
    }
    checked(raw)
}

/// Returns the options of a forest after checking that each is in its range.
fn options(given: &[(String, usize)]) -> Result<ForestOptions, String> {
    let get = |name: &str, least: usize, most: usize| {
        let mut found = given.iter().filter(|(n, _)| n == name).map(|(_, v)| *v);
        let value = found.next().ok_or_else(|| format!("the option `{name}` is missing"))?;
        if found.next().is_some() {
            return Err(format!("the option `{name}` occurs twice"));
        }
        match (least..=most).contains(&value) {
            true => Ok(value),
            false => {
                Err(format!("the option `{name}` must be from {least} to {most}, not {value}"))
            }
        }
    };
    let options = ForestOptions {
        stride: get("stride", 1, PATCH)?,
        shrink: get("shrinkNumber", 2, 16)?,
        patch: get("patchSize", 2, PATCH)?,
        inner: get("patchInnerSize", 1, PATCH)?,
        orientations: get("numberOfGradientOrientations", 1, 32)?,
        gradient_smoothing: get("gradientSmoothingRadius", 0, 64)?,
        smoothing: get("regFeatureSmoothingRadius", 0, 64)?,
        similarity_smoothing: get("ssFeatureSmoothingRadius", 0, 64)?,
        normalization: get("gradientNormalizationRadius", 0, 64)?,
        grid: get("selfsimilarityGridSize", 1, 16)?,
        trees: get("numberOfTrees", 1, 1024)?,
        evaluated: get("numberOfTreesToEvaluate", 1, 1024)?,
    };
    let o = &options;
    for (wrong, why) in [
        (!o.shrink.is_multiple_of(2), "`shrinkNumber` must be even"),
        (!o.patch.is_multiple_of(o.shrink), "`patchSize` must be a multiple of `shrinkNumber`"),
        (!o.stride.is_multiple_of(o.shrink), "`stride` must be a multiple of `shrinkNumber`"),
        (
            o.inner > o.patch || !(o.patch - o.inner).is_multiple_of(2),
            "`patchSize` minus `patchInnerSize` must be even",
        ),
        (o.evaluated > o.trees, "`numberOfTreesToEvaluate` must be at most `numberOfTrees`"),
        (
            o.cells() < 2 * o.grid,
            "`selfsimilarityGridSize` must be at most half of `patchSize` by `shrinkNumber`",
        ),
    ] {
        if wrong {
            return Err(why.into());
        }
    }
    Ok(options)
}

/// Builds the forest after checking that its parts are consistent.
fn checked(raw: Raw) -> Result<Forest, String> {
    if raw.options.is_empty() {
        return Err("there are no `options`; is this the model of a structured forest?".into());
    }
    let options = options(&raw.options)?;
    let count = raw.children.len();
    for (name, n) in [("featureIds", raw.features.len()), ("thresholds", raw.thresholds.len())] {
        if n != count {
            return Err(format!("there are {count} numbers of `childs`, but {n} of `{name}`"));
        }
    }
    if count == 0 || !count.is_multiple_of(options.trees) {
        return Err(format!(
            "{count} nodes cannot be those of {} trees of one size",
            options.trees
        ));
    }
    let each = count / options.trees;
    let known = options.plain() + options.pairs();
    let mut nodes = Vec::with_capacity(count);
    for (i, &child) in raw.children.iter().enumerate() {
        let (at, right) = (i % each, child as usize);
        if child != 0 {
            // Both children have larger indices than their parent, so every path ends.
            if right <= at + 1 || right >= each {
                return Err(format!(
                    "node {at} of tree {} has the child {child} of {each} nodes",
                    i / each
                ));
            }
            if raw.features[i] as usize >= known {
                return Err(format!(
                    "node {at} of tree {} asks for feature {} of {known}",
                    i / each,
                    raw.features[i]
                ));
            }
        }
        nodes.push(Node {
            feature: raw.features[i],
            threshold: raw.thresholds[i],
            left: child.saturating_sub(1),
        });
    }
    let mut begins = raw.boundaries;
    if begins.len() == count {
        begins.push(raw.pixels.len() as u32);
    }
    if begins.len() != count + 1 {
        return Err(format!(
            "{count} nodes need {} numbers of `edgeBoundaries`, not {}",
            count + 1,
            begins.len()
        ));
    }
    if begins.windows(2).any(|w| w[0] > w[1])
        || begins.last().is_some_and(|e| *e as usize > raw.pixels.len())
    {
        return Err(format!(
            "`edgeBoundaries` must be ascending, up to at most {}, the length of `edgeBins`",
            raw.pixels.len()
        ));
    }
    // Edges may be listed by direction, one direction after the other; only their
    // positions are used.
    let area = options.inner * options.inner;
    let most = area * options.channels();
    let mut pixels = raw.pixels;
    for p in &mut pixels {
        if usize::from(*p) >= most {
            return Err(format!("`edgeBins` has {p}, but a patch's middle has {area} pixels"));
        }
        *p = (usize::from(*p) % area) as u16;
    }
    Ok(Forest { options, nodes, begins, pixels })
}
