//! Wavefront OBJ: reading, and writing. `tobj` parses the text, after a check that
//! reports errors by line.
//!
//! Materials, colours, texture coordinates and the file's own normals are ignored;
//! [`Mesh::new`] computes normals. Invariant: `tobj` sees only finite vertices and faces
//! whose corners exist, so no input can cause a panic.

use super::mesh::{MOST_PARTS, MOST_TRIANGLES};
use super::{FileFrame, GeomError, Mesh, Object};
use glam::Vec3;
use rustc_hash::FxHashMap;
use std::fmt::Write;
use std::sync::Arc;

/// The maximum number of corners of a polygon.
const MOST_CORNERS: usize = 1000;

/// Reads a mesh. Each object or group of the file is a part with its name, numbered by
/// first use; reopening one continues it. Polygons are cut into triangle fans. A fourth
/// coordinate divides the others.
///
/// # Errors
/// [`GeomError::Invalid`] if the file is not text, has no faces, or none of them has
/// positive area. With the line number, if a line is malformed, a coordinate is not
/// finite, a face uses a vertex that is not defined before it, or there are more than
/// 65535 parts or five million triangles.
pub fn load(bytes: &[u8]) -> Result<Mesh, GeomError> {
    load_in(bytes, &FileFrame::default())
}

/// Reads a mesh with another up axis or unit than the scene's; see [`load`].
///
/// # Errors
/// As [`load`], and if a coordinate is not finite in scene units.
pub fn load_in(bytes: &[u8], frame: &FileFrame) -> Result<Mesh, GeomError> {
    let (plain, names) = plain(text(bytes)?)?;
    let options = tobj::LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        single_index: false,
    };
    let no_materials = |_: &std::path::Path| Ok((Vec::new(), Default::default()));
    let unreadable =
        |e: &dyn std::fmt::Display| GeomError::invalid(format!("cannot read the OBJ file: {e}"));
    let (models, _) = tobj::load_obj_buf(&mut plain.as_bytes(), &options, no_materials)
        .map_err(|e| unreadable(&e))?;
    let (mut positions, mut triangles, mut parts) = (Vec::new(), Vec::new(), Vec::new());
    for m in models.iter().filter(|m| !m.mesh.indices.is_empty()) {
        let part: u16 = m.name.parse().map_err(|e| unreadable(&e))?;
        let first = positions.len() as u32;
        positions.extend(
            m.mesh
                .positions
                .chunks_exact(3)
                .map(|p| frame.apply(Vec3::from_slice(p).as_dvec3()).as_vec3()),
        );
        triangles.extend(
            m.mesh.indices.chunks_exact(3).map(|t| [t[0] + first, t[1] + first, t[2] + first]),
        );
        parts.resize(triangles.len(), part);
    }
    if triangles.is_empty() {
        return Err(GeomError::invalid("the OBJ file has no faces"));
    }
    let mut mesh = Mesh::new(positions, triangles, parts)?;
    Arc::make_mut(&mut mesh.topology).part_names = names;
    Ok(mesh)
}

/// Vertices and triangles with the file's own numbering, and the object or group of each
/// triangle.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Indexed {
    /// The vertices in the file's order, whether used or not.
    pub positions: Vec<Vec3>,
    /// The triangles; polygons are cut into fans.
    pub triangles: Vec<[u32; 3]>,
    /// The number of each triangle's object or group, in order of first use.
    pub parts: Vec<u16>,
    /// The names of objects and groups by number; empty for faces before the first of
    /// them.
    pub part_names: Vec<Arc<str>>,
}

/// Reads a mesh with the file's own vertex indices, which skin weights refer to.
///
/// # Errors
/// As [`load`], except that triangles without area are kept.
pub fn indexed(bytes: &[u8]) -> Result<Indexed, GeomError> {
    let (plain, names) = plain(text(bytes)?)?;
    let (mut out, mut part) = (Indexed { part_names: names, ..Indexed::default() }, 0u16);
    for line in plain.lines() {
        let mut words = line.split(' ');
        // The lines are the output of `plain`, so every word parses as a number.
        match words.next() {
            Some("v") => {
                let mut number = || words.next().and_then(|w| w.parse().ok()).unwrap_or(0.0f32);
                out.positions.push(Vec3::new(number(), number(), number()));
            }
            Some("g") => part = words.next().and_then(|w| w.parse().ok()).unwrap_or(part),
            Some("f") => {
                let corners: Vec<u32> =
                    words.filter_map(|w| w.parse::<u32>().ok()?.checked_sub(1)).collect();
                for pair in corners.get(1..).unwrap_or_default().windows(2) {
                    out.triangles.push([corners[0], pair[0], pair[1]]);
                    out.parts.push(part);
                }
            }
            _ => {}
        }
    }
    if out.triangles.is_empty() {
        return Err(GeomError::invalid("the OBJ file has no faces"));
    }
    Ok(out)
}

