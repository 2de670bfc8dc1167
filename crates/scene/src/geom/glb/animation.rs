//! Several states of a scene as one animation, by moving vertices.

use super::channels::Animation;
use super::document::Document;
use super::morphs;
use crate::geom::{GeomError, Solid};

/// How long the last state is shown before the first, in seconds, and the time of the cut.
const OPENING: f64 = 1.0;
const CUT: f64 = 1e-3;

/// Returns the bytes of a `.glb` file that plays states one after another, `seconds`
/// apart. It opens with the last of them for a second, which is also what it shows at rest:
/// programs that import an animation stop at its beginning. Vertices move by morph targets; where
/// the triangles change between two states, one mesh is replaced by another.
///
/// # Errors
/// If there are no states, or one has no mesh.
pub fn write_animation(states: &[Solid], seconds: f64) -> Result<Vec<u8>, GeomError> {
    if states.is_empty() {
        return Err(GeomError::domain("there are no states to animate"));
    }
    let mut d = Document::default();
    let last = states.len() - 1;
    let way = (0..=last).map(|i| (i, OPENING + i as f64 * seconds));
    let (shown, times): (Vec<usize>, Vec<f64>) =
        [(last, 0.0), (last, OPENING - CUT)].into_iter().chain(way).unzip();
    let times: Vec<f32> = times.into_iter().map(|t| t as f32).collect();
    let mut animation = Animation::at(d.numbers(&times));
    morphs::add(&mut d, &mut animation, states, &shown)?;
    d.animation(animation.finish());
    Ok(d.finish())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Affine, cuboid, sphere};
    use glam::{DVec3, Vec3};
    use serde_json::{Value, json};
    use std::sync::Arc;

    fn json_of(glb: &[u8]) -> Value {
        let length = u32::from_le_bytes([glb[12], glb[13], glb[14], glb[15]]) as usize;
        serde_json::from_slice(&glb[20..20 + length]).unwrap()
    }

    /// The numbers of an accessor.
    fn floats(glb: &[u8], document: &Value, accessor: &Value, per: usize) -> Vec<f32> {
        let a = &document["accessors"][accessor.as_u64().unwrap() as usize];
        let view = &document["bufferViews"][a["bufferView"].as_u64().unwrap() as usize];
        let json = u32::from_le_bytes([glb[12], glb[13], glb[14], glb[15]]) as usize;
        let at = 28 + json + view["byteOffset"].as_u64().unwrap() as usize;
        let count = a["count"].as_u64().unwrap() as usize * per;
        glb[at..at + 4 * count]
            .chunks_exact(4)
            .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
            .collect()
    }

    #[test]
    fn moving_vertices_are_morph_targets() {
        let ball = Solid::new(Arc::new(sphere(1.0, 8).unwrap()));
        let by = |x: f64| ball.placed(Affine::new(DVec3::X * x, DVec3::ZERO, DVec3::ONE));
        let glb = write_animation(&[by(0.0), by(1.0), by(3.0)], 0.5).unwrap();
        let d = json_of(&glb);
        let targets = d["meshes"][0]["primitives"][0]["targets"].as_array().unwrap();
        assert_eq!((targets.len(), d["nodes"].as_array().unwrap().len()), (2, 1));
        // From the last state, which is shown at rest.
        let moved = floats(&glb, &d, &targets[1]["POSITION"], 3);
        assert!(moved.chunks_exact(3).all(|v| Vec3::from_slice(v).distance(-3.0 * Vec3::X) < 1e-5));
        let base = &d["meshes"][0]["primitives"][0]["attributes"]["POSITION"];
        let rest = floats(&glb, &d, base, 3);
        let centre = rest.chunks_exact(3).map(|v| v[0]).sum::<f32>() / (rest.len() / 3) as f32;
        assert!((centre - 3.0).abs() < 1e-4 && d["meshes"][0]["weights"] == json!([0.0, 0.0]));
        let sampler = &d["animations"][0]["samplers"][0];
        assert_eq!(floats(&glb, &d, &sampler["input"], 1), [0.0, 0.999, 1.0, 1.5, 2.0]);
        assert_eq!(
            floats(&glb, &d, &sampler["output"], 1),
            [[0.0, 0.0], [0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.0, 0.0],].concat()
        );
    }

    #[test]
    fn other_triangles_are_another_mesh() {
        let ball = Solid::new(Arc::new(sphere(1.0, 8).unwrap()));
        let cube = Solid::new(Arc::new(cuboid(DVec3::ONE).unwrap()));
        let glb = write_animation(&[ball.clone(), cube, ball.clone()], 1.0).unwrap();
        let d = json_of(&glb);
        assert_eq!(d["meshes"].as_array().unwrap().len(), 2);
        let shown = |node: u64| {
            let all = d["animations"][0]["channels"].as_array().unwrap();
            let of = |c: &&Value| c["target"]["node"] == node && c["target"]["path"] == "scale";
            let at = all.iter().find(of).unwrap()["sampler"].as_u64().unwrap() as usize;
            let output = &d["animations"][0]["samplers"][at]["output"];
            floats(&glb, &d, output, 3).iter().step_by(3).copied().collect::<Vec<_>>()
        };
        assert_eq!(
            (shown(0), shown(1)),
            (vec![1.0, 1.0, 1.0, 0.0, 1.0], vec![0.0, 0.0, 0.0, 1.0, 0.0])
        );
        assert_eq!(
            (&d["nodes"][0]["scale"], &d["nodes"][1]["scale"]),
            (&json!([1, 1, 1]), &json!([0, 0, 0]))
        );
        assert_eq!(d["nodes"][1]["name"], "object_earlier_1");
        let pair = Solid::named_group(&[ball.clone(), ball], vec!["a".into(), "b".into()]);
        let d = json_of(&write_animation(&[pair.clone(), pair], 1.0).unwrap());
        assert_eq!((&d["nodes"][0]["name"], &d["meshes"][1]["name"]), (&json!("a"), &json!("b")));
        assert!(write_animation(&[], 1.0).is_err());
    }
}
