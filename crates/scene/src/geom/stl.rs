//! Reads STL (3D Systems, StereoLithography Interface Specification): triangles, binary or as
//! text. Normals and colours are ignored. The unit is not in the file; most are in millimetres.
//!
//! The crate `stl_io` takes every file that begins with `solid ` for text, and no text whose
//! first line is `solid` alone or whose normals are not numbers; real files have all three.

use super::mesh::{MOST_PARTS, MOST_TRIANGLES};
use super::mesh_file::MeshFile;
use super::polygon::{Cutter, MOST_CORNERS};
use super::{GeomError, weld};
use glam::Vec3;
use indexmap::IndexSet;
use std::sync::Arc;

/// The bytes before the triangles of a binary file: a comment of 80, and their number.
const HEAD: usize = 84;
/// The bytes of a triangle: its normal, three corners, and two bytes without a meaning.
const TRIANGLE: usize = 50;

/// True if a file is as long as a binary STL file says that it is.
pub(super) fn is_binary(bytes: &[u8]) -> bool {
    count(bytes).is_some_and(|n| n > 0 && bytes.len() == HEAD + n * TRIANGLE)
}

/// The number of triangles that a binary file says it has.
fn count(bytes: &[u8]) -> Option<usize> {
    let four: [u8; 4] = bytes.get(HEAD - 4..HEAD)?.try_into().ok()?;
    usize::try_from(u32::from_le_bytes(four)).ok()
}

/// Reads the triangles of a file; equal corners are one vertex. Each `solid` of a text is a part
/// with its name.
///
/// # Errors
/// [`GeomError::Invalid`]: a file that ends too early; a coordinate that is not finite; a text
/// whose facets are not written as such, with the line; no triangles, or more than five million.
pub fn indexed(bytes: &[u8]) -> Result<MeshFile, GeomError> {
    let first_word = bytes.trim_ascii_start().get(..5).unwrap_or_default();
    let is_text =
        first_word.eq_ignore_ascii_case(b"solid") && !bytes.iter().take(1 << 12).any(|b| *b == 0);
    let mut out = if is_text && !is_binary(bytes) {
        text(&String::from_utf8_lossy(bytes))?
    } else {
        binary(bytes)?
    };
    if out.triangles.is_empty() {
        return Err(GeomError::invalid("the STL file has no triangles"));
    }
    let first = weld(&out.positions);
    out.triangles.iter_mut().for_each(|t| *t = t.map(|v| first[v as usize]));
    Ok(out)
}

fn too_many() -> GeomError {
    GeomError::invalid(format!("the STL file has more than {MOST_TRIANGLES} triangles"))
}

fn binary(bytes: &[u8]) -> Result<MeshFile, GeomError> {
    let n = count(bytes).ok_or_else(|| GeomError::invalid("the STL file ends in its header"))?;
    let triangles = bytes.get(HEAD..).unwrap_or_default();
    let complete = triangles.len() / TRIANGLE;
    if complete < n {
        return Err(GeomError::invalid(format!(
            "the STL file ends too early: it says that it has {n} triangles, and has {complete}"
        )));
    }
    if n > MOST_TRIANGLES {
        return Err(too_many());
    }
    let mut out = MeshFile { part_names: vec![Arc::from("")], ..MeshFile::default() };
    for (i, t) in triangles.chunks_exact(TRIANGLE).take(n).enumerate() {
        let (numbers, _) = t[12..48].as_chunks::<4>();
        let x: Vec<f32> = numbers.iter().map(|b| f32::from_le_bytes(*b)).collect();
        out.positions.extend(x.chunks_exact(3).map(Vec3::from_slice));
        if !x.iter().all(|x| x.is_finite()) {
            return Err(GeomError::invalid(format!(
                "triangle {} of the STL file has a coordinate that is not finite",
                i + 1
            )));
        }
        out.triangles.push([0, 1, 2].map(|k| 3 * i as u32 + k));
    }
    out.parts = vec![0; n];
    Ok(out)
}

