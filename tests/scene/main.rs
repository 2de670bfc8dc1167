//! Geometry, drawing, and what is read from photographs and files.

#[path = "../common/mod.rs"]
mod common;
#[allow(dead_code)]
#[path = "../../crates/scene/src/vision/detect/forest/writer.rs"]
mod forests;
#[path = "../../benches/src/bin/detail_price/subjects.rs"]
mod subjects;

mod armature;
mod autorig;
mod caches;
mod detail;
mod detectors;
mod drawing;
mod gltf;
mod keypoints;
