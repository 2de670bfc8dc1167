//! The likelihood of a photograph's colours given a view: `scene.region`. The arithmetic
//! is in [`pcadlang_scene::vision::region`]; here the rendered frame is converted to one group per
//! pixel.

use super::compare::{
    SECTION, SEEN, SIZE, SharedTally, by_silhouette, by_view, drawn, image, reading, tallying,
    unsuitable,
};
use super::incremental;
use super::observed::ImageValue;
use pcadlang_engine::lang::adjoint::Adjoint;
use pcadlang_engine::lang::builtins::{Args, PreviousEvaluation, Row, State, Type, int, num, word};
use pcadlang_engine::lang::error::Fault;
use pcadlang_engine::lang::value::{Likelihood, Value};
use pcadlang_numerics::rng::Stream;
use pcadlang_scene::render::{Channel, Frame, View};
use pcadlang_scene::vision::region::{Quantised, Tally};
use pcadlang_scene::vision::{Region, RegionOptions};
use std::cell::RefCell;
use std::sync::Arc;

/// The maximum number of groups besides the background; further parts share the last one.
const MOST_GROUPS: u16 = 15;

const USUAL: RegionOptions = RegionOptions::USUAL;

pub(super) const TABLE: &[Row] = &[incremental(
    "region",
    SECTION,
    &[
        SEEN,
        num("power", USUAL.power, "The power of the term for the whole picture."),
        int("tiles", USUAL.tiles, [0, 64], "The number of tiles along each side of the picture, each with its own colour distribution; 0: none."),
        num("tile_power", USUAL.tile_power, "The power of the term for the tiles."),
        int("colours", USUAL.colours as u32, [2, 256], "The number of colours the photograph is reduced to."),
        word("groups", &["silhouette", "parts"], "The regions with their own colour distribution, besides the background: \
             \"silhouette\": the object; \"parts\": each of its parts, with all from the 15th on \
             as one."),
        num("shading", USUAL.shading, "The power of the term for shading, whether brightness follows the normals; 0: off."),
        SIZE,
    ],
    Type::Likelihood,
    "The likelihood ratio of the photograph's colours: separate distributions inside and outside, \
     against a single background. It is a normalised probability (of the colour-reduced picture) \
     only if one term has power 1 and the others 0.",
    region,
)
.vjp(|_, _, by| Some(by_view(by.clone(), 7)))];

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Groups {
    Silhouette,
    Parts,
}

#[derive(Debug)]
struct RegionOf {
    view: Arc<View>,
    size: u32,
    groups: Groups,
    options: RegionOptions,
    tally: Arc<SharedTally<Region, Tally>>,
}

fn region(a: &Args, previous: Option<&PreviousEvaluation>) -> Result<(Value, State), Fault> {
    let options = RegionOptions {
        power: a.num("power")?,
        tiles: a.int("tiles")?,
        tile_power: a.num("tile_power")?,
        colours: a.int("colours")? as usize,
        shading: a.num("shading")?,
        ..USUAL
    };
    let groups = if a.word("groups")? == "parts" { Groups::Parts } else { Groups::Silhouette };
    let (view, size) = reading(a, channel(groups, &options))?;
    tallying(previous, |tally| RegionOf { view, size, groups, options, tally })
}

/// The channel that it reads: depth, if it depends on the silhouette only.
fn channel(groups: Groups, options: &RegionOptions) -> Channel {
    match groups {
        Groups::Silhouette if options.shading == 0.0 => Channel::Depth,
        _ => Channel::Frame,
    }
}

thread_local! {
    static GROUPS: RefCell<Vec<u8>> = RefCell::default();
}

impl RegionOf {
    /// True if the likelihood depends on the silhouette only.
    fn outline(&self) -> bool {
        channel(self.groups, &self.options) == Channel::Depth
    }

    /// Returns the observed colours, prepared at the rendered size.
    fn region(&self, observed: &Value) -> Result<Arc<Region>, Fault> {
        let image = image(observed, &self.view, self.name())?;
        let Some(photo) = image.as_photo() else {
            return Err(Fault::type_error(
                "scene.region: colours need a photograph, and only a contour map was observed",
            ));
        };
        let camera = self.view.camera().scaled_to(self.size);
        let key = (self.options.clone(), camera.width, camera.height);
        image.prepared().get(key, |(options, w, h)| {
            Region::prepare(photo, *w, *h, options).map_err(unsuitable(self.name()))
        })
    }

    /// Returns the rendered frame.
    fn frame(&self) -> Arc<Frame> {
        if self.outline() { self.view.depth(self.size) } else { self.view.frame(self.size) }
    }

    /// Computes the group of each pixel.
    fn fill(&self, frame: &Frame, groups: &mut Vec<u8>) {
        groups.clear();
        match self.groups {
            Groups::Silhouette => groups.extend(frame.mask().map(u8::from)),
            Groups::Parts => groups.extend(frame.part.iter().map(|p| group(*p))),
        }
    }
}

