//! Geometry, drawing, and what is read from photographs and files.

#[path = "../common/mod.rs"]
mod common;
#[path = "../../benches/src/bin/detail_price/subjects.rs"]
mod subjects;

mod armature;
mod caches;
mod detail;
mod drawing;
mod gltf;
mod keypoints;
