//! Tests of networks written byte by byte.

use super::*;
use crate::read;
use image::{Rgb, RgbImage};
use writer::{Dim, Graph, floats, node};

/// A minimal writer of ONNX files: protocol buffers, field by field.
mod writer {
    fn varint(mut n: u64) -> Vec<u8> {
        let mut out = Vec::new();
        while n >= 0x80 {
            out.push(n as u8 | 0x80);
            n >>= 7;
        }
        out.push(n as u8);
        out
    }

    fn number(field: u64, n: u64) -> Vec<u8> {
        [varint(field << 3), varint(n)].concat()
    }

    fn bytes(field: u64, content: &[u8]) -> Vec<u8> {
        [varint(field << 3 | 2), varint(content.len() as u64), content.to_vec()].concat()
    }

    /// A dimension of an input or output.
    #[derive(Clone, Copy)]
    pub enum Dim {
        Of(u64),
        Any(&'static str),
    }

    /// The declaration of an input or output: its name, element type and shape.
    fn value(name: &str, element: u64, shape: &[Dim]) -> Vec<u8> {
        let dims = shape.iter().flat_map(|d| {
            bytes(
                1,
                &match d {
                    Dim::Of(n) => number(1, *n),
                    Dim::Any(name) => bytes(2, name.as_bytes()),
                },
            )
        });
        let tensor = [number(1, element), bytes(2, &dims.collect::<Vec<u8>>())].concat();
        [bytes(1, name.as_bytes()), bytes(2, &bytes(1, &tensor))].concat()
    }

    /// An initializer.
    pub fn floats(name: &str, shape: &[u64], data: &[f32]) -> Vec<u8> {
        let dims = shape.iter().flat_map(|n| number(1, *n)).collect::<Vec<u8>>();
        let raw: Vec<u8> = data.iter().flat_map(|x| x.to_le_bytes()).collect();
        [dims, number(2, 1), bytes(8, name.as_bytes()), bytes(9, &raw)].concat()
    }

    /// A node; attributes are lists of integers.
    pub fn node(op: &str, inputs: &[&str], output: &str, attributes: &[(&str, &[u64])]) -> Vec<u8> {
        let inputs = inputs.iter().flat_map(|i| bytes(1, i.as_bytes())).collect::<Vec<u8>>();
        let attributes = attributes.iter().flat_map(|(name, ints)| {
            let ints = ints.iter().flat_map(|n| number(8, *n)).collect::<Vec<u8>>();
            bytes(5, &[bytes(1, name.as_bytes()), ints, number(20, 7)].concat())
        });
        [inputs, bytes(2, output.as_bytes()), bytes(4, op.as_bytes()), attributes.collect()]
            .concat()
    }

