//! Geometry, drawing, and what is read from photographs and files.

#[path = "../common/mod.rs"]
mod common;
#[path = "../../benches/src/bin/shipped/mod.rs"]
mod shipped;

mod armature;
mod caches;
mod cameras;
mod depths;
mod drawing;
mod gltf;
mod gltf_shapes;
mod keypoints;
mod meshes;
