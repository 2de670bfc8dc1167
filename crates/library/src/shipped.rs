//! The programs that come with the binary, and the files that they read.

use pcadlang_engine::lang::load::{Shipped, shipped_file, shipped_programs};
use pcadlang_engine::lang::reach::Reach;

/// The shipped files, by the name that a user gives.
static FILES: Shipped = &[
    ("coin.pcad", include_str!("../../../programs/coin.pcad")),
    ("linreg.pcad", include_str!("../../../programs/linreg.pcad")),
    ("linreg.settings.json", include_str!("../../../programs/linreg.settings.json")),
    ("mixture.pcad", include_str!("../../../programs/mixture.pcad")),
    ("crp.pcad", include_str!("../../../programs/crp.pcad")),
    ("geometric.pcad", include_str!("../../../programs/geometric.pcad")),
    ("human.pcad", include_str!("../../../programs/human.pcad")),
    ("human.quality.json", include_str!("../../../programs/human.quality.json")),
    ("human.settings.json", include_str!("../../../programs/human.settings.json")),
    ("human_kth.pcad", include_str!("../../../programs/human_kth.pcad")),
    ("human_paper.pcad", include_str!("../../../programs/human_paper.pcad")),
    ("people.pcad", include_str!("../../../programs/people.pcad")),
    ("autorig.pcad", include_str!("../../../programs/autorig.pcad")),
    ("lathe.pcad", include_str!("../../../programs/lathe.pcad")),
    ("lathe.quality.json", include_str!("../../../programs/lathe.quality.json")),
    ("lathe.settings.json", include_str!("../../../programs/lathe.settings.json")),
    ("lathe_parts.pcad", include_str!("../../../programs/lathe_parts.pcad")),
    ("lathe_paper.pcad", include_str!("../../../programs/lathe_paper.pcad")),
    ("scene.pcad", include_str!("../../../programs/scene.pcad")),
    ("table.pcad", include_str!("../../../programs/table.pcad")),
    ("std/scene.pcad", include_str!("../../../programs/std/scene.pcad")),
    ("std/ends.pcad", include_str!("../../../programs/std/ends.pcad")),
    ("std/revolution.pcad", include_str!("../../../programs/std/revolution.pcad")),
    ("std/people.pcad", include_str!("../../../programs/std/people.pcad")),
    ("std/human/human.obj", include_str!("../../../programs/std/human/human.obj")),
    ("std/human/human.rig.json", include_str!("../../../programs/std/human/human.rig.json")),
    ("std/human/human.morphs.json", include_str!("../../../programs/std/human/human.morphs.json")),
    ("std/human/human.lod1.obj", include_str!("../../../programs/std/human/human.lod1.obj")),
    (
        "std/human/human.lod1.rig.json",
        include_str!("../../../programs/std/human/human.lod1.rig.json"),
    ),
    (
        "std/human/human.lod1.morphs.json",
        include_str!("../../../programs/std/human/human.lod1.morphs.json"),
    ),
    ("std/human/human.lod2.obj", include_str!("../../../programs/std/human/human.lod2.obj")),
    (
        "std/human/human.lod2.rig.json",
        include_str!("../../../programs/std/human/human.lod2.rig.json"),
    ),
    (
        "std/human/human.lod2.morphs.json",
        include_str!("../../../programs/std/human/human.lod2.morphs.json"),
    ),
    ("std/human/pose_prior.json", include_str!("../../../programs/std/human/pose_prior.json")),
    ("data/dog.obj", include_str!("../../../programs/data/dog.obj")),
    ("data/line.csv", include_str!("../../../programs/data/line.csv")),
    ("data/groups.csv", include_str!("../../../programs/data/groups.csv")),
];

/// Returns a shipped file.
pub fn file(name: &str) -> Option<&'static str> {
    shipped_file(FILES, name)
}

/// Returns the names of the shipped programs.
pub fn programs() -> impl Iterator<Item = &'static str> {
    shipped_programs(FILES)
}

/// Returns the reach of a program that may read shipped files only.
pub fn reach() -> Reach {
    Reach::shipping(FILES)
}