    /// A network.
    #[derive(Default)]
    pub struct Graph {
        pub inputs: Vec<(&'static str, u64, Vec<Dim>)>,
        pub outputs: Vec<(&'static str, Vec<Dim>)>,
        pub nodes: Vec<Vec<u8>>,
        pub tensors: Vec<Vec<u8>>,
    }

    impl Graph {
        pub fn file(&self) -> Vec<u8> {
            let mut graph: Vec<u8> = self.nodes.iter().flat_map(|n| bytes(1, n)).collect();
            graph.extend(bytes(2, b"test"));
            graph.extend(self.tensors.iter().flat_map(|t| bytes(5, t)));
            graph.extend(self.inputs.iter().flat_map(|(n, t, s)| bytes(11, &value(n, *t, s))));
            graph.extend(self.outputs.iter().flat_map(|(n, s)| bytes(12, &value(n, 1, s))));
            let operators = [bytes(1, b""), number(2, 13)].concat();
            [number(1, 8), bytes(7, &graph), bytes(8, &operators)].concat()
        }
    }
}

const SIDES: [Dim; 2] = [Dim::Any("h"), Dim::Any("w")];

fn shape(channels: u64, sides: [Dim; 2]) -> Vec<Dim> {
    vec![Dim::Of(1), Dim::Of(channels), sides[0], sides[1]]
}

/// A 1 x 1 convolution, which is a weighted sum of the channels, followed by another
/// operator.
fn weighted(channels: u64, sides: [Dim; 2], weights: &[f32], then: &str) -> Graph {
    Graph {
        inputs: vec![("picture", 1, shape(channels, sides))],
        outputs: vec![("side", shape(1, sides)), ("fused", shape(1, sides))],
        nodes: vec![
            node("Conv", &["picture", "weights"], "side", &[("kernel_shape", &[1, 1])]),
            node(then, &["side"], "fused", &[]),
        ],
        tensors: vec![floats("weights", &[1, channels, 1, 1], weights)],
    }
}

fn network(graph: &Graph, options: &NetworkOptions) -> Result<Network, String> {
    Network::read(&graph.file(), options).map_err(|e| e.to_string())
}

/// A disc of one colour on black.
fn photo(width: u32, height: u32) -> Photo {
    let middle = (width as f32 / 2.0, height as f32 / 2.0);
    Photo::from_rgb(RgbImage::from_fn(width, height, |x, y| {
        let r = (x as f32 + 0.5 - middle.0).hypot(y as f32 + 0.5 - middle.1);
        Rgb(if r < height as f32 / 3.0 { [255, 102, 51] } else { [0, 0, 0] })
    }))
    .unwrap()
}

fn middle(map: &SoftMap) -> f32 {
    map.values[(map.height / 2 * map.width + map.width / 2) as usize]
}

#[test]
fn the_picture_arrives_as_the_options_say() {
    let plain = NetworkOptions::default();
    let photo = photo(96, 64);
    let get = |graph: &Graph, options: &NetworkOptions| {
        middle(&network(graph, options).unwrap().map(&photo, 512).unwrap())
    };
    let near = |a: f32, b: f32| assert!((a - b).abs() < 1e-6, "{a} {b}");
    // One channel at a time: red, green and blue are 1, 0.4 and 0.2 in the disc.
    let one = |c: usize| {
        weighted(3, SIDES, &std::array::from_fn::<f32, 3, _>(|k| f32::from(k == c)), "Identity")
    };
    near(get(&one(0), &plain), 1.0);
    near(get(&one(1), &plain), 0.4);
    near(get(&one(2), &plain), 0.2);
    let bgr = NetworkOptions { bgr: true, ..plain.clone() };
    near(get(&one(0), &bgr), 0.2);
    let normalised = NetworkOptions {
        white: 255.0,
        mean: [0.0, -51.0, 0.0],
        spread: [255.0, 510.0, 1.0],
        ..plain.clone()
    };
    near(get(&one(0), &normalised), 1.0);
    near(get(&one(1), &normalised), 153.0 / 510.0);
    // Grey, by Rec. 601, in either order of colours.
    let grey = weighted(1, SIDES, &[1.0], "Identity");
    near(get(&grey, &plain), 0.299 + 0.587 * 0.4 + 0.114 * 0.2);
    near(get(&grey, &bgr), 0.299 + 0.587 * 0.4 + 0.114 * 0.2);
}

#[test]
fn outputs_by_place_and_by_name() {
    let graph = weighted(3, SIDES, &[0.5, 0.0, 0.0], "Sigmoid");
    let of = |output| {
        let options = NetworkOptions { output, ..NetworkOptions::default() };
        network(&graph, &options)
            .and_then(|n| n.map(&photo(96, 64), 96).map_err(|e| e.to_string()))
            .map(|m| middle(&m))
    };
    let sigmoid = 1.0 / (1.0 + libm::expf(-0.5));
    assert!((of(Output::Last).unwrap() - sigmoid).abs() < 1e-5);
    assert!((of(Output::Number(2)).unwrap() - sigmoid).abs() < 1e-5);
    assert_eq!(of(Output::Number(1)).unwrap(), 0.5);
    assert_eq!(of(Output::Named("side".into())).unwrap(), 0.5);
    assert_eq!(
        of(Output::Number(3)).unwrap_err(),
        "the network has no output 3; it has 2: side, fused"
    );
    assert_eq!(
        of(Output::Named("d0".into())).unwrap_err(),
        "the network has no output `d0`; it has side, fused"
    );
}

#[test]
fn values_beyond_1_are_log_odds_or_an_error() {
    let graph = weighted(3, SIDES, &[-4.0, 0.0, 0.0], "Identity");
    let of = |logits| {
        let options = NetworkOptions { logits, ..NetworkOptions::default() };
        network(&graph, &options)
            .unwrap()
            .map(&photo(64, 64), 64)
            .map(|m| middle(&m))
            .map_err(|e| e.to_string())
    };
    let why = of(false).unwrap_err();
    assert_eq!(
        why,
        "the output `fused` has values from -4 to 0, not from 0 to 1; if they are log odds, set logits = true"
    );
    assert!((of(true).unwrap() - 1.0 / (1.0 + libm::expf(4.0))).abs() < 1e-6);
    let endless = weighted(3, SIDES, &[f32::INFINITY, 0.0, 0.0], "Identity");
    let found = network(&endless, &NetworkOptions::default()).unwrap().map(&photo(64, 64), 64);
    assert!(found.unwrap_err().to_string().contains("not finite"));
}

#[test]
fn objects_and_contours_become_contour_maps_in_the_shape_of_the_photograph() {
    // The disc is an object. The network has a fixed size that differs from that of the
    // photograph.
    let fixed = weighted(3, [Dim::Of(64), Dim::Of(64)], &[1.0, 0.0, 0.0], "Identity");
    let objects = NetworkOptions { shows: Shows::Objects, ..NetworkOptions::default() };
    let detector = read(&fixed.file(), &objects).unwrap();
    let photo = photo(128, 64);
    let soft = detector.map(&photo, 512).unwrap();
    assert_eq!((soft.width, soft.height), (64, 64));
    let map = soft.contours_of(&photo, detector.sigma());
    assert_eq!((map.width, map.height), (64, 32));
    assert!(map.len() > 40);
    for k in 0..map.len() {
        let (x, y) = (map.x[k] - 32.0, map.y[k] - 16.0);
        let r = x.hypot(y);
        assert!((r - 64.0 / 6.0).abs() < 0.8, "{r}");
        assert!(((map.tx[k] * x + map.ty[k] * y) / r).abs() < 0.3);
    }
    // The options decide what a map shows.
    let detector = read(&fixed.file(), &NetworkOptions::default()).unwrap();
    let contours = detector.map(&photo, 512).unwrap().contours_of(&photo, detector.sigma());
    assert_ne!(contours, map);
}

#[test]
fn sides_of_networks_that_take_any_size() {
    let any =
        network(&weighted(3, SIDES, &[1.0, 0.0, 0.0], "Identity"), &NetworkOptions::default())
            .unwrap();
    for ((w, h), size, expected) in [
        ((640, 480), 512, (512, 384)),
        ((640, 480), 200, (192, 160)),
        ((100, 10), 512, (96, 32)),
        ((3, 3), 512, (32, 32)),
    ] {
        let map = any.map(&photo(w, h), size).unwrap();
        assert_eq!((map.width, map.height), expected);
    }
    // A single channel, last, as in some frameworks.
    let last = Graph {
        inputs: vec![("picture", 1, vec![Dim::Of(1), SIDES[0], SIDES[1], Dim::Of(1)])],
        outputs: vec![("map", vec![Dim::Of(1), SIDES[0], SIDES[1], Dim::Of(1)])],
        nodes: vec![node("Identity", &["picture"], "map", &[])],
        tensors: Vec::new(),
    };
    let map = network(&last, &NetworkOptions::default()).unwrap().map(&photo(96, 64), 512).unwrap();
    assert_eq!((map.width, map.height, map.shows), (96, 64, Shows::Contours));
}

#[test]
fn networks_that_are_of_no_use() {
    let plain = NetworkOptions::default();
    let with = |change: &dyn Fn(&mut Graph)| {
        let mut graph = weighted(3, SIDES, &[1.0, 0.0, 0.0], "Identity");
        change(&mut graph);
        let read = network(&graph, &plain);
        read.and_then(|n| n.map(&photo(64, 64), 64).map_err(|e| e.to_string())).unwrap_err()
    };
    let input = |dims: &'static [u64]| {
        with(&move |g| g.inputs[0].2 = dims.iter().map(|n| Dim::Of(*n)).collect())
    };
    for (why, says) in [
        (
            with(&|g| g.inputs.push(("other", 1, shape(3, SIDES)))),
            "the network takes 2 inputs; it must take one",
        ),
        (with(&|g| g.inputs[0].1 = 6), "input is not in single precision"),
        (input(&[3, 64, 64]), "the network takes [3, 64, 64]; the input must have 4 dimensions"),
        (input(&[2, 3, 64, 64]), "one picture at a time"),
        (input(&[1, 4, 64, 64]), "it must take 1 or 3 channels"),
        (input(&[1, 3, 64, 9999]), "sides may be 1 to 4096"),
        (with(&|g| g.outputs.clear()), "the network has no output"),
        // The output has three channels.
        (
            with(&|g| {
                g.outputs = vec![("same", shape(3, SIDES))];
                g.nodes = vec![node("Identity", &["picture"], "same", &[])];
            }),
            "the output `same` is [1, 3, 64, 64], not a map of one channel",
        ),
        (
            with(&|g| g.nodes[1] = node("Convert", &["side"], "fused", &[])),
            "cannot read the network",
        ),
        // Weights of four channels for a picture of three.
        (
            with(&|g| g.tensors[0] = floats("weights", &[1, 4, 1, 1], &[1.0; 4])),
            "the network cannot be run on this picture",
        ),
    ] {
        assert!(why.contains(says), "{why:?} does not say {says:?}");
    }
    // The declared shape of the output is checked on reading.
    let mut thin = weighted(3, [Dim::Of(64), Dim::Of(64)], &[1.0, 0.0, 0.0], "Identity");
    thin.outputs[1].1 = shape(1, [Dim::Of(64), Dim::Of(32)]);
    let why = network(&thin, &plain).unwrap_err();
    assert_eq!(
        why,
        "the output `fused` is 32 x 64 pixels, which does not match the aspect ratio of the picture, 64 x 64"
    );
}

#[test]
fn damaged_files_are_errors() {
    let file = weighted(3, SIDES, &[1.0, 0.0, 0.0], "Sigmoid").file();
    let plain = NetworkOptions::default();
    let photo = photo(32, 32);
    let mut x = 5u64;
    for n in 0..file.len() {
        if let Ok(network) = Network::read(&file[..n], &plain) {
            let _ = network.map(&photo, 32);
        }
        let mut changed = file.clone();
        x = x.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        changed[n] = (x >> 40) as u8;
        if let Ok(network) = Network::read(&changed, &plain) {
            let _ = network.map(&photo, 32);
        }
    }
}