fn text(text: &str) -> Result<MeshFile, GeomError> {
    let (mut out, mut cutter) = (MeshFile::default(), Cutter::default());
    let (mut names, mut part) = (IndexSet::<Arc<str>>::new(), 0);
    let mut corners: Vec<u32> = Vec::new();
    // A file that was cut off is text, too.
    let mut ended = true;
    for (i, line) in text.lines().enumerate() {
        let at = |what: &str| GeomError::invalid(format!("line {} of the STL file: {what}", i + 1));
        let mut words = line.split_whitespace();
        let word = words.next().unwrap_or_default().to_ascii_lowercase();
        ended = word == "endsolid" || word.is_empty() && ended;
        match &*word {
            "vertex" => {
                let mut number = || words.next().and_then(|w| w.parse::<f32>().ok());
                let p = number().zip(number()).zip(number()).map(|((x, y), z)| Vec3::new(x, y, z));
                let p = p.filter(|p| p.is_finite() && corners.len() < MOST_CORNERS);
                let p = p.ok_or_else(|| at("a vertex must be three finite numbers"))?;
                corners.push(out.positions.len() as u32);
                out.positions.push(p);
            }
            "endloop" if corners.len() < 3 => return Err(at("a facet needs three vertices")),
            "endloop" => {
                cutter.cut(&out.positions, &corners, &mut out.triangles);
                corners.clear();
                if out.triangles.len() > MOST_TRIANGLES {
                    return Err(too_many());
                }
                out.parts.resize(out.triangles.len(), part);
            }
            "solid" => {
                let name = line.trim_start().get(5..).unwrap_or_default().trim();
                let number = names.insert_full(Arc::from(name)).0;
                if number >= MOST_PARTS {
                    return Err(at(&format!("more than {MOST_PARTS} solids")));
                }
                part = number as u16;
            }
            "" | "facet" | "outer" | "endfacet" | "endsolid" | "color" => {}
            _ => return Err(at("expected `facet`, `vertex x y z` or `endsolid`")),
        }
    }
    if !ended {
        return Err(GeomError::invalid("the STL file ends too early, without `endsolid`"));
    }
    out.part_names = names.into_iter().collect();
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tetrahedron of volume 1/6: its corners, and its faces.
    const CORNERS: [[f32; 3]; 4] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    const FACES: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];

    fn binary_file(header: &[u8]) -> Vec<u8> {
        let mut bytes = header.to_vec();
        bytes.resize(80, b' ');
        bytes.extend(4u32.to_le_bytes());
        for f in FACES {
            let numbers = [[f32::NAN; 3]].into_iter().chain(f.map(|v| CORNERS[v]));
            bytes.extend(numbers.flatten().flat_map(f32::to_le_bytes));
            bytes.extend([7, 1]);
        }
        bytes
    }

    fn text_file() -> String {
        let facet = |f: [usize; 3]| {
            let vertex = f.map(|v| CORNERS[v].map(|x| format!("{x:e}")).join(" "));
            format!(
                "facet normal -nan(ind) 0 0\n outer loop\n  vertex {}\n endloop\nendfacet\n",
                vertex.join("\n  vertex ")
            )
        };
        format!("solid\n{}endsolid\n", FACES.map(facet).concat())
    }

    #[test]
    fn binary_and_text_are_the_same_solid() {
        let named = text_file().replace("solid\n", "solid a cone\r\n");
        let shouted = text_file().to_uppercase().replace("-NAN(IND)", "0");
        let all = [
            binary_file(b"made by hand"),
            binary_file(b"solid made by a tool\n facet"),
            [binary_file(b"solid"), vec![0; 9]].concat(),
            text_file().into_bytes(),
            named.into_bytes(),
            shouted.into_bytes(),
        ];
        for bytes in all {
            let m = MeshFile::read("a.stl", &bytes).unwrap().outward();
            assert_eq!((m.triangles.len(), m.remarks.len()), (4, 0));
            let edges = m.mesh().unwrap().topology.edges.clone();
            assert!(edges.len() == 6 && !edges.open(), "corners are shared");
        }
        let two = text_file().replace("solid\n", "solid a\n") + &text_file();
        assert_eq!(indexed(two.as_bytes()).unwrap().part_names, ["a".into(), "".into()]);
    }

    #[test]
    fn mistakes_are_named() {
        let fails = |bytes: &[u8]| indexed(bytes).unwrap_err().to_string();
        let whole = binary_file(b"x");
        assert_eq!(
            fails(&whole[..200]),
            "the STL file ends too early: it says that it has 4 triangles, and has 2"
        );
        assert_eq!(fails(&whole[..50]), "the STL file ends in its header");
        assert_eq!(fails(&[0; 84]), "the STL file has no triangles");
        let mut huge = whole.clone();
        huge[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
        assert!(fails(&huge).contains("4294967295 triangles, and has 4"));
        let mut nan = whole;
        nan[100..104].copy_from_slice(&f32::NAN.to_le_bytes());
        assert!(fails(&nan).starts_with("triangle 1 of the STL file has a coordinate"));
        assert!(fails(b"solid\nvertex 1 2\n").starts_with("line 2 of the STL file: a vertex"));
        assert!(fails(b"solid\nvertices\n").starts_with("line 2 of the STL file: expected"));
        assert!(fails(b"solid\nendloop\n").contains("three vertices"));
        let whole = text_file();
        let lines: Vec<&str> = whole.lines().collect();
        for cut in 2..lines.len() {
            assert!(fails(lines[..cut].join("\n").as_bytes()).contains("ends too early"), "{cut}");
        }
    }
}
