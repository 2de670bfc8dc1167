//! Geometry, drawing, and what is read from photographs and files.

#[path = "../common/mod.rs"]
mod common;
#[allow(dead_code)]
#[path = "../../crates/scene/src/vision/detect/forest/writer.rs"]
mod forests;
#[path = "../../benches/src/bin/shipped/mod.rs"]
mod shipped;

mod armature;
mod autorig;
mod caches;
mod detectors;
mod drawing;
mod gltf;
mod keypoints;