fn text(bytes: &[u8]) -> Result<&str, GeomError> {
    std::str::from_utf8(bytes).map_err(|e| {
        GeomError::invalid(format!("the OBJ file is not text (byte {})", e.valid_up_to()))
    })
}

/// Checks a file line by line. Returns its vertices, its faces with absolute vertex
/// indices, and its parts as `g` with a number, and the names of the parts.
fn plain(text: &str) -> Result<(String, Vec<Arc<str>>), GeomError> {
    let mut out = String::with_capacity(text.len());
    let (mut vertices, mut triangles) = (0i64, 0usize);
    let mut names: FxHashMap<&str, usize> = FxHashMap::default();
    let (mut name, mut open) = ("", None);
    for (i, line) in text.lines().enumerate() {
        let at =
            |what: String| GeomError::invalid(format!("line {} of the OBJ file: {what}", i + 1));
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let p = vertex(words).map_err(at)?;
                vertices += 1;
                let _ = writeln!(out, "v {} {} {}", p[0], p[1], p[2]);
            }
            Some("f") => {
                let corners = face(words, vertices).map_err(at)?;
                triangles += corners.len() - 2;
                if triangles > MOST_TRIANGLES {
                    return Err(at(format!("more than {MOST_TRIANGLES} triangles")));
                }
                let next = names.len();
                let part = *names.entry(name).or_insert(next);
                if part >= MOST_PARTS {
                    return Err(at(format!("more than {MOST_PARTS} objects and groups")));
                }
                if open != Some(part) {
                    let _ = writeln!(out, "g {part}");
                    open = Some(part);
                }
                out.push('f');
                for c in &corners {
                    let _ = write!(out, " {c}");
                }
                out.push('\n');
            }
            Some(word @ ("o" | "g")) => {
                name = line.trim_start().strip_prefix(word).unwrap_or_default().trim()
            }
            _ => {}
        }
    }
    // Sort by number: the hash table's order is arbitrary.
    let mut by_number = vec![Arc::from(""); names.len()];
    for (name, number) in names {
        by_number[number] = Arc::from(name);
    }
    Ok((out, by_number))
}

/// Parses the numbers after `v`: three coordinates, four, or three and an RGB colour.
fn vertex<'a>(words: impl Iterator<Item = &'a str>) -> Result<[f32; 3], String> {
    let mut x = [0.0f32; 7];
    let mut count = 0;
    for w in words {
        let finite = w.parse::<f32>().ok().filter(|x| x.is_finite());
        let number =
            finite.ok_or_else(|| format!("a coordinate must be a finite number, got `{w}`"))?;
        *x.get_mut(count).ok_or("a vertex with more than 7 numbers")? = number;
        count += 1;
    }
    if count < 3 {
        return Err("a vertex needs three coordinates".into());
    }
    let p = [x[0], x[1], x[2]];
    if count != 4 {
        return Ok(p);
    }
    let p = p.map(|a| a / x[3]);
    if p.iter().all(|a| a.is_finite()) {
        Ok(p)
    } else {
        Err(format!("the coordinates divided by {} are not finite", x[3]))
    }
}

/// Parses the corners after `f`, counted from 1.
fn face<'a>(words: impl Iterator<Item = &'a str>, vertices: i64) -> Result<Vec<i64>, String> {
    let mut corners = Vec::with_capacity(4);
    for w in words {
        let number = w.split('/').next().unwrap_or_default();
        let v = number
            .parse::<i64>()
            .map_err(|_| format!("a corner must be the number of a vertex, got `{w}`"))?;
        let place = if v < 0 { vertices.saturating_add(v).saturating_add(1) } else { v };
        if !(1..=vertices).contains(&place) {
            return Err(format!("no vertex {v}; {vertices} are defined so far"));
        }
        corners.push(place);
        if corners.len() > MOST_CORNERS {
            return Err(format!("a face with more than {MOST_CORNERS} corners"));
        }
    }
    if corners.len() < 3 {
        Err(format!("a face needs three corners, got {}", corners.len()))
    } else {
        Ok(corners)
    }
}

