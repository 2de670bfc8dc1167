//! Reads PLY (Turk, The PLY Polygon File Format, 1994) by the crate `serde-ply`: the polygons
//! and triangle strips of its vertices, in text and both binary orders. Other elements and
//! properties are ignored.
//!
//! Invariant: before the crate reads, the header's counts have been compared with the bytes that
//! are there.

use super::GeomError;
use super::mesh::MOST_TRIANGLES;
use super::mesh_file::MeshFile;
use super::polygon::{Cutter, MOST_CORNERS};
use glam::DVec3;
use serde::Deserialize;
use serde_ply::{DeserializeError, ElementDef, PlyFormat, PlyReader, PropertyType, ScalarType};
use std::io::ErrorKind;
use std::sync::Arc;

#[derive(Deserialize)]
struct Vertex {
    x: f64,
    y: f64,
    z: f64,
}

#[derive(Deserialize)]
struct Corners {
    #[serde(alias = "vertex_index")]
    vertex_indices: Vec<i64>,
}

/// Something else.
#[derive(Deserialize)]
struct Unread {}

/// What a file holds of a surface.
#[derive(Default)]
struct Contents {
    vertices: Vec<Vertex>,
    polygons: Vec<Corners>,
    strips: Vec<Corners>,
    is_text: bool,
    splats: bool,
}

/// Reads the faces of a file.
///
/// # Errors
/// [`GeomError::Invalid`]: a header that does not say what follows, or says that more follows
/// than does; a number that is not one, or a coordinate that is not finite; a face of a vertex
/// that does not exist, or of fewer than three; no faces (a cloud of points), or more than five
/// million triangles.
pub fn indexed(bytes: &[u8]) -> Result<MeshFile, GeomError> {
    let invalid = |what: String| GeomError::invalid(format!("the PLY file {what}"));
    let (mut whole, body) =
        split(bytes).ok_or_else(|| invalid("ends before `end_header`".into()))?;
    let head = whole.len();
    whole.extend(body);
    // The crate expects that a text ends with a space or an empty line.
    whole.push(b'\n');
    let (mut rest, mut contents) = (&whole[..], Contents::default());
    if let Err(e) = read(&mut rest, body.len(), &mut contents) {
        let read = whole.len() - rest.len();
        return Err(match e.0.kind() {
            ErrorKind::UnexpectedEof => invalid("ends too early".into()),
            _ if contents.is_text || read <= head => {
                let line = whole[..read].split(|b| *b == b'\n').count();
                let line = line - usize::from(whole[..read].ends_with(b"\n"));
                GeomError::invalid(format!("line {line} of the PLY file: {}", e.0))
            }
            _ => GeomError::invalid(format!("byte {read} of the PLY file: {}", e.0)),
        });
    }
    let mut out = MeshFile { part_names: vec![Arc::from("")], ..MeshFile::default() };
    out.positions = contents.vertices.iter().map(|v| DVec3::new(v.x, v.y, v.z).as_vec3()).collect();
    if let Some(i) = out.positions.iter().position(|p| !p.is_finite()) {
        return Err(invalid(format!("has a vertex that is not finite, number {i} from 0")));
    }
    let n = out.positions.len();
    let place = |v: &i64| match u32::try_from(*v) {
        Ok(place) if (place as usize) < n => Ok(place),
        _ => Err(invalid(format!("has a face with vertex {v}, but {n} vertices, from 0"))),
    };
    let (mut cutter, mut corners) = (Cutter::default(), Vec::new());
    for (i, face) in contents.polygons.iter().enumerate() {
        corners.clear();
        for v in &face.vertex_indices {
            corners.push(place(v)?);
        }
        if !(3..=MOST_CORNERS).contains(&corners.len()) {
            let count = corners.len();
            return Err(invalid(format!("has a face with {count} corners, number {i} from 0")));
        }
        cutter.cut(&out.positions, &corners, &mut out.triangles);
        if out.triangles.len() > MOST_TRIANGLES {
            break;
        }
    }
    // A negative number ends a strip.
    for strip in contents.strips.iter().flat_map(|s| s.vertex_indices.split(|v| *v < 0)) {
        for (i, t) in strip.windows(3).enumerate() {
            let t = [place(&t[0])?, place(&t[1])?, place(&t[2])?];
            out.triangles.push(if i % 2 == 0 { t } else { [t[1], t[0], t[2]] });
        }
    }
    if out.triangles.len() > MOST_TRIANGLES {
        return Err(invalid(format!("has more than {MOST_TRIANGLES} triangles")));
    }
    if out.triangles.is_empty() {
        let what = if contents.splats { "Gaussian splats" } else { "a cloud of points" };
        return Err(invalid(format!(
            "has {n} vertices, but no faces: it is {what}; make a surface of it first, such as \
             with MeshLab's or Open3D's Poisson reconstruction"
        )));
    }
    out.parts = vec![0; out.triangles.len()];
    Ok(out)
}

