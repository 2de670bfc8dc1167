//! Wavefront OBJ: reading, and writing.
//!
//! Polygons are cut into triangles (`polygon.rs`). Materials, colours, texture coordinates
//! and the file's own normals are ignored; [`Mesh::new`] computes normals. Invariant: every
//! vertex is finite and every corner of a face exists, so no input can cause a panic.

use super::mesh::{MOST_PARTS, MOST_TRIANGLES};
use super::mesh_file::MeshFile;
use super::polygon::{Cutter, MOST_CORNERS};
use super::{FileFrame, GeomError, Mesh, Object};
use glam::Vec3;
use indexmap::IndexSet;
use std::borrow::Cow;
use std::fmt::Write;
use std::sync::Arc;

/// Statements of free-form curves and surfaces, and of what they are made.
const FREE_FORM: [&str; 4] = ["curv", "curv2", "surf", "vp"];

/// Reads a mesh. Each object or group of the file is a part with its name, numbered by
/// first use; reopening one continues it. A fourth coordinate divides the others.
///
/// # Errors
/// [`GeomError::Invalid`] if the file has no faces, or none of them has positive area. With
/// the line number, if a line is malformed, a coordinate is not finite, a face uses a vertex
/// that is not defined before it, or there are more than 65535 parts or five million
/// triangles.
pub fn load(bytes: &[u8]) -> Result<Mesh, GeomError> {
    load_in(bytes, &FileFrame::default())
}

/// Reads a mesh with another up axis or unit than the scene's; see [`load`].
///
/// # Errors
/// As [`load`], and if a coordinate is not finite in scene units.
pub fn load_in(bytes: &[u8], frame: &FileFrame) -> Result<Mesh, GeomError> {
    indexed(bytes)?.placed(frame).mesh()
}

/// Reads a mesh with the file's own vertex indices, which skin weights refer to.
///
/// # Errors
/// As [`load`], except that triangles without area are kept.
pub fn indexed(bytes: &[u8]) -> Result<MeshFile, GeomError> {
    let text = text(bytes);
    let (mut out, mut cutter) = (MeshFile::default(), Cutter::default());
    let (mut names, mut name) = (IndexSet::<Arc<str>>::new(), Arc::from(""));
    let (mut part, mut corners) = (None, Vec::with_capacity(4));
    let mut free_form = None;
    for (number, line) in statements(&text) {
        let at =
            |what: String| GeomError::invalid(format!("line {number} of the OBJ file: {what}"));
        let mut words = line.split_whitespace().take_while(|w| !w.starts_with('#'));
        match words.next() {
            Some("v") => out.positions.push(vertex(words).map_err(at)?),
            // The first version of the format wrote `fo` for `f`.
            Some("f" | "fo") => {
                face(words, out.positions.len() as i64, &mut corners).map_err(at)?;
                cutter.cut(&out.positions, &corners, &mut out.triangles);
                if out.triangles.len() > MOST_TRIANGLES {
                    return Err(at(format!("more than {MOST_TRIANGLES} triangles")));
                }
                let part = *part.get_or_insert_with(|| names.insert_full(Arc::clone(&name)).0);
                if part >= MOST_PARTS {
                    return Err(at(format!("more than {MOST_PARTS} objects and groups")));
                }
                out.parts.resize(out.triangles.len(), part as u16);
            }
            Some(word @ ("o" | "g")) => {
                name = Arc::from(line.trim_start()[word.len()..].trim());
                part = None;
            }
            Some(word) => free_form = free_form.or(FREE_FORM.iter().find(|w| **w == word)),
            None => {}
        }
    }
    out.part_names = names.into_iter().collect();
    if let Some(word) = free_form {
        out.remarks.push(format!("free-form curves and surfaces (`{word}`) are not read"));
    }
    match (out.triangles.is_empty(), free_form, out.positions.len()) {
        (false, ..) => Ok(out),
        (_, Some(word), _) => Err(GeomError::invalid(format!(
            "the OBJ file has no faces; its free-form surfaces (`{word}`) are not read: convert \
             them to polygons in the program that made them"
        ))),
        (_, _, 0) => Err(GeomError::invalid("the OBJ file has no faces")),
        (_, _, n) => {
            Err(GeomError::invalid(format!("the OBJ file has {n} vertices, but no faces")))
        }
    }
}

/// Returns the text of a file: UTF-8, with or without a mark of byte order, or else Latin-1,
/// in which every byte is a character (names and comments may hold some).
fn text(bytes: &[u8]) -> Cow<'_, str> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    match std::str::from_utf8(bytes) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => Cow::Owned(bytes.iter().map(|b| char::from(*b)).collect()),
    }
}

/// The statements of a file with the numbers of their first lines: a line that ends with a
/// backslash goes on in the next, unless it is a comment or ends with a name (a path, perhaps).
fn statements(text: &str) -> impl Iterator<Item = (usize, Cow<'_, str>)> {
    let mut lines = text.lines().enumerate();
    std::iter::from_fn(move || {
        let (i, line) = lines.next()?;
        let word = line.split_whitespace().next().unwrap_or_default();
        let goes_on = |line: &str| line.trim_end().ends_with('\\');
        if !goes_on(line)
            || word.starts_with('#')
            || matches!(word, "o" | "g" | "usemtl" | "mtllib")
        {
            return Some((i + 1, Cow::Borrowed(line)));
        }
        let (mut whole, mut last) = (String::new(), line);
        while goes_on(last) {
            whole.push_str(last.trim_end().trim_end_matches('\\'));
            whole.push(' ');
            last = lines.next().map_or("", |(_, line)| line);
        }
        whole.push_str(last);
        Some((i + 1, Cow::Owned(whole)))
    })
}

