//! The lists of joints whose order detectors agree on: with them, numbers without names are read.

use super::names::{COCO, MEDIAPIPE};

/// A list of joints, in the order in which a tool or data set writes them.
pub(super) struct JointList {
    /// Its name among people who use it.
    pub name: &'static str,
    parts: &'static [Part],
}

/// Consecutive joints of a list.
enum Part {
    Names(&'static [&'static str]),
    /// The 68 points of a face in the order of iBUG's 300-W (Sagonas et al. 2013), and more, as
    /// OpenPose's two pupils.
    Face(usize),
    /// The 21 points of a hand; the side's prefix.
    Hand(&'static str),
}

use Part::{Face, Hand, Names};

/// Joints of a hand in the common order: its root at the wrist, then four of each finger, from
/// the palm. Each name follows `l_` or `r_`.
pub(super) const HAND: [&str; 21] = [
    "hand",
    "thumb_cmc",
    "thumb_mcp",
    "thumb_ip",
    "thumb_tip",
    "index_mcp",
    "index_pip",
    "index_dip",
    "index_tip",
    "middle_mcp",
    "middle_pip",
    "middle_dip",
    "middle_tip",
    "ring_mcp",
    "ring_pip",
    "ring_dip",
    "ring_tip",
    "pinky_mcp",
    "pinky_pip",
    "pinky_dip",
    "pinky_tip",
];

/// Points of the face that other lists name, too, by their place among the 68.
pub(super) const FACE: [(usize, &str); 6] = [
    (36, "r_eye_outer"),
    (39, "r_eye_inner"),
    (42, "l_eye_inner"),
    (45, "l_eye_outer"),
    (48, "r_mouth"),
    (54, "l_mouth"),
];

/// The feet of OpenPose and COCO-WholeBody.
const FEET: &[&str] = &["l_big_toe", "l_small_toe", "l_heel", "r_big_toe", "r_small_toe", "r_heel"];

/// OpenPose's COCO model. Its neck is the midpoint of the shoulders.
const OPENPOSE: &[&str] = &[
    "nose",
    "mid_shoulder",
    "r_shoulder",
    "r_elbow",
    "r_wrist",
    "l_shoulder",
    "l_elbow",
    "l_wrist",
    "r_hip",
    "r_knee",
    "r_ankle",
    "l_hip",
    "l_knee",
    "l_ankle",
    "r_eye",
    "l_eye",
    "r_ear",
    "l_ear",
];

/// OpenPose's BODY_25 without its feet.
const BODY_19: &[&str] = &[
    "nose",
    "mid_shoulder",
    "r_shoulder",
    "r_elbow",
    "r_wrist",
    "l_shoulder",
    "l_elbow",
    "l_wrist",
    "mid_hip",
    "r_hip",
    "r_knee",
    "r_ankle",
    "l_hip",
    "l_knee",
    "l_ankle",
    "r_eye",
    "l_eye",
    "r_ear",
    "l_ear",
];

/// OpenPose's MPI model.
const MPI: &[&str] = &[
    "head_top",
    "mid_shoulder",
    "r_shoulder",
    "r_elbow",
    "r_wrist",
    "l_shoulder",
    "l_elbow",
    "l_wrist",
    "r_hip",
    "r_knee",
    "r_ankle",
    "l_hip",
    "l_knee",
    "l_ankle",
    "chest",
];

/// MPII Human Pose (Andriluka et al. 2014).
const MPII: &[&str] = &[
    "r_ankle",
    "r_knee",
    "r_hip",
    "l_hip",
    "l_knee",
    "l_ankle",
    "mid_hip",
    "thorax",
    "upper_neck",
    "head_top",
    "r_wrist",
    "r_elbow",
    "r_shoulder",
    "l_shoulder",
    "l_elbow",
    "l_wrist",
];

/// What Halpe Full-Body (Fang et al. 2022) adds to COCO's 17.
const HALPE: &[&str] = &[
    "head_top",
    "neck",
    "mid_hip",
    "l_big_toe",
    "r_big_toe",
    "l_small_toe",
    "r_small_toe",
    "l_heel",
    "r_heel",
];

