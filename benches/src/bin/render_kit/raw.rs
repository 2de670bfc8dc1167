//! The files of meshes and poses.

use std::error::Error;
use std::path::Path;

/// A row-major 4 x 4 matrix.
pub type Pose = [f32; 16];

/// The vertices and triangles of a file.
pub struct Raw {
    pub vertices: Vec<[f32; 3]>,
    pub triangles: Vec<[u32; 3]>,
}

pub fn words(path: &Path) -> Result<Vec<u32>, Box<dyn Error>> {
    let bytes = std::fs::read(path).map_err(|e| format!("{}: {e}", path.display()))?;
    Ok(bytes.as_chunks().0.iter().map(|c| u32::from_le_bytes(*c)).collect())
}

pub fn load(path: &Path) -> Result<Raw, Box<dyn Error>> {
    let words = words(path)?;
    let too_short = || format!("{}: too short", path.display());
    let (n, m) = match words[..] {
        [n, m, ..] => (n as usize, m as usize),
        _ => return Err(too_short().into()),
    };
    let vertices = words.get(2..2 + 3 * n).ok_or_else(too_short)?;
    let triangles = words.get(2 + 3 * n..2 + 3 * (n + m)).ok_or_else(too_short)?;
    let vertices =
        vertices.as_chunks().0.iter().map(|v: &[u32; 3]| v.map(f32::from_bits)).collect();
    Ok(Raw { vertices, triangles: triangles.as_chunks().0.to_vec() })
}