/// Splits a file after its header, which becomes lines of UTF-8 with a line feed each.
fn split(bytes: &[u8]) -> Option<(Vec<u8>, &[u8])> {
    const END: &[u8] = b"end_header";
    let starts_line = |i: usize| i > 0 && matches!(bytes[i - 1], b'\n' | b'\r');
    let mut places = bytes.windows(END.len()).enumerate();
    let (at, _) = places.find(|(i, w)| *w == END && starts_line(*i))?;
    let rest = &bytes[at + END.len()..];
    let rest = &rest[rest.iter().take_while(|b| matches!(b, b' ' | b'\t')).count()..];
    let body = [&b"\r\n"[..], b"\n", b"\r"].iter().find_map(|end| rest.strip_prefix(*end))?;
    let header = String::from_utf8_lossy(&bytes[..at + END.len()]).replace("\r\n", "\n");
    Some(((header.replace('\r', "\n") + "\n").into_bytes(), body))
}

/// Reads the elements that make up the surface from a file with `body` bytes after its header.
fn read(bytes: &mut &[u8], body: usize, out: &mut Contents) -> Result<(), DeserializeError> {
    let mut file = PlyReader::from_reader(bytes)?;
    out.is_text = file.header().format == PlyFormat::Ascii;
    check(&file.header().elem_defs, out.is_text, body).map_err(wrong)?;
    while let Some(element) = file.current_element() {
        let has = |name: &str| element.has_property(name);
        let corners = has("vertex_indices") || has("vertex_index");
        match &*element.name {
            "vertex" if !["x", "y", "z"].into_iter().all(has) => {
                return Err(wrong("a `vertex` needs the properties x, y and z".into()));
            }
            "vertex" => {
                out.splats = has("f_dc_0") || has("packed_position");
                out.vertices = file.next_element()?;
            }
            "face" if corners => out.polygons = file.next_element()?,
            "tristrips" if corners => out.strips = file.next_element()?,
            _ => drop(file.next_element::<Vec<Unread>>()?),
        }
    }
    Ok(())
}

fn wrong(what: String) -> DeserializeError {
    DeserializeError(std::io::Error::new(ErrorKind::InvalidData, what))
}

