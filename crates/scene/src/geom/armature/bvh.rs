//! Writes skeletons in poses as BVH files (Biovision Hierarchy, as described in M. Meredith and
//! S. Maddock 2001, "Motion capture file formats explained", University of Sheffield CS-01-11).
//!
//! Rotations are degrees in the order of the channels, Rz Rx Ry, about the axes that the
//! skeleton has at rest, which are the world's. Only roots have positions: where a pose moves a
//! joint in its parent's frame, by a handle or a scale, that is in the offsets of the first
//! frame. BVH has no scales.

use super::Bone;
use glam::{DMat3, DVec3};
use std::collections::BTreeSet;
use std::fmt::Write;

/// The name of the root of a file whose skeleton has several.
const ROOT: &str = "scene_root";

/// What the writer of the hierarchy has before it.
enum Next {
    Joint(usize),
    Close,
}

/// Returns the text of a file that shows a skeleton in one pose after another, `seconds` apart.
/// All frames have the joints of the first, in rig order; its bones are those of the file.
pub fn write(frames: &[Vec<Bone>], seconds: f64) -> String {
    let Some(first) = frames.first() else { return String::new() };
    let names = names(first);
    let mut children: Vec<Vec<usize>> = vec![Vec::new(); first.len()];
    let mut roots = Vec::new();
    for (i, bone) in first.iter().enumerate() {
        match bone.parent {
            Some(p) => children[p].push(i),
            None => roots.push(i),
        }
    }
    let mut s = String::from("HIERARCHY\n");
    let (mut order, mut depth) = (Vec::with_capacity(first.len()), 0);
    let several = roots.len() > 1;
    if several {
        let _ = writeln!(s, "ROOT {ROOT}\n{{\n\tOFFSET 0 0 0\n\tCHANNELS 6 {POSITION} {ROTATION}");
        depth = 1;
    }
    let mut next: Vec<Next> = roots.into_iter().rev().map(Next::Joint).collect();
    while let Some(step) = next.pop() {
        let Next::Joint(i) = step else {
            depth -= 1;
            let _ = writeln!(s, "{}}}", Tabs(depth));
            continue;
        };
        let (bone, tabs) = (&first[i], Tabs(depth));
        // The position of the only root is in the frames.
        let (kind, offset, channels) = match bone.parent.is_none() && !several {
            true => ("ROOT", DVec3::ZERO, format!("6 {POSITION} {ROTATION}")),
            false => ("JOINT", bone.offset, format!("3 {ROTATION}")),
        };
        let _ = writeln!(s, "{tabs}{kind} {}\n{tabs}{{", names[i]);
        let _ = writeln!(s, "{tabs}\tOFFSET {}\n{tabs}\tCHANNELS {channels}", three(offset));
        if children[i].is_empty() {
            let _ = writeln!(s, "{tabs}\tEnd Site\n{tabs}\t{{");
            let _ = writeln!(s, "{tabs}\t\tOFFSET {}\n{tabs}\t}}", three(bone.end));
        }
        depth += 1;
        next.push(Next::Close);
        next.extend(children[i].iter().rev().map(|c| Next::Joint(*c)));
        order.push(i);
    }
    if several {
        s.push_str("}\n");
    }
    let _ = writeln!(s, "MOTION\nFrames: {}\nFrame Time: {}", frames.len(), number(seconds));
    for bones in frames {
        let mut line = if several { "0 0 0 0 0 0".to_owned() } else { String::new() };
        for bone in order.iter().filter_map(|i| bones.get(*i)) {
            if bone.parent.is_none() && !several {
                line += &three(bone.head);
            }
            let _ = write!(line, " {}", three(degrees(bone.local)));
        }
        let _ = writeln!(s, "{}", line.trim_start());
    }
    s
}

const POSITION: &str = "Xposition Yposition Zposition";
const ROTATION: &str = "Zrotation Xrotation Yrotation";

/// An indentation.
#[derive(Clone, Copy)]
struct Tabs(usize);

impl std::fmt::Display for Tabs {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // Deep trees would be mostly indentation.
        (0..self.0.min(32)).try_for_each(|_| f.write_char('\t'))
    }
}

/// Returns a name of one word for each joint; they differ, as those of the joints.
fn names(bones: &[Bone]) -> Vec<String> {
    let word = |bone: &Bone| -> String {
        let apart = |c: char| c.is_whitespace() || c.is_control() || matches!(c, '{' | '}');
        let word: String = bone.name.chars().map(|c| if apart(c) { '_' } else { c }).collect();
        if word.is_empty() { "joint".to_owned() } else { word }
    };
    let mut used = BTreeSet::new();
    let mut distinct = |name: String| {
        let tries = (2..).map(|n| format!("{name}_{n}"));
        let free = std::iter::once(name.clone()).chain(tries).find(|n| !used.contains(n));
        let name = free.unwrap_or(name);
        used.insert(name.clone());
        name
    };
    bones.iter().map(|bone| distinct(word(bone))).collect()
}

/// Returns the angles about z, x and y, in degrees, of Rz Rx Ry.
fn degrees(m: DMat3) -> DVec3 {
    let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis];
    let about_z = libm::atan2(-y.x, y.y);
    let about_x = libm::atan2(y.z, libm::hypot(y.x, y.y));
    // From what is left, so that it fits the angle about z even where that is not determined.
    let (s, c) = (libm::sin(about_z), libm::cos(about_z));
    let about_y = libm::atan2(c * z.x + s * z.y, c * x.x + s * x.y);
    DVec3::new(about_z, about_x, about_y) * (180.0 / std::f64::consts::PI)
}

fn three(v: DVec3) -> String {
    // What rounding leaves of a zero.
    let least = 1e-12 * v.abs().max_element();
    let [x, y, z] = v.to_array().map(|x| number(if x.abs() > least { x } else { 0.0 }));
    format!("{x} {y} {z}")
}

/// Ten significant digits without an exponent, which some readers do not know.
fn number(x: f64) -> String {
    let rounded: f64 = format!("{x:.9e}").parse().unwrap_or(0.0);
    // Also without the sign of zero.
    format!("{}", if rounded.is_finite() { rounded + 0.0 } else { 0.0 })
}

#[cfg(test)]
#[path = "bvh_tests.rs"]
mod tests;