/// Parses the numbers after `v`: three coordinates, four, or three and an RGB colour.
fn vertex<'a>(words: impl Iterator<Item = &'a str>) -> Result<Vec3, String> {
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
    let p = Vec3::new(x[0], x[1], x[2]);
    if count != 4 {
        return Ok(p);
    }
    let p = p / x[3];
    if p.is_finite() {
        Ok(p)
    } else {
        Err(format!("the coordinates divided by {} are not finite", x[3]))
    }
}

/// Parses the corners after `f`, counted from 1 or backwards from -1, of vertices so far.
fn face<'a>(
    words: impl Iterator<Item = &'a str>,
    vertices: i64,
    corners: &mut Vec<u32>,
) -> Result<(), String> {
    corners.clear();
    for w in words {
        let number = w.split('/').next().unwrap_or_default();
        let v = number
            .parse::<i64>()
            .map_err(|_| format!("a corner must be the number of a vertex, got `{w}`"))?;
        let place = if v < 0 { vertices.saturating_add(v) } else { v - 1 };
        if !(0..vertices).contains(&place) {
            return Err(format!("no vertex {v}; {vertices} are defined so far"));
        }
        corners.push(place as u32);
        if corners.len() > MOST_CORNERS {
            return Err(format!("a face with more than {MOST_CORNERS} corners"));
        }
    }
    if corners.len() < 3 {
        Err(format!("a face needs three corners, got {}", corners.len()))
    } else {
        Ok(())
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
        assert_eq!(fails("v 0 0 0\n"), "the OBJ file has 1 vertices, but no faces");
        assert!(fails("vp 0 0\nsurf 0 1 0 1 1\n").contains("free-form surfaces (`vp`)"));
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
    fn files_as_programs_write_them() {
        let area = |bytes: &[u8]| -> f32 {
            let m = load(bytes).unwrap();
            let corner = |t: &[u32; 3]| t.map(|v| m.positions[v as usize]);
            m.topology
                .triangles
                .iter()
                .map(corner)
                .map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0)
                .sum()
        };
        let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
        let same = |text: &str| assert!((area(text.as_bytes()) - 1.0).abs() < 1e-6, "{text:?}");
        same(&format!("\u{feff}{square}f 1 2 3 4\n"));
        same(&format!("{square}f 1 2 3 4 # the front\n"));
        same(&format!("{square}f 1 2 \\\n  3 \\\n4\nl 1 2\np 1\n"));
        same(&format!(
            "# C:\\models\\\n{square}mtllib C:\\a b\\\nusemtl a b\nf 1//1 2//1 3//1 4//1\n"
        ));
        same(&format!("{square}f -4 -3 -2 -1\n").replace('\n', "\r\n"));
        same("v 0 0 0 1\nv 1 0 0 1 # one\nv 1 1 0 0.5 0.5 0.5\nv 0 2 0 2\nfo 1 2 3 4");
        let latin = [b"# caf\xe9\no t\xeate 1\n", square.as_bytes(), b"f 1 2 3 4\n"].concat();
        assert_eq!(area(&latin), 1.0);
        assert_eq!(*indexed(&latin).unwrap().part_names[0], *"t\u{ea}te 1");
        // An L: a fan has area 3.25 or 3.5, by where it starts.
        let l = "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0\nf 3 4 5 6 1 2\n";
        assert!((area(l.as_bytes()) - 3.0).abs() < 1e-6);
        let curved = format!("{square}f 1 2 3 4\nsurf 0 1 0 1 1 2\n");
        assert_eq!(
            indexed(curved.as_bytes()).unwrap().remarks,
            ["free-form curves and surfaces (`surf`) are not read"]
        );
    }

    /// `tobj` reads the same triangles, in the same order.
    #[test]
    fn another_reader_agrees() {
        let text = "mtllib a.mtl\no one\nv 0 0 0\nv 1.5 0 0\nv 1.5e0 1 0\nv 0 1 -2\nvt 0 0\nvn 0 0 1\n\
                    usemtl red\ns 1\nf 1/1/1 2/1/1 3/1/1 4/1/1\nl 1 2\ng two\nv 3 3 3\nf -1 -3 -2\n\
                    f 1//1 3//1 5//1\n";
        let options =
            tobj::LoadOptions { triangulate: true, ignore_lines: true, ..Default::default() };
        let none = |_: &std::path::Path| Ok(Default::default());
        let (models, _) = tobj::load_obj_buf(&mut text.as_bytes(), &options, none).unwrap();
        let theirs: Vec<Vec3> = models
            .iter()
            .flat_map(|m| {
                m.mesh
                    .indices
                    .iter()
                    .map(|i| Vec3::from_slice(&m.mesh.positions[3 * *i as usize..]))
            })
            .collect();
        let ours = indexed(text.as_bytes()).unwrap();
        let corner = |v: &u32| ours.positions[*v as usize];
        assert_eq!(ours.triangles.iter().flatten().map(corner).collect::<Vec<_>>(), theirs);
        assert_eq!(theirs.len(), 12);
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
