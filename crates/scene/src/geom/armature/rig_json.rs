//! Rig and morph files: JSON beside an OBJ mesh.
//!
//! `{"mesh": "body.obj", "morphs": "body.morphs.json", "joints": [{"name", "parent", "head", "tail"}], "weights": [[[joint, weight], …] by vertex], "keypoints": {name: {"joint", "rest"}}}`;
//! `morphs`, `keypoints` and `tail` are optional. `weights` refer to joints by index, in
//! the order of `joints`. Other fields are ignored.

use super::{Influence, MOST_WEIGHTS, Morph, NamedJoint, Rig};
use crate::geom::GeomError;
use glam::DVec3;
use indexmap::IndexMap;
use serde::Deserialize;

/// The contents of a rig file, checked, without the mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct RigFile {
    /// The rig.
    pub rig: Rig,
    /// The path of the mesh's file, relative to the rig's.
    pub mesh: String,
    /// The path of the morphs' file, relative to the rig's.
    pub morphs: Option<String>,
    /// The joints that move each vertex.
    pub influences: Vec<Influence>,
}

#[derive(Deserialize)]
struct JsonRig {
    mesh: String,
    morphs: Option<String>,
    joints: Vec<JsonJoint>,
    weights: Vec<Vec<(usize, f32)>>,
    #[serde(default)]
    keypoints: IndexMap<String, JsonKeypoint>,
}

#[derive(Deserialize)]
struct JsonJoint {
    name: String,
    #[serde(default)]
    parent: Option<String>,
    head: [f64; 3],
    tail: Option<[f64; 3]>,
}

#[derive(Deserialize)]
struct JsonKeypoint {
    joint: String,
    rest: [f64; 3],
}

#[derive(Deserialize)]
struct JsonMorphs {
    morphs: IndexMap<String, JsonMorph>,
}

#[derive(Deserialize)]
struct JsonMorph {
    vertices: Vec<[f32; 3]>,
    heads: Vec<[f64; 3]>,
    tails: Vec<[f64; 3]>,
}

fn read<'a, T: Deserialize<'a>>(bytes: &'a [u8], what: &str) -> Result<T, GeomError> {
    serde_json::from_slice(bytes)
        .map_err(|e| GeomError::invalid(format!("cannot read the {what} file: {e}")))
}

/// Reads a rig file.
///
/// # Errors
/// Invalid JSON or fields; a rig that [`Rig::new`] refuses; a vertex without weights, or
/// with more than [`MOST_WEIGHTS`]; a joint index that does not exist.
pub fn rig_from_json(bytes: &[u8]) -> Result<RigFile, GeomError> {
    let file: JsonRig = read(bytes, "rig")?;
    let count = file.joints.len();
    let joints = file.joints.into_iter().map(|j| NamedJoint {
        name: j.name,
        parent: j.parent,
        head: j.head.into(),
        tail: j.tail.unwrap_or(j.head).into(),
    });
    let keypoints =
        file.keypoints.into_iter().map(|(name, k)| (name, k.joint, DVec3::from(k.rest)));
    let rig = Rig::new(joints.collect())?.with_keypoints(keypoints.collect())?;
    let influence = |(v, weights): (usize, &Vec<(usize, f32)>)| {
        let mut i = Influence::default();
        if weights.is_empty() {
            return Err(GeomError::invalid(format!(
                "vertex {v} has no skin weight, so no joint would move it"
            )));
        }
        if weights.len() > MOST_WEIGHTS {
            let n = weights.len();
            return Err(GeomError::invalid(format!(
                "vertex {v} has {n} skin weights; at most {MOST_WEIGHTS} are supported"
            )));
        }
        // Heaviest first, so that joints with weight 0 come last.
        let mut weights = weights.clone();
        weights.sort_by(|a, b| b.1.total_cmp(&a.1));
        for (k, (joint, weight)) in weights.iter().enumerate() {
            let placed = rig.placed(*joint).and_then(|j| u16::try_from(j).ok());
            let missing = || {
                GeomError::invalid(format!(
                    "vertex {v} is moved by joint {joint}, but the rig has {count} joints"
                ))
            };
            (i.joints[k], i.weights[k]) = (placed.ok_or_else(missing)?, *weight);
        }
        Ok(i)
    };
    let influences =
        file.weights.iter().enumerate().map(influence).collect::<Result<Vec<_>, _>>()?;
    Ok(RigFile { rig, mesh: file.mesh, morphs: file.morphs, influences })
}

