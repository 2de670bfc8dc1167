//! What the command line points out in a photograph.

// Comments of arguments are the help that the command prints, not Markdown.
#![allow(rustdoc::broken_intra_doc_links, rustdoc::invalid_html_tags, rustdoc::bare_urls)]

use crate::failure::{Failure, plain};
use crate::files;
use clap::Args;
use pcadlang_scene::vision::{AxisHint, Hint, Limits, mask};
use std::path::PathBuf;

/// Where the object is in the photograph.
#[derive(Args, Clone, Debug, Default, PartialEq)]
pub struct HintArgs {
    /// The object's pixels in the photograph: a PNG or JPEG with bright pixels on it, or a
    /// .npy array, of the photograph's proportions
    #[arg(long, value_name = "FILE")]
    pub mask: Option<PathBuf>,
    /// Positions around the object, at least three, in pixels of the photograph: up to five are
    /// the corners of a polygon, six or more are joined by a smooth curve
    #[arg(long, value_name = "X,Y", num_args = 1.., value_parser = corners)]
    pub outline: Vec<Corners>,
    /// A box around the object, in pixels of the photograph
    #[arg(long = "box", value_name = "X,Y,W,H", allow_hyphen_values = true, value_parser = rectangle)]
    pub bounds: Option<[f64; 4]>,
    /// The object's axis: the end on which it stands, the other end, and its width across
    #[arg(
        long, num_args = 3, value_names = ["X,Y", "X,Y", "W"], allow_hyphen_values = true,
        value_parser = numbers
    )]
    pub axis: Vec<Numbers>,
    /// A position on the object; may be repeated
    #[arg(long, value_name = "X,Y", allow_hyphen_values = true, value_parser = position)]
    pub at: Vec<[f64; 2]>,
    /// A position beside the object; may be repeated
    #[arg(long, value_name = "X,Y", allow_hyphen_values = true, value_parser = position)]
    pub not: Vec<[f64; 2]>,
}

/// Some corners of an outline.
pub type Corners = Vec<[f64; 2]>;

/// An end of an axis, or its width.
pub type Numbers = Vec<f64>;

impl HintArgs {
    /// Returns the first option that was given.
    pub fn option(&self) -> Option<&'static str> {
        let given = [
            (self.mask.is_some(), "--mask"),
            (!self.outline.is_empty(), "--outline"),
            (self.bounds.is_some(), "--box"),
            (!self.axis.is_empty(), "--axis"),
            (!self.at.is_empty(), "--at"),
            (!self.not.is_empty(), "--not"),
        ];
        given.into_iter().find(|(given, _)| *given).map(|(_, name)| name)
    }

    /// Reads the hint; that it suits the photograph is not checked here.
    ///
    /// # Errors
    /// If the mask cannot be read, or the axis is not two ends and a width.
    pub fn read(&self) -> Result<Hint, Failure> {
        let mask = self.mask.as_ref().map(|path| {
            mask::decode(&files::read(path)?, None, &Limits::default())
                .map_err(|e| plain(format!("{}: {e}", path.display())))
        });
        Ok(Hint {
            mask: mask.transpose()?,
            outline: self.outline.concat(),
            bounds: self.bounds,
            axis: self.axis()?,
            at: self.at.clone(),
            not: self.not.clone(),
        })
    }

    /// Returns the axis.
    ///
    /// # Errors
    /// If it is not two ends and a width.
    pub fn axis(&self) -> Result<Option<AxisHint>, Failure> {
        let parts: Vec<&[f64]> = self.axis.iter().map(|part| &part[..]).collect();
        match parts[..] {
            [] => Ok(None),
            [&[x, y], &[u, v], &[width]] => Ok(Some(AxisHint { foot: [x, y], top: [u, v], width })),
            _ => {
                Err(plain("--axis needs the foot, the top and the width: --axis 100,220 104,40 80"))
            }
        }
    }

    /// Returns what draws depend on: the bytes of the mask's file, and the rest; nothing
    /// without a hint.
    ///
    /// # Errors
    /// As [`HintArgs::read`].
    pub fn bytes(&self) -> Result<Vec<u8>, Failure> {
        if self.option().is_none() {
            return Ok(Vec::new());
        }
        let mut all = self.mask.as_deref().map_or_else(|| Ok(Vec::new()), files::read)?;
        let rest = Hint { mask: None, ..self.read()? };
        all.extend(format!("{rest:?}").into_bytes());
        Ok(all)
    }

    /// Returns the arguments that repeat it.
    pub fn arguments(&self) -> Vec<String> {
        let written = |xs: &[f64]| xs.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
        let mut all = Vec::new();
        if let Some(path) = &self.mask {
            all.extend(["--mask".to_owned(), path.display().to_string()]);
        }
        if !self.outline.is_empty() {
            let corners: Vec<String> = self.outline.concat().iter().map(|p| written(p)).collect();
            // One argument, since a corner may begin with a minus sign.
            all.push(format!("--outline={}", corners.join(" ")));
        }
        if let Some(bounds) = &self.bounds {
            all.extend(["--box".to_owned(), written(bounds)]);
        }
        if !self.axis.is_empty() {
            all.push("--axis".to_owned());
            all.extend(self.axis.iter().map(|part| written(part)));
        }
        for (name, positions) in [("--at", &self.at), ("--not", &self.not)] {
            all.extend(positions.iter().flat_map(|p| [name.to_owned(), written(p)]));
        }
        all
    }

    /// The error that a command without photographs, or with many, has no use for a hint.
    ///
    /// # Errors
    /// If one was given.
    pub fn none_for(&self, command: &str) -> Result<(), Failure> {
        match self.option() {
            Some(option) => Err(plain(format!(
                "{option} is about one photograph, so `{command}` cannot use it"
            ))),
            None => Ok(()),
        }
    }
}

/// Parses numbers between commas.
fn numbers(text: &str) -> Result<Numbers, String> {
    let number = |t: &str| t.trim().parse::<f64>().ok().filter(|x| x.is_finite());
    let all: Option<Vec<f64>> = text.split(',').map(number).collect();
    all.ok_or_else(|| "expected numbers between commas, such as 100,220".to_owned())
}

/// Parses `X,Y`.
fn position(text: &str) -> Result<[f64; 2], String> {
    let found = numbers(text).ok().and_then(|xs| xs.try_into().ok());
    found.ok_or_else(|| "expected a position X,Y".to_owned())
}

/// Parses positions between spaces.
fn corners(text: &str) -> Result<Corners, String> {
    text.split_whitespace().map(position).collect()
}

/// Parses `X,Y,W,H`.
///
/// # Errors
/// If it is not four numbers, or the width or height is not above 0.
pub fn rectangle(text: &str) -> Result<[f64; 4], String> {
    match numbers(text).as_deref() {
        Ok(&[x, y, w, h]) if w > 0.0 && h > 0.0 => Ok([x, y, w, h]),
        _ => Err("expected four numbers X,Y,W,H with positive width and height".into()),
    }
}
