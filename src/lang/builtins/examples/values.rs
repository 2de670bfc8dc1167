//! Operators, functions of values, forms, and data.

use super::Examples;

pub(super) const EXAMPLES: Examples = &[
    ("+", "[1, 2] + 10 // [11, 12]"),
    ("-", "[1, 2] - 10 // [-9, -8]"),
    ("*", "[1, 2] * [3, 4] // [3, 8]"),
    ("/", "[1, 2] / 4 // [0.25, 0.5]"),
    ("%", "-1 % 3 // 2"),
    ("**", "[1, 2, 3] ** 2 // [1, 4, 9]"),
    ("neg", "-[1, 2] // [-1, -2]"),
    ("not", "not true // false"),
    ("==", "[1, 2] == [1, 2] // [true, true]"),
    ("!=", "\"left\" != \"right\" // true"),
    ("<", "[1, 2, 3] < 2 // [true, false, false]"),
    ("<=", "[1, 2, 3] <= 2 // [true, true, false]"),
    (">", "[1, 2, 3] > 2 // [false, false, true]"),
    (">=", "[1, 2, 3] >= 2 // [false, true, true]"),
    ("..", "0 .. 4 // [0, 1, 2, 3]"),
    ("exp", "exp([0, 2]) // [1, 7.38905609893065]"),
    ("expm1", "expm1(0.5) // 0.6487212707001282"),
    ("log", "log([1, 0]) // [0, -inf]"),
    ("log1p", "log1p(0.5) // 0.4054651081081644"),
    ("sqrt", "sqrt([4, 9]) // [2, 3]"),
    ("pow", "pow(2, 10) // 1024"),
    ("abs", "abs([-2, 3]) // [2, 3]"),
    ("sign", "sign([-2, 0, 3]) // [-1, 0, 1]"),
    ("step", "step([-2, 0, 3]) // [0, 1, 1]"),
    ("floor", "floor([-1.5, 1.5]) // [-2, 1]"),
    ("ceil", "ceil([-1.5, 1.5]) // [-1, 2]"),
    ("round", "round([-1.5, 1.4]) // [-2, 1]"),
    ("min", "min([3, 1, 2]) // 1"),
    ("max", "max(0, [-1, 2]) // [0, 2]"),
    ("clamp", "clamp([-1, 0.3, 2], 0, 1) // [0, 0.3, 1]"),
    ("sin", "sin(pi / 2) // 1"),
    ("cos", "cos(0) // 1"),
    ("tan", "tan(0) // 0"),
    ("asin", "asin(1) // 1.5707963267948966"),
    ("acos", "acos(1) // 0"),
    ("atan", "atan(1) // 0.7853981633974483"),
    ("atan2", "atan2(1, -1) // 2.356194490192345"),
    ("sinh", "sinh(1) // 1.1752011936438014"),
    ("cosh", "cosh(1) // 1.543080634815244"),
    ("tanh", "tanh(1) // 0.7615941559557649"),
    ("deg", "deg(180) // 3.141592653589793"),
    ("logit", "logit(0.75) // 1.0986122886681096"),
    ("expit", "expit([-2, 0, 2]) // [0.11920292202211755, 0.5, 0.8807970779778823]"),
    ("erf", "erf(1) // 0.8427007929497149"),
    ("lgamma", "lgamma(5) // 3.1780538303479458"),
    ("sum", "sum([1, 2, 3]) // 6"),
    ("prod", "prod([2, 3, 4]) // 24"),
    ("mean", "mean([1, 2, 6]) // 3"),
    ("var", "var([1, 2, 6]) // 7"),
    ("sd", "sd([1, 2, 3]) // 1"),
    ("norm", "norm([3, 4]) // 5"),
    ("log_sum_exp", "log_sum_exp([1000, 1000]) // 1000.6931471805599"),
    ("cumsum", "cumsum([1, 2, 3]) // [1, 3, 6]"),
    ("dot", "dot([1, 2], [3, 4]) // 11"),
    ("len", "len([4, 5, 6]) // 3"),
    ("linspace", "linspace(0, 1, 5) // [0, 0.25, 0.5, 0.75, 1]"),
    ("range", "range(0, 10, step = 3) // [0, 3, 6, 9]"),
    ("zeros", "zeros(3) // [0, 0, 0]"),
    ("ones", "ones(3) // [1, 1, 1]"),
    ("fill", "fill(0.5, 3) // [0.5, 0.5, 0.5]"),
    ("concat", "concat([1, 2], [3]) // [1, 2, 3]"),
    ("append", "append([1, 2], 3) // [1, 2, 3]"),
    ("reverse", "reverse([1, 2, 3]) // [3, 2, 1]"),
    ("sort", "sort([3, 1, 2]) // [1, 2, 3]"),
    ("argsort", "argsort([30, 10, 20]) // [1, 2, 0]"),
    ("argmax", "argmax([3, 7, 5]) // 1"),
    ("argmin", "argmin([3, 7, 5]) // 0"),
    ("zip", "zip([1, 2], [3, 4]) // [[1, 3], [2, 4]]"),
    ("keys", "keys({ x: 1, y: 2 }) // [\"x\", \"y\"]"),
    ("values", "values({ x: 1, y: 2 }) // [1, 2]"),
    ("has", "has({ x: 1 }, \"y\") // false"),
    ("any", "any([1, 5] > 4) // true"),
    ("all", "all([1, 5] > 4) // false"),
    ("select", "select([1, 5] > 4, [10, 20], 0) // [0, 20]"),
    ("str", "\"part \" + str(3) // \"part 3\""),
    ("interp", "interp([0.5, 9], [0, 1, 2], [0, 10, 40]) // [5, 40]"),
    ("matmul", "matmul([[1, 2], [3, 4]], [1, 1]) // [3, 7]"),
    ("transpose", "transpose([[1, 2], [3, 4]]) // [[1, 3], [2, 4]]"),
    ("diag", "diag([1, 2]) // [[1, 0], [0, 2]]"),
    ("outer", "outer([1, 2], [3, 4]) // [[3, 4], [6, 8]]"),
    ("cholesky", "cholesky([[4, 2], [2, 5]]) // [[2, 0], [1, 2]]"),
    ("solve", "solve([[4, 2], [2, 5]], [8, 12]) // [1, 2]"),
    ("logdet", "logdet([[4, 2], [2, 5]]) // 2.772588722239781"),
    ("identity", "identity(2) // [[1, 0], [0, 1]]"),
    ("map", "map(fn(x) { x * x }, [1, 2, 3]) // [1, 4, 9]"),
    ("fold", "fold(fn(sum, x) { sum + x }, 0, [1, 2, 3]) // 6"),
    (
        "mem",
        "\
let stick = mem(fn(k) { v ~ beta(1, 2); v });
assume twice = [stick(7), stick(7)];             // the same number: drawn once for each k
observe normal(stick(7), 0.1) = 0.4 as y;",
    ),
    (
        "log_joint",
        "\
assume x ~ normal(0, 1);
observe normal(x, 1) = 2 as y;
infer { repeat 100 { drift(@x); collect x, log_joint(); } }",
    ),
    (
        "log_prior",
        "\
assume x ~ normal(0, 1);
observe normal(x, 1) = 2 as y;
infer { repeat 100 { drift(@x); collect x, log_prior(); } }",
    ),
    (
        "log_likelihood",
        "\
assume x ~ normal(0, 1);
observe normal(x, 1) = 2 as y;
infer { repeat 100 { drift(@x); collect x, log_likelihood(); } }",
    ),
    ("csv", "data d = csv(\"data/line.csv\");\nlet n = len(d.x);"),
    (
        "json",
        "data prior = json(\"std/human/pose_prior.json\");\nlet kinds = len(prior.weights_balanced);",
    ),
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
        "armature",
        "data body = armature(\"std/human/human.lod2.rig.json\");\nlet n = len(body.joints);",
    ),
    (
        "detector",
        "data photo = image(\"ball.png\");\ndata trees = detector(\"model.yml.gz\");\nlet found = scene.edges(photo, detector = trees);",
    ),
    ("keypoints", "data points = keypoints(\"person.json\");\nlet n = points.count;"),
    ("mesh", "data dog = mesh(\"data/dog.obj\");\nlet view = scene.render(dog);"),
];