impl Likelihood for RegionOf {
    fn name(&self) -> &'static str {
        "scene.region"
    }

    fn approximations(&self) -> Vec<String> {
        vec![drawn(self.size)]
    }

    fn log_density(&self, observed: &Value) -> Result<f64, Fault> {
        let region = self.region(observed)?;
        Ok(GROUPS.with_borrow_mut(|groups| {
            self.tally.with(&region, |tally| {
                let frame = self.frame();
                self.fill(&frame, groups);
                region.log_likelihood_after(groups, &frame.normal, tally)
            })
        }))
    }

    /// Only if the options make it a probability of colour-reduced pictures. The result
    /// is the observed photograph with simulated colours prepared for these options and
    /// the rendered size.
    fn sample(&self, observed: &Value, rng: &mut Stream) -> Option<Result<Value, Fault>> {
        if !self.is_proper() {
            return None;
        }
        let draw = |region: Arc<Region>| {
            let (frame, mut groups) = (self.frame(), Vec::new());
            self.fill(&frame, &mut groups);
            let labels = region.simulate(&groups, rng);
            let picture = Quantised::new(frame.width, frame.height, region.colours(), labels)
                .map_err(unsuitable(self.name()))?;
            let other = Region::of(&picture, &self.options).map_err(unsuitable(self.name()))?;
            let photo = image(observed, &self.view, self.name())?.as_photo().cloned();
            let value = photo.map_or_else(ImageValue::default, ImageValue::photo);
            let key = (self.options.clone(), frame.width, frame.height);
            value.prepared().get(key, |_| Ok(other))?;
            Ok(Value::object(value))
        };
        Some(self.region(observed).and_then(draw))
    }

    /// With respect to the view, if the likelihood depends on the silhouette only.
    fn gradient(&self, observed: &Value) -> Option<Adjoint> {
        let region = self.region(observed).ok().filter(|_| self.outline())?;
        let groups: Vec<u8> = self.frame().mask().map(u8::from).collect();
        Some(by_silhouette(&self.view, self.size, &region.gains(&groups)))
    }

    fn is_proper(&self) -> bool {
        self.options.is_proper()
    }
}

/// The group of a part: one for each part in order, then the last one for the rest; 0 for
/// the background.
fn group(part: u16) -> u8 {
    if part == u16::MAX { 0 } else { part.min(MOST_GROUPS - 1) as u8 + 1 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pcadlang_scene::geom::{Profile, Solid, lathe};
    use pcadlang_scene::render::Camera;
    use pcadlang_scene::vision::{ContourMap, Photo};

    fn vase(shift: f64) -> Arc<View> {
        let parts = [
            Profile { y: vec![-1.0, 0.0], r: vec![0.6, 0.8] },
            Profile { y: vec![0.0, 1.0], r: vec![0.4, 0.3] },
        ];
        let mesh = lathe(&parts, 32, 0.0, pcadlang_scene::geom::Caps::Both).unwrap();
        let by = pcadlang_scene::geom::Affine::new(
            [shift, 0.0, 0.0].into(),
            [0.4, 0.0, 0.1].into(),
            [1.0; 3].into(),
        );
        Arc::new(View::new(Solid::new(Arc::new(mesh)).placed(by), Camera::default_for(64, 64)))
    }

    /// A photograph of the vase, with a different colour for each part and lit from
    /// above.
    fn photograph() -> Value {
        let frame = vase(0.0).frame(64);
        let rgb = image::RgbImage::from_fn(64, 64, |x, y| {
            let i = (y * 64 + x) as usize;
            let noise = (x * 31 + y * 17 + x * y) % 23;
            let base = match frame.part[i] {
                u16::MAX => [90.0, 120.0, 150.0],
                0 => [150.0, 60.0, 40.0],
                _ => [80.0, 150.0, 60.0],
            };
            let light =
                if frame.part[i] == u16::MAX { 1.0 } else { 0.7 + 0.4 * frame.normal[i][1] };
            image::Rgb(base.map(|b| (b * light) as u8 + noise as u8))
        });
        Value::object(ImageValue::photo(Photo::from_rgb(rgb).unwrap()))
    }

    fn of(shift: f64, groups: Groups, options: &RegionOptions) -> RegionOf {
        let (view, options) = (vase(shift), options.clone());
        RegionOf { view, size: 64, groups, options, tally: SharedTally::after(None) }
    }

    #[test]
    fn the_true_place_wins_with_every_term() {
        let photo = photograph();
        let none = RegionOptions { power: 0.0, tile_power: 0.0, ..RegionOptions::default() };
        for (groups, options) in [
            (Groups::Silhouette, RegionOptions::default()),
            (Groups::Parts, RegionOptions::default()),
            (Groups::Silhouette, RegionOptions { power: 0.05, ..none.clone() }),
            (Groups::Parts, RegionOptions { tile_power: 0.1, ..none.clone() }),
            (Groups::Parts, RegionOptions { shading: 0.05, ..none.clone() }),
        ] {
            let at = |shift: f64| of(shift, groups, &options).log_density(&photo).unwrap();
            let (right, near, far) = (at(0.0), at(0.15), at(50.0));
            assert!(right > near && right > 1.0 && far == 0.0, "{options:?}: {right} {near} {far}");
        }
        let d = RegionOptions::default();
        let silhouette = of(0.0, Groups::Silhouette, &d).log_density(&photo).unwrap();
        assert!(of(0.0, Groups::Parts, &d).log_density(&photo).unwrap() > silhouette);
    }

    #[test]
    fn contour_maps_and_other_things_are_refused() {
        let l = of(0.0, Groups::Silhouette, &RegionOptions::default());
        let map = Value::object(ImageValue::contours(ContourMap::new(64, 64), None));
        assert!(l.log_density(&map).unwrap_err().message.contains("need a photograph"));
        assert!(l.log_density(&Value::Num(1.0)).unwrap_err().message.contains("must be an image"));
        let bad = RegionOptions { power: -1.0, ..RegionOptions::default() };
        let said =
            of(0.0, Groups::Silhouette, &bad).log_density(&photograph()).unwrap_err().message;
        assert!(said.contains("scene.region: power must be at least 0"), "{said}");
        assert!(!l.is_proper());
    }

    #[test]
    fn parts_beyond_the_last_group_share_it() {
        assert_eq!([0, 1, 13, 14, 15, 900].map(group), [1, 2, 14, 15, 15, 15]);
        assert_eq!(group(u16::MAX), 0);
    }
}