/// Reads a file of morphs for a rig. The file lists joints in the order of the rig's
/// file.
///
/// # Errors
/// Invalid JSON or fields; a number of joints that differs from the rig's.
pub fn morphs_from_json(bytes: &[u8], rig: &Rig) -> Result<Vec<Morph>, GeomError> {
    let file: JsonMorphs = read(bytes, "morphs")?;
    let count = rig.joints().len();
    let by_rig = |name: &str, given: &[[f64; 3]]| {
        if given.len() != count {
            let n = given.len();
            return Err(GeomError::invalid(format!(
                "the morph `{name}` moves {n} joints; the rig has {count}"
            )));
        }
        let mut out = vec![DVec3::ZERO; count];
        for (i, d) in given.iter().enumerate() {
            if let Some(j) = rig.placed(i) {
                out[j] = DVec3::from(*d);
            }
        }
        Ok(out)
    };
    let one = |(name, m): (String, JsonMorph)| {
        Ok(Morph {
            weight: 0.0,
            vertices: m.vertices,
            heads: by_rig(&name, &m.heads)?,
            tails: by_rig(&name, &m.tails)?,
            name: name.into(),
        })
    };
    file.morphs.into_iter().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rig(weights: &str, more: &str) -> Result<RigFile, GeomError> {
        rig_from_json(
            format!(
                r#"{{"mesh": "a.obj", "joints": [{{"name": "b", "parent": "a", "head": [0, 1, 0]}},
                {{"name": "a", "parent": null, "head": [0, 0, 0], "tail": [0, 1, 0]}}], "weights": {weights}{more}}}"#
            )
            .as_bytes(),
        )
    }

    #[test]
    fn joints_are_numbered_as_in_the_file() {
        let f = rig(
            "[[[0, 0.25], [1, 0.75]], [[0, 1]]]",
            r#", "keypoints": {"k": {"joint": "b", "rest": [1, 2, 3]}}"#,
        );
        let f = f.unwrap();
        assert_eq!(
            f.influences[0].joints[..2],
            [0, 1],
            "rig order has a first, and the heavier joint comes first"
        );
        assert_eq!(f.influences[0].weights, [0.75, 0.25, 0.0, 0.0]);
        assert_eq!(f.influences[1].joints[0], 1);
        assert_eq!(
            (f.rig.keypoints()[0].joint, f.rig.keypoints()[0].rest),
            (1, DVec3::new(1.0, 2.0, 3.0))
        );
        let m = r#"{"morphs": {"tall": {"vertices": [[0, 1, 0]], "heads": [[0, 1, 0], [0, 2, 0]], "tails": [[0, 0, 0], [0, 3, 0]]}}}"#;
        let m = morphs_from_json(m.as_bytes(), &f.rig).unwrap();
        assert_eq!((m[0].heads[0].y, m[0].heads[1].y, m[0].tails[0].y), (2.0, 1.0, 3.0));
    }

    #[test]
    fn what_is_wrong_is_said() {
        let e = |weights: &str| rig(weights, "").unwrap_err().to_string();
        assert_eq!(e("[[[0, 1]], []]"), "vertex 1 has no skin weight, so no joint would move it");
        assert_eq!(e("[[[2, 1]]]"), "vertex 0 is moved by joint 2, but the rig has 2 joints");
        assert!(
            e("[[[0, 0.2], [0, 0.2], [0, 0.2], [0, 0.2], [0, 0.2]]]")
                .starts_with("vertex 0 has 5 skin weights")
        );
        assert!(e("7").starts_with("cannot read the rig file: invalid type: integer `7`"));
        assert!(rig_from_json(b"{").is_err());
    }
}