/// Checks that the elements of a header fit into the bytes that follow.
fn check(elements: &[ElementDef], is_text: bool, bytes: usize) -> Result<(), String> {
    let size = |kind: ScalarType| match kind {
        // A digit and a space.
        _ if is_text => 2,
        ScalarType::I8 | ScalarType::U8 => 1,
        ScalarType::I16 | ScalarType::U16 => 2,
        ScalarType::I32 | ScalarType::U32 | ScalarType::F32 => 4,
        ScalarType::F64 => 8,
    };
    let mut least = 0usize;
    for e in elements {
        let row: usize = e
            .properties
            .iter()
            .map(|p| match p.property_type {
                PropertyType::Scalar(kind) => size(kind),
                PropertyType::List { count_type, .. } => size(count_type),
            })
            .sum();
        least = least.saturating_add(e.count.saturating_mul(row.max(1)));
        // The last space may be missing.
        if least > bytes + usize::from(is_text) {
            return Err(format!(
                "the header has {} of `{}`, but the file is too short",
                e.count, e.name
            ));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pyramid on a square, of volume 1/3: as text, or binary.
    fn pyramid(format: &str, corner: &str) -> Vec<u8> {
        let little = format.contains("little");
        let mut bytes = format!(
            "ply\nformat {format} 1.0\ncomment caf\u{e9}\nobj_info made by hand\nelement vertex 5\n\
             property float x\nproperty double y\nproperty uchar red\nproperty float z\n\
             element face 5\nproperty uchar flags\nproperty list uchar {corner} vertex_indices\n\
             property list ushort float texcoord\nelement edge 1\nproperty int a\nend_header\n"
        )
        .replace('\u{e9}', "?")
        .into_bytes();
        let at = bytes.iter().position(|b| *b == b'?').unwrap();
        bytes[at] = 0xe9;
        let number = |x: f64, kind: &str| -> Vec<u8> {
            let big = match kind {
                "uchar" => vec![x as u8],
                "ushort" => (x as u16).to_be_bytes().to_vec(),
                "int" => (x as i32).to_be_bytes().to_vec(),
                "float" => (x as f32).to_be_bytes().to_vec(),
                _ => x.to_be_bytes().to_vec(),
            };
            match format {
                "ascii" => format!("{x} ").into_bytes(),
                _ if little => big.into_iter().rev().collect(),
                _ => big,
            }
        };
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.5, 0.5]];
        for (i, [x, y]) in corners.into_iter().enumerate() {
            bytes.extend(number(x, "float"));
            bytes.extend(number(y, "double"));
            bytes.extend(number(255.0, "uchar"));
            bytes.extend(number(f64::from(i == 4), "float"));
        }
        for face in [&[0, 3, 2, 1][..], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4]] {
            bytes.extend(number(0.0, "uchar"));
            bytes.extend(number(face.len() as f64, "uchar"));
            bytes.extend(face.iter().flat_map(|v| number(f64::from(*v), corner)));
            bytes.extend(number(1.0, "ushort"));
            bytes.extend(number(0.5, "float"));
        }
        bytes.extend(number(7.0, "int"));
        bytes
    }

    fn volume(m: &MeshFile) -> f32 {
        let corner = |t: &[u32; 3]| t.map(|v| m.positions[v as usize]);
        m.triangles.iter().map(corner).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
    }

    #[test]
    fn every_encoding_gives_the_same_solid() {
        for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
            for corner in ["uchar", "ushort", "int"] {
                let bytes = pyramid(format, corner);
                let m = MeshFile::read("a.ply", &bytes).unwrap().outward();
                assert_eq!((m.triangles.len(), m.remarks.len()), (6, 0), "{format} {corner}");
                assert!((volume(&m) - 1.0 / 3.0).abs() < 1e-6);
            }
        }
        let text = String::from_utf8_lossy(&pyramid("ascii", "int")).into_owned();
        for end in ["\r\n", "\r"] {
            let m = indexed(text.trim_end().replace('\n', end).as_bytes()).unwrap();
            assert_eq!(m.triangles.len(), 6);
        }
        let strips = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
                      property float z\nelement tristrips 1\nproperty list int int vertex_index\n\
                      end_header\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n8 0 2 1 3 -1 0 3 2";
        let strips = indexed(strips.as_bytes()).unwrap();
        assert_eq!(strips.triangles, [[0, 2, 1], [1, 2, 3], [0, 3, 2]]);
    }

    #[test]
    fn mistakes_are_named() {
        let fails = |bytes: &[u8]| indexed(bytes).unwrap_err().to_string();
        let text = String::from_utf8_lossy(&pyramid("ascii", "int")).into_owned();
        let with = |from: &str, to: &str| fails(text.replacen(from, to, 1).as_bytes());
        assert_eq!(fails(b"ply\nformat ascii 1.0\n"), "the PLY file ends before `end_header`");
        assert_eq!(fails(&text.as_bytes()[..text.len() - 20]), "the PLY file ends too early");
        let many = with("vertex 5", "vertex 999999999999");
        assert!(many.contains("999999999999 of `vertex`, but the file is too short"), "{many}");
        let none = with("element edge 1\nproperty int a", "element nothing 99999999999999");
        assert!(none.contains("of `nothing`"), "{none}");
        assert!(with("float z", "float w").contains("needs the properties x, y and z"));
        assert!(with("float x", "flaot x").starts_with("line 6 of the PLY file: "));
        assert!(with("0 0 255 0", "0 o 255 0").starts_with("line 17 of the PLY file: "));
        assert!(with("0 0 255 0", "nan 0 255 0").contains("not finite, number 0"));
        assert!(with("3 2 1", "3 9 1").contains("vertex 9, but 5 vertices"));
        assert!(with("3 2 1", "3 -1 1").contains("vertex -1"));
        assert!(with("element face", "element faces").contains("it is a cloud of points"));
        let binary = pyramid("binary_little_endian", "int");
        assert_eq!(fails(&binary[..binary.len() - 8]), "the PLY file ends too early");
    }
}
