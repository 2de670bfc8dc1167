//! Shapes: triangle meshes made in code or read from files, placed in the world.
//!
//! World frame: right-handed, y up; lengths in scene units, angles in radians.
//! Independent of cameras and programs.

mod affine;
pub mod armature;
mod bounds;
mod cuboid;
mod edges;
mod error;
mod file_kinds;
mod frame;
pub mod glb;
pub mod gltf;
mod landmark;
mod lathe;
mod mesh;
mod mesh_file;
mod normals;
pub mod obj;
mod objects;
mod outward;
mod patches;
pub mod ply;
mod polygon;
mod profile_path;
mod real;
mod revolution;
mod revolve;
mod sides;
mod solid;
mod solid_vjps;
mod sphere;
pub mod stl;

pub use affine::Affine;
pub use bounds::Bounds;
pub use cuboid::{cuboid, vjp_cuboid};
pub use edges::weld;
pub use error::GeomError;
pub use file_kinds::not_an_armature;
pub use frame::{FileFrame, UpAxis};
pub use landmark::Landmark;
pub use lathe::{Caps, LatheGradient, lathe, vjp_lathe};
pub use mesh::{Edge, Edges, Mesh, NO_FACE, Topology};
pub use mesh_file::MeshFile;
pub use normals::Normals;
pub use objects::Object;
pub use outward::face_outward;
pub use patches::Patches;
pub(crate) use patches::Run;
pub use profile_path::{Profile, Wall};
pub use revolution::{Revolution, Rim, Ring, Span};
pub(crate) use sides::Side;
pub use sides::Sides;
pub(crate) use solid::MeshesMark;
pub use solid::{Instance, PlacedRevolution, Solid};
pub use solid_vjps::{ByVertex, PlacedGradient};
pub use sphere::{sphere, vjp_sphere};

/// Returns the matrix a b'.
pub fn outer(a: glam::DVec3, b: glam::DVec3) -> glam::DMat3 {
    glam::DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}
