//! Wavefront OBJ: reading through `tobj`, after a look at the text that says which line is wrong; writing.

use super::mesh::MOST_TRIANGLES;
use super::{GeomError, Mesh};
use glam::Vec3;
use std::fmt::Write;

/// Reads a mesh; each object or group of the file is a part. Polygons are cut into triangles, materials ignored.
///
/// # Errors
/// If it is not text, a line is malformed, a coordinate is not finite, a face uses a vertex that is not there, or nothing
/// has an area: with the number of the line.
pub fn load(bytes: &[u8]) -> Result<Mesh, GeomError> {
    let text = std::str::from_utf8(bytes)
        .map_err(|e| GeomError::invalid(format!("the OBJ file is not text (byte {})", e.valid_up_to())))?;
    check(text)?;
    let options = tobj::LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        single_index: false,
        ..tobj::LoadOptions::default()
    };
    let no_materials = |_: &std::path::Path| Ok((Vec::new(), Default::default()));
    let (models, _) = tobj::load_obj_buf(&mut &*bytes, &options, no_materials)
        .map_err(|e| GeomError::invalid(format!("the OBJ file cannot be read: {e}")))?;
    let (mut positions, mut triangles, mut parts) = (Vec::new(), Vec::new(), Vec::new());
    for (i, m) in models.iter().enumerate() {
        let first = positions.len() as u32;
        positions.extend(m.mesh.positions.chunks_exact(3).map(Vec3::from_slice));
        triangles.extend(m.mesh.indices.chunks_exact(3).map(|t| [t[0] + first, t[1] + first, t[2] + first]));
        parts.resize(triangles.len(), i.min(usize::from(u16::MAX - 1)) as u16);
    }
    if triangles.is_empty() {
        return Err(GeomError::invalid("the OBJ file has no faces"));
    }
    Mesh::new(positions, triangles, parts)
}

/// Finds the line that is wrong.
fn check(text: &str) -> Result<(), GeomError> {
    let (mut vertices, mut triangles) = (0i64, 0usize);
    for (i, line) in text.lines().enumerate() {
        let at = |what: String| Err(GeomError::invalid(format!("line {} of the OBJ file: {what}", i + 1)));
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                vertices += 1;
                let mut count = 0;
                for w in words.take(3) {
                    match w.parse::<f32>() {
                        Ok(x) if x.is_finite() => count += 1,
                        _ => return at(format!("a coordinate must be a finite number, got `{w}`")),
                    }
                }
                if count < 3 {
                    return at("a vertex needs three coordinates".into());
                }
            }
            Some("f") => {
                let mut corners = 0;
                for w in words {
                    corners += 1;
                    let number = w.split('/').next().unwrap_or_default();
                    let Ok(v) = number.parse::<i64>() else {
                        return at(format!("a corner must be the number of a vertex, got `{w}`"));
                    };
                    let place = if v < 0 { vertices + v } else { v - 1 };
                    if place < 0 || place >= vertices {
                        return at(format!("there is no vertex {v}; there are {vertices} so far"));
                    }
                }
                if corners > 1000 {
                    return at(format!("a face with {corners} corners; at most 1000"));
                }
                triangles += corners.max(2) - 2;
                if triangles > MOST_TRIANGLES {
                    return at(format!("more than {MOST_TRIANGLES} triangles"));
                }
            }
            _ => {}
        }
    }
    Ok(())
}

/// The text of an OBJ file with positions, normals and one group for each part.
pub fn write(mesh: &Mesh) -> String {
    let mut s = String::with_capacity(mesh.positions.len() * 64 + mesh.topology.triangles.len() * 32);
    for p in &mesh.positions {
        let _ = writeln!(s, "v {} {} {}", p.x, p.y, p.z);
    }
    for n in &mesh.normals {
        let _ = writeln!(s, "vn {} {} {}", n.x, n.y, n.z);
    }
    let mut group = None;
    for (t, part) in mesh.topology.triangles.iter().zip(&mesh.topology.parts) {
        if group != Some(part) {
            let _ = writeln!(s, "g part{part}");
            group = Some(part);
        }
        let [a, b, c] = t.map(|v| v + 1);
        let _ = writeln!(s, "f {a}//{a} {b}//{b} {c}//{c}");
    }
    s
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Caps, Profile, cuboid, lathe};

    #[test]
    fn what_is_written_reads_back() {
        let profile = Profile { y: vec![0.0, 1.0, 2.0], r: vec![0.5, 0.7, 0.3] };
        let m = lathe(&[profile], 12, 0.1, Caps::Both).unwrap();
        let back = load(write(&m).as_bytes()).unwrap();
        assert_eq!(back.topology.triangles.len(), m.topology.triangles.len());
        assert_eq!(back.bounds(), m.bounds());
        let b = cuboid(glam::DVec3::ONE).unwrap();
        assert_eq!(load(write(&b).as_bytes()).unwrap().topology.edges.len(), b.topology.edges.len());
    }

    #[test]
    fn mistakes_name_their_line() {
        let fails = |text: &str| load(text.as_bytes()).unwrap_err().to_string();
        assert_eq!(
            fails("v 0 0 0\nv 1 nan 0\n"),
            "line 2 of the OBJ file: a coordinate must be a finite number, got `nan`"
        );
        assert_eq!(
            fails("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n"),
            "line 4 of the OBJ file: there is no vertex 4; there are 3 so far"
        );
        assert_eq!(fails("f -1 1 2\n"), "line 1 of the OBJ file: there is no vertex -1; there are 0 so far");
        assert_eq!(fails("v 1 2\n"), "line 1 of the OBJ file: a vertex needs three coordinates");
        assert_eq!(fails("v 1 1e99 2\n"), "line 1 of the OBJ file: a coordinate must be a finite number, got `1e99`");
        assert_eq!(fails(""), "the OBJ file has no faces");
        assert_eq!(fails("v 0 0 0\nf 1 1 1\n"), "the mesh has no triangle with an area");
        assert!(load(&[0x66, 0xff, 0x20]).unwrap_err().to_string().contains("not text"));
    }

    #[test]
    fn polygons_and_groups() {
        let text = "o a\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\no b\nv 0 0 1\nf 1 2 5\n";
        let m = load(text.as_bytes()).unwrap();
        assert_eq!((m.topology.triangles.len(), m.topology.part_count), (3, 2));
    }

    proptest::proptest! {
        #[test]
        fn no_bytes_make_it_panic(text in "([vf] ?(-?[0-9]{1,3}(/[0-9]{0,2})?|nan|inf|#| |\n){0,6}\n){0,8}") {
            let _ = load(text.as_bytes());
        }
    }
}