/// Returns the text of an OBJ file with positions and normals: an object for each of these, and
/// in it a group for each of its parts, if there are several.
pub fn write(objects: &[Object]) -> String {
    let mut s = String::new();
    let mut first = 1;
    for Object { name, mesh } in objects {
        let t = &mesh.topology;
        s.reserve(mesh.positions.len() * 64 + t.triangles.len() * 32);
        let _ = writeln!(s, "o {}", on_one_line(name));
        for p in &mesh.positions {
            let _ = writeln!(s, "v {} {} {}", p.x, p.y, p.z);
        }
        for n in &mesh.normals {
            let _ = writeln!(s, "vn {} {} {}", n.x, n.y, n.z);
        }
        let one = t.parts.iter().all(|p| Some(p) == t.parts.first());
        let mut group = if one { t.parts.first().copied() } else { None };
        for (triangle, part) in t.triangles.iter().zip(&t.parts) {
            if group != Some(*part) {
                let _ = match t.part_names.get(usize::from(*part)).filter(|n| !n.is_empty()) {
                    Some(own) => writeln!(s, "g {}", on_one_line(own)),
                    None => writeln!(s, "g {}_part{part}", on_one_line(name)),
                };
                group = Some(*part);
            }
            let [a, b, c] = triangle.map(|v| v as usize + first);
            let _ = writeln!(s, "f {a}//{a} {b}//{b} {c}//{c}");
        }
        first += mesh.positions.len();
    }
    s
}

