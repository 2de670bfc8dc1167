//! An example for every built-in of the scene.

use pcadlang_engine::lang::builtins::Row;

/// A program with a ball, after `$data` and before an observation.
macro_rules! seen {
    ($data:literal, $observe:literal) => {
        concat!(
            $data,
            "\nassume r ~ uniform(0.5, 1.5);\nlet view = scene.render(scene.sphere(r));\n",
            $observe
        )
    };
}

/// A program with the shipped body.
macro_rules! body {
    ($rest:literal) => {
        concat!("data body = armature(\"std/human/human.lod2.rig.json\");\n", $rest)
    };
}

const EXAMPLES: &[(&str, &str)] = &[
    ("image", "data photo = image(\"ball.png\");\nlet wide = photo.width;"),
    ("contours", "data edges = contours(\"contours.png\");\nlet wide = edges.width;"),
    (
        "mask",
        "\
data seen = mask(\"mask.png\");
assume r ~ uniform(0.5, 1.5);
observe scene.mask(scene.render(scene.sphere(r)), size = 32) = seen as outline;",
    ),
    (
        "depth",
        "\
data seen = depth(\"depth.npy\");
assume r ~ uniform(0.5, 1.5);
observe scene.depth(scene.render(scene.sphere(r)), size = 32) = seen as distance;",
    ),
    (
        "camera",
        "\
data taken = camera(\"transforms.json#ball\");
data seen = mask(\"mask.png\");
assume r ~ uniform(0.5, 1.5);
observe scene.mask(scene.render(scene.sphere(r), camera = taken), size = 32) = seen as outline;",
    ),
    (
        "armature",
        "data body = armature(\"std/human/human.lod2.rig.json\");\nlet n = len(body.joints);",
    ),
    (
        "detector",
        "data photo = image(\"ball.png\");\ndata trees = detector(\"model.yml.gz\");\nlet found = scene.edges(photo, detector = trees);",
    ),
    ("keypoints", "data points = keypoints(\"person.json\");\nlet n = points.count;"),
    ("mesh", "data dog = mesh(\"data/dog.obj\");\nlet view = scene.render(dog);"),
    ("scene.lathe", "scene.lathe({ y: [0, 1, 2], r: [0.5, 1, 0.2] }, sides = 16) // a solid"),
    ("scene.sphere", "scene.sphere(1, sides = 16) // a solid"),
    ("scene.box", "scene.box([1, 2, 3]) // a solid"),
    ("scene.group", "scene.group([scene.box(1), scene.affine(translate = [2, 0, 0]) * scene.box(1)]) // a solid"),
    ("scene.centred", "scene.centred(scene.lathe({ y: [0, 1, 2], r: [0.5, 1, 0.2] }), fit = true) // a solid"),
    ("scene.landmarks", "scene.landmarks(scene.box(1), { tip: [0, 0.5, 0] }).landmarks // { tip: [0, 0.5, 0] }"),
    (
        "scene.affine",
        "scene.affine(translate = [1, 0, 0], rotate = [0, deg(90), 0], scale = 2) * scene.box(1) // a solid",
    ),
    (
        "scene.skin",
        body!(
            "let posed = scene.skin(body, { upperarm_l: [0, 0, deg(-30)], pelvis: { location: [0, 0.1, 0] } });\nlet view = scene.render(posed);"
        ),
    ),
    (
        "scene.shaped",
        body!(
            "let heavy = scene.shaped(body, { heavy: 0.8 });\nlet view = scene.render(scene.skin(heavy, { head: [deg(20), 0, 0] }));"
        ),
    ),
    (
        "scene.stretched",
        body!(
            "let tall = scene.stretched(body, { thigh_l: 1.1, thigh_r: 1.1 });\nlet view = scene.render(scene.skin(tall, { head: [deg(20), 0, 0] }));"
        ),
    ),
    (
        "scene.autorig",
        "\
data dog = mesh(\"data/dog.obj\");
let rig = scene.autorig(dog);
let n = len(rig.joints);
let view = scene.render(scene.skin(rig, zeros(3 * n)));",
    ),
    (
        "scene.camera",
        "\
let above = scene.camera(position = [0, 6, 6], focal = 1.2, width = 64, height = 48);
let view = scene.render(scene.box(1), camera = above);",
    ),
    ("scene.render", "scene.render(scene.sphere(1)) // a view"),
    (
        "scene.bounds",
        "\
assume r ~ uniform(0.5, 4);
let reach = scene.bounds(scene.render(scene.sphere(r)));
factor(-100 * max(reach[2] - 1, 0));  // it is probably all in the picture",
    ),
    (
        "scene.contour",
        seen!("data photo = image(\"ball.png\");", "observe scene.contour(view, size = 32) = photo as picture;"),
    ),
    (
        "scene.edges",
        seen!(
            "data photo = image(\"ball.png\");",
            "observe scene.contour(view, size = 32) = scene.edges(photo, smooth = 2.5) as picture;"
        ),
    ),
    (
        "scene.hint",
        "\
data photo = image(\"ball.png\");
let hint = scene.hint(photo);
let middle = if len(hint.box) > 0 { hint.box[0] + hint.box[2] / 2 } else { photo.width / 2 };",
    ),
    (
        "scene.people",
        "\
data photo = image(\"ball.png\");
let people = scene.people(photo);
assume tall ~ normal(if len(people) > 0 { people[0].torso } else { 0 }, 1);",
    ),
    (
        "scene.objects",
        "\
data photo = image(\"ball.png\");
let cups = scene.objects(photo, classes = [\"cup\", \"bowl\", \"vase\"], least = 0.2);
assume wide ~ normal(if len(cups) > 0 { cups[0].box[2] } else { 0 }, 1);",
    ),
    (
        "scene.candidates",
        "\
data photo = image(\"ball.png\");
let found = scene.candidates(photo, most = 5);
assume tall ~ lognormal(log(if len(found) > 0 { found[0].axes[0].length } else { 1 }), 0.1);",
    ),
    (
        "scene.chamfer",
        seen!(
            "data photo = image(\"ball.png\");",
            "observe scene.chamfer(view, symmetric = true, truncate = 20, size = 32) = photo as picture;"
        ),
    ),
    (
        "scene.mask",
        seen!("data object = mask(\"mask.png\");", "observe scene.mask(view, size = 32) = object as outline;"),
    ),
    (
        "scene.depth",
        seen!(
            "data range = depth(\"depth.npy\");",
            "observe scene.depth(view, sd = 0.1, size = 32) = range as distance;"
        ),
    ),
    (
        "scene.keypoints",
        "\
data points = keypoints(\"person.json\");
data body = armature(\"std/human/human.lod2.rig.json\");
assume turn ~ uniform(-pi, pi);
let placed = scene.affine(translate = [0, -1.8, 0], rotate = [0, turn, 0], scale = 2);
let view = scene.render(placed * scene.skin(body, { head: [deg(20), 0, 0] }));
observe scene.keypoints(view) = points as joints;",
    ),
    (
        "scene.relative_depth",
        "\
data body = armature(\"std/human/human.lod2.rig.json\");
assume turn ~ uniform(-pi, pi);
assume s ~ lognormal(0.7, 0.3);
let view = scene.render(
  scene.affine(rotate = [0, turn, 0], scale = s) * scene.skin(body, { head: [deg(20), 0, 0] }),
);
let metres = { nose: [0.02, -0.7, -0.2], l_knee: [0.1, 0.4, -0.3] };   // as people[0].metres has them
observe scene.relative_depth(view, s) = metres as depths;",
    ),
    (
        "scene.region",
        seen!(
            "data photo = image(\"ball.png\");",
            "observe scene.region(view, tiles = 4, size = 32) = photo as inside;"
        ),
    ),
];

/// The example of a built-in.
pub(super) fn of(row: &Row) -> Option<&'static str> {
    let name = match row.module {
        "" => row.name.to_owned(),
        module => format!("{module}.{}", row.name),
    };
    EXAMPLES.iter().find(|(of, _)| *of == name).map(|(_, text)| *text)
}