/// The lists, by the number of their joints; no two have the same.
pub(super) const LISTS: &[JointList] = &[
    JointList { name: "OpenPose MPI", parts: &[Names(MPI)] },
    JointList { name: "MPII", parts: &[Names(MPII)] },
    JointList { name: "COCO", parts: &[Names(&COCO)] },
    JointList { name: "OpenPose COCO", parts: &[Names(OPENPOSE)] },
    JointList { name: "OpenPose BODY_19", parts: &[Names(BODY_19)] },
    JointList { name: "COCO with feet", parts: &[Names(&COCO), Names(FEET)] },
    JointList { name: "OpenPose BODY_25", parts: &[Names(BODY_19), Names(FEET)] },
    JointList { name: "Halpe", parts: &[Names(&COCO), Names(HALPE)] },
    JointList { name: "MediaPipe", parts: &[Names(&MEDIAPIPE)] },
    JointList {
        name: "Halpe without the face",
        parts: &[Names(&COCO), Names(HALPE), Hand("l_"), Hand("r_")],
    },
    JointList {
        name: "COCO-WholeBody",
        parts: &[Names(&COCO), Names(FEET), Face(68), Hand("l_"), Hand("r_")],
    },
    JointList {
        name: "RTMLib in OpenPose's order",
        parts: &[Names(OPENPOSE), Names(FEET), Face(68), Hand("l_"), Hand("r_")],
    },
    JointList {
        name: "Halpe Full-Body",
        parts: &[Names(&COCO), Names(HALPE), Face(68), Hand("l_"), Hand("r_")],
    },
];

/// The parts of a body that tools write in lists of their own.
#[derive(Clone, Copy, Debug)]
pub(super) enum Extra {
    Feet,
    Face,
    LeftHand,
    RightHand,
}

impl Extra {
    /// Returns the names of `count` joints; `None` if the part has another number of them.
    pub fn names(self, count: usize) -> Option<Vec<String>> {
        let part = match self {
            Extra::Feet => Names(FEET),
            // OpenPose adds the pupils to the 68.
            Extra::Face if count == 70 => Face(70),
            Extra::Face => Face(68),
            Extra::LeftHand => Hand("l_"),
            Extra::RightHand => Hand("r_"),
        };
        (part.len() == count).then(|| part.names().collect())
    }
}

impl JointList {
    /// The number of its joints.
    pub fn len(&self) -> usize {
        self.parts.iter().map(Part::len).sum()
    }

    /// The names of its joints, in order.
    pub fn names(&self) -> Vec<String> {
        self.parts.iter().flat_map(Part::names).collect()
    }
}

impl Part {
    fn len(&self) -> usize {
        match self {
            Names(names) => names.len(),
            Face(count) => *count,
            Hand(_) => HAND.len(),
        }
    }

    fn names(&self) -> Box<dyn Iterator<Item = String>> {
        match *self {
            Names(names) => Box::new(names.iter().map(|n| (*n).to_owned())),
            Face(count) => Box::new((0..count).map(face)),
            Hand(side) => Box::new(HAND.iter().map(move |n| format!("{side}{n}"))),
        }
    }
}

/// Returns the name of a point of the face, counted from 0.
pub(super) fn face(i: usize) -> String {
    let named = FACE.iter().find(|(at, _)| *at == i);
    named.map_or_else(|| format!("face_{i}"), |(_, name)| (*name).to_owned())
}

/// Returns the names of joints that have none in their file, by their number.
pub(super) fn by_count(count: usize) -> Option<Vec<String>> {
    LISTS.iter().find(|l| l.len() == count).map(JointList::names)
}

/// Returns the lists and their numbers of joints, for messages.
pub(super) fn known() -> String {
    let each: Vec<String> = LISTS.iter().map(|l| format!("{} {}", l.len(), l.name)).collect();
    each.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vision::keypoints::names::well_known;

    #[test]
    fn counts_and_names_of_lists_are_unique() {
        let counts: Vec<usize> = LISTS.iter().map(JointList::len).collect();
        assert_eq!(counts, [15, 16, 17, 18, 19, 23, 25, 26, 33, 68, 133, 134, 136]);
        for list in LISTS {
            let mut names = list.names();
            assert!(names.iter().all(|n| well_known(n)), "{}: {names:?}", list.name);
            names.sort();
            names.dedup();
            assert_eq!(names.len(), list.len(), "{}", list.name);
        }
    }

    /// Places from the tools' own documents.
    #[test]
    fn joints_are_where_their_tools_say() {
        for (count, at, name) in [
            (25, 8, "mid_hip"),
            (25, 11, "r_ankle"),
            (25, 19, "l_big_toe"),
            (25, 24, "r_heel"),
            (18, 8, "r_hip"),
            (26, 17, "head_top"),
            (26, 21, "r_big_toe"),
            (133, 17, "l_big_toe"),
            (133, 71, "r_mouth"),
            (133, 91, "l_hand"),
            (133, 112, "r_hand"),
            (133, 132, "r_pinky_tip"),
            (134, 24, "face_0"),
            (136, 26, "face_0"),
            (136, 94, "l_hand"),
            (136, 115, "r_hand"),
            (68, 47, "r_hand"),
        ] {
            assert_eq!(by_count(count).unwrap()[at], name, "{count}");
        }
        assert!(by_count(14).is_none());
        assert_eq!(Extra::Face.names(70).unwrap()[69], "face_69");
        assert!(Extra::Feet.names(5).is_none() && Extra::LeftHand.names(21).is_some());
    }
}