/// A name without ends of lines, and without what begins a comment or continues a line.
fn on_one_line(name: &str) -> String {
    let apart = |c: char| if c.is_control() || matches!(c, '#' | '\\') { '_' } else { c };
    name.trim().chars().map(apart).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Caps, Profile, cuboid, lathe};

    #[test]
    fn what_is_written_reads_back() {
        let profile = Profile { y: vec![0.0, 1.0, 2.0], r: vec![0.5, 0.7, 0.3] };
        let m = lathe(&[profile], 12, 0.1, Caps::Both).unwrap();
        let back = load(write(&[m.clone().into()]).as_bytes()).unwrap();
        assert_eq!(back.topology.triangles.len(), m.topology.triangles.len());
        assert_eq!(back.bounds(), m.bounds());
        let b = cuboid(glam::DVec3::ONE).unwrap();
        assert_eq!(
            load(write(&[b.clone().into()]).as_bytes()).unwrap().topology.edges.len(),
            b.topology.edges.len()
        );
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
            "line 4 of the OBJ file: no vertex 4; 3 are defined so far"
        );
        assert_eq!(
            fails("f -1 1 2\n"),
            "line 1 of the OBJ file: no vertex -1; 0 are defined so far"
        );
        assert_eq!(fails("v 1 2\n"), "line 1 of the OBJ file: a vertex needs three coordinates");
        assert_eq!(
            fails("v 1 1e99 2\n"),
            "line 1 of the OBJ file: a coordinate must be a finite number, got `1e99`"
        );
        assert_eq!(fails(""), "the OBJ file has no faces");
        assert_eq!(fails("v 0 0 0\nf 1 1 1\n"), "all triangles of the mesh have zero area");
        let three = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
        assert_eq!(
            fails(&format!("{three}f 1 2\n")),
            "line 4 of the OBJ file: a face needs three corners, got 2"
        );
        assert_eq!(
            fails(&format!("{three}f 0 1 2\n")),
            "line 4 of the OBJ file: no vertex 0; 3 are defined so far"
        );
        assert!(
            fails(&format!("{three}f 1 2 -9223372036854775808\n"))
                .contains("no vertex -9223372036854775808")
        );
        assert!(
            fails(&format!("{three}f 1 2 /3\n"))
                .ends_with("a corner must be the number of a vertex, got `/3`")
        );
        assert!(
            fails("v 1 1 1 0\n")
                .starts_with("line 1 of the OBJ file: the coordinates divided by 0")
        );
        assert!(fails("v 3e38 1 1 1e-9\n").contains("not finite"));
        assert!(fails("v 1 2 3 4 5 6 7 8\n").contains("more than 7"));
        assert!(
            fails(&format!("{three}f{}\n", " 1 2 3".repeat(400)))
                .contains("more than 1000 corners")
        );
        let many = (0..65537).fold(three.to_string(), |s, i| s + &format!("g {i}\nf 1 2 3\n"));
        assert_eq!(
            fails(&many),
            format!("line {} of the OBJ file: more than 65535 objects and groups", 3 + 2 * 65536)
        );
        assert!(load(&[0x66, 0xff, 0x20]).unwrap_err().to_string().contains("not text"));
    }

    #[test]
    fn polygons_and_groups() {
        let text = "o a\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\no b\nv 0 0 1\nf 1 2 5\n";
        let m = load(text.as_bytes()).unwrap();
        assert_eq!((m.topology.triangles.len(), m.topology.part_count), (3, 2));
        assert_eq!(m.topology.part_names, ["a".into(), "b".into()]);
        assert_eq!(indexed(text.as_bytes()).unwrap().part_names, m.topology.part_names);
        let two = crate::geom::Solid::new(Arc::new(m));
        let both = crate::geom::Solid::group(&[two.clone(), two]).to_mesh().unwrap();
        assert_eq!(
            both.topology.part_names.iter().map(|n| &**n).collect::<Vec<_>>(),
            ["a", "b", "a", "b"]
        );
    }

    #[test]
    fn what_is_not_geometry_is_passed_over() {
        let text = "# a\nmtllib no such.mtl\ng a\nv 0 0 0 1 0 0\nv 2 0 0\nv 0 4 0 2\nvt nan\nvn 1\nusemtl x\n\
                    f 1/9/-7 2/x 3//\nl 1 99\ng b\nusemtl\nf -3 -1 -2\ng a\nf 1 2 3\n";
        let m = load(text.as_bytes()).unwrap();
        assert_eq!(m.topology.parts, [0, 1, 0], "a group opened again goes on");
        assert_eq!(
            m.bounds().unwrap().max,
            glam::DVec3::new(2.0, 2.0, 0.0),
            "the fourth number divides"
        );
    }

    #[test]
    fn parts_and_shape_survive() {
        let stack = [
            Profile { y: vec![0.0, 1.0], r: vec![0.5, 0.5] },
            Profile { y: vec![1.0, 2.0], r: vec![0.3, 0.0] },
        ];
        let m = lathe(&stack, 9, 0.0, Caps::Both).unwrap();
        let back = load(write(&[m.clone().into()]).as_bytes()).unwrap();
        let corners = |m: &Mesh| {
            m.topology
                .triangles
                .iter()
                .flatten()
                .map(|v| m.positions[*v as usize])
                .collect::<Vec<_>>()
        };
        let faces_of = |m: &Mesh| {
            let mut sizes: Vec<usize> = (0..m.topology.part_count)
                .map(|p| m.topology.parts.iter().filter(|q| **q == p).count())
                .collect();
            sizes.retain(|n| *n > 0);
            sizes.sort_unstable();
            sizes
        };
        let sorted = |m: &Mesh| {
            let mut c: Vec<[u32; 9]> = corners(m)
                .chunks_exact(3)
                .map(|t| std::array::from_fn(|i| (t[i / 3][i % 3] + 0.0).to_bits()))
                .collect();
            c.sort_unstable();
            c
        };
        assert_eq!(sorted(&back), sorted(&m), "single precision survives the text");
        assert_eq!(faces_of(&back), faces_of(&m));
        let text = |m: Mesh| write(&[m.into()]);
        assert_eq!(text(load(text(back.clone()).as_bytes()).unwrap()), text(back));
    }

    proptest::proptest! {
        #![proptest_config(proptest::test_runner::Config {
            rng_seed: proptest::test_runner::RngSeed::Fixed(12),
            failure_persistence: None,
            ..Default::default()
        })]

        #[test]
        fn no_text_makes_it_panic(text in "([vf] ?(-?[0-9]{1,3}(/[0-9]{0,2})?|nan|inf|#| |\n){0,6}\n){0,8}") {
            let _ = load(text.as_bytes());
        }

        #[test]
        fn no_lines_make_it_panic(
            lines in proptest::collection::vec("(v|vt|vn|f|l|p|o|g|usemtl|mtllib|s|é|\\\\)( -?[0-9]{0,20}(/-?[0-9]{0,20}){0,3}| [0-9.e-]{1,6}){0,6}", 0..12),
            faces in proptest::collection::vec((-5i64..5, -5i64..5, -5i64..5), 0..6),
        ) {
            let corners = faces.iter().map(|(a, b, c)| format!("f {a} {b}/{c} {c}//{a}\n"));
            let text = lines.join("\n") + "\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n" + &corners.collect::<String>();
            if let Ok(m) = load(text.as_bytes()) {
                proptest::prop_assert!(m.positions.iter().chain(&m.normals).all(|p| p.is_finite()));
            }
        }

        #[test]
        fn no_bytes_make_it_panic(bytes in proptest::collection::vec(proptest::num::u8::ANY, 0..200)) {
            let _ = load(&bytes);
        }
    }
}
