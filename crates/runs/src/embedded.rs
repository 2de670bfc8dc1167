//! `scene.json`: some draws of a run as meshes, and pictures of the best one, for the viewer
//! of its page.

use crate::best::Shown;
use crate::failure::Failure;
use crate::files::write_in;
use crate::inputs::Ready;
use crate::scene;
use base64::prelude::{BASE64_STANDARD, Engine as _};
use image::RgbImage;
use pcadlang_engine::lang::value::Located;
use pcadlang_engine::trace::Trace;
use pcadlang_inference::KeptTrace;
use pcadlang_library::scene::{ImageValue, ViewValue};
use pcadlang_numerics::platform::threads::{both, map_side_by_side};
use pcadlang_report::RunDir;
use pcadlang_report::embedded::{EmbeddedDraw, embedded};
use pcadlang_report::pictures::jpeg;
use pcadlang_scene::render::View;
use pcadlang_workbench::session::Layer;
use pcadlang_workbench::session::{as_view, picture_operand, reduced};
use serde_json::{Map, Value, json};
use std::sync::Arc;

/// The file.
pub const SCENE: &str = "scene.json";
/// Maximum draws, in addition to the best state.
const DRAWS: usize = 40;
/// The longer side of the pictures, in pixels, and their quality.
const SIDE: u32 = 512;
const QUALITY: u8 = 85;

/// Writes the file for the best state, of this density and as it was `shown`, if the
/// program has a view.
pub fn write_scene(
    dir: &RunDir,
    seed: u64,
    ready: &Ready,
    (log_joint, shown): (f64, &Shown),
    kept: &[KeptTrace],
) -> Result<(), Failure> {
    let Shown { view: Some(ViewValue(view)), located, .. } = shown else { return Ok(()) };
    let draws = scene::predictive(seed, 0);
    let mut all = vec![EmbeddedDraw {
        chain: None,
        draw: None,
        log_joint,
        label: Some("the best state".to_owned()),
        solid: view.solid().clone(),
    }];
    let every = kept.len().div_ceil(DRAWS).max(1);
    // Finding the picture evaluates all names after it, so it is done once.
    let mut found = None;
    for k in kept.iter().step_by(every) {
        let view = |mut t: Trace| {
            if found.is_none() {
                found = picture_operand(&mut t, draws);
            }
            as_view(t.query(&[found?], draws).ok()?.first()?, None)
        };
        // A state that cannot be rebuilt is one fewer to look at.
        let Some(view) = scene::loaded(&ready.model, &k.trace).ok().and_then(view) else {
            continue;
        };
        all.push(EmbeddedDraw {
            chain: Some(k.chain),
            draw: Some(k.draw),
            log_joint: k.log_joint,
            label: None,
            solid: view.solid().clone(),
        });
    }
    // Drawing and coding the pictures takes most of the time of a quick run's end.
    let drawn = || {
        let image = ready.image().and_then(|image| reduced(image, SIDE));
        map_side_by_side(&Layer::ALL, |l| layer(*l, view, image.as_ref(), located))
    };
    let (scene, drawn) = both(|| embedded(view.camera(), &all), drawn);
    let Some(mut scene) = scene else { return Ok(()) };
    let mut layers = Map::new();
    for (l, picture) in Layer::ALL.into_iter().zip(drawn) {
        match picture {
            _ if l == Layer::Photo => scene["photo"] = json!(picture),
            Some(picture) => drop(layers.insert(l.name().to_owned(), json!(picture))),
            None => {}
        }
    }
    scene["layers"] = Value::Object(layers);
    write_in(dir, SCENE, scene.to_string().as_bytes())
}

/// Draws a layer, if it applies, as a `data:` address.
fn layer(
    layer: Layer,
    view: &Arc<View>,
    image: Option<&ImageValue>,
    located: &[Located],
) -> Option<String> {
    let picture: RgbImage = layer.draw(view, image, located, SIDE).ok()?;
    let bytes = jpeg(&picture, QUALITY).ok()?;
    Some(format!("data:image/jpeg;base64,{}", BASE64_STANDARD.encode(bytes)))
}
