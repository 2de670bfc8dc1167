//! Tests of graph models: against values computed by hand, and with errors in them.

use super::graph::{Graph, sizes, small, split, text, window};
use crate::nn::{Memory, Network, NetworkError};
use serde_json::json;

fn read(graph: &Graph) -> Result<Network<'static>, NetworkError> {
    let (json, weights) = graph.files();
    Network::read_graph_model(&json, weights.leak(), None)
}

fn run(graph: &Graph, input: &[f32]) -> Vec<Vec<f32>> {
    read(graph).unwrap().run(input.to_vec()).unwrap()
}

#[test]
fn a_model_is_read_and_run() {
    let network = read(&small()).unwrap();
    assert_eq!(network.input_shape(), [1, 1, 1, 3]);
    assert_eq!(network.output_shapes().collect::<Vec<_>>(), [[1, 1, 1, 2]]);
    // 3 - 2 * 1 + 0.5, and 1 - 2 * 4 + 0.5, of which a quarter is left.
    assert_eq!(network.run(vec![3.0, 1.0, 4.0]).unwrap(), [[1.5, -1.625]]);
    let short = network.run(vec![3.0]).unwrap_err();
    assert_eq!(short, NetworkError::Input { expected: 3, got: 1 });
    // Nodes may come in any order.
    let mut reversed = small();
    reversed.nodes.reverse();
    assert_eq!(run(&reversed, &[3.0, 1.0, 4.0]), [[1.5, -1.625]]);
    // What else reads a result gets it without the bias.
    let shared = Graph { outputs: vec!["y", "c"], ..small() };
    assert_eq!(run(&shared, &[3.0, 1.0, 4.0]), [[1.5, -1.625], [1.0, -7.0]]);
}

#[test]
fn an_image_may_have_another_size_than_the_model_s() {
    let graph = Graph::new(&[1, 1, 2, 4], &["y"])
        .transposed("t", "x", &[0, 2, 3, 1])
        .integers("size", &[2], &[4, 2])
        .node("y", "ResizeBilinear", &["t", "size"], json!({}));
    let (json, weights) = graph.files();
    let at = |size| Network::read_graph_model(&json, &weights, Some(size));
    let network = at([4, 2]).unwrap();
    assert_eq!(network.input_shape(), [1, 1, 4, 2]);
    assert_eq!(network.output_shapes().collect::<Vec<_>>(), [[1, 8, 1, 1]]);
    let rows: Vec<f32> = (0..8u8).map(f32::from).collect();
    let halves = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 6.0].to_vec();
    assert_eq!(network.run(rows).unwrap(), [halves]);
    let refused = at([3, 3]).unwrap_err().to_string();
    assert!(refused.contains("its input cannot have this size"), "{refused}");
}

#[test]
fn images_are_padded_pooled_split_and_enlarged() {
    // The largest of the first channel is 4, of the second -5: padding is below all.
    let input = [1.0, 2.0, 3.0, 4.0, -8.0, -7.0, -6.0, -5.0];
    let [sigmoid, list] = &run(&split(), &input)[..] else { panic!() };
    assert!((sigmoid[0] - 0.982_013_8).abs() < 1e-6 && sigmoid.len() == 1);
    assert_eq!(list[..], [-5.0, -5.0]);
}

/// Two channels, first, of one row of three pixels.
const ROW: [f32; 6] = [1.0, 2.0, 3.0, 10.0, 20.0, 30.0];

/// A graph whose node `t` has the channels of `x` last, and whose node `f` is a leaky ReLU
/// of `x`, stored with channels last.
fn views(outputs: &[&'static str]) -> Graph {
    // A convolution that leaves each channel as it is.
    Graph::new(&[1, 2, 1, 3], outputs)
        .transposed("t", "x", &[0, 2, 3, 1])
        .floats("same", &[1, 1, 2, 2], &[1.0, 0.0, 0.0, 1.0])
        .node("c", "Conv2D", &["t", "same"], window([1, 1], "SAME"))
        .transposed("f", "c", &[0, 3, 1, 2])
}

#[test]
fn tensors_stored_in_different_orders_are_combined() {
    let sum = views(&["y", "z"]).node("y", "Add", &["x", "f"], json!({})).node(
        "z",
        "Add",
        &["f", "x"],
        json!({}),
    );
    let doubled = ROW.map(|v| 2.0 * v);
    assert_eq!(run(&sum, &ROW), [doubled, doubled]);
    let joined = views(&["y"]).integers("axis", &[], &[-3]);
    let joined = joined.node("y", "ConcatV2", &["f", "x", "axis"], json!({}));
    let network = read(&joined).unwrap();
    assert_eq!(network.output_shapes().next(), Some(&[1, 4, 1, 3][..]));
    assert_eq!(network.run(ROW.to_vec()).unwrap(), [[ROW, ROW].concat()]);
    let list = views(&["y"]).integers("shape", &[2], &[2, 3]);
    let list = list.node("l", "Reshape", &["f", "shape"], json!({})).transposed("y", "l", &[1, 0]);
    assert_eq!(run(&list, &ROW), [[1.0, 10.0, 2.0, 20.0, 3.0, 30.0]]);
    let parts = views(&["y:1"]).integers("parts", &[2], &[1, 2]).integers("axis", &[], &[3]);
    let parts = parts.node("y", "SplitV", &["f", "parts", "axis"], json!({}));
    assert_eq!(run(&parts, &ROW), [[2.0, 3.0, 20.0, 30.0]]);
    let padded = views(&["y"]).integers("by", &[4, 2], &[0, 0, 1, 0, 0, 0, 0, 1]);
    let padded = padded.node("y", "Pad", &["f", "by"], json!({}));
    let expected = [0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 0.0, 10.0, 20.0, 30.0, 0.0];
    assert_eq!(run(&padded, &ROW), [expected]);
}

/// Outputs that are wanted are the same without the others, whatever was in the memory before.
#[test]
fn only_what_is_wanted_is_computed() {
    let (network, input) = (read(&split()).unwrap(), [1.0, -2.0, 3.0, 4.0, 5.0, 6.0, -7.0, 8.0]);
    let all = network.run(input.to_vec()).unwrap();
    let mut memory = Memory::default();
    for wanted in [[true, false], [false, true], [false, false], [true, true]] {
        let got = network.run_in(&mut memory, &wanted, |place| place.copy_from_slice(&input));
        for ((got, all), wanted) in got.iter().zip(&all).zip(wanted) {
            assert_eq!(*got, if wanted { &all[..] } else { &[] });
        }
    }
}

#[test]
fn images_with_channels_first() {
    let mut format = window([1, 1], "VALID");
    format["data_format"] = text("NCHW");
    format["strides"] = sizes(&[1, 1, 1, 2]);
    // The first channel less the second, every second pixel.
    let graph = Graph::new(&[1, 2, 1, 3], &["y"])
        .floats("weights", &[1, 1, 2, 1], &[1.0, -1.0])
        .node("y", "Conv2D", &["x", "weights"], format);
    assert_eq!(run(&graph, &ROW), [[-9.0, -27.0]]);
}

#[test]
fn what_does_not_fit_is_named() {
    let wrong = |graph: Graph| read(&graph).unwrap_err().to_string();
    let with = |op: &str, inputs: &[&str], attr| {
        let graph = views(&["y"])
            .integers("one", &[], &[1])
            .integers("two", &[2], &[0, 7])
            .floats("three", &[3], &[1.0; 3])
            .floats("none", &[], &[f32::NAN]);
        wrong(graph.node("y", op, inputs, attr))
    };
    let none = || json!({});
    for (message, expected) in [
        (with("Softmax", &["x"], none()), "y (Softmax): unsupported operator"),
        (with("Sigmoid", &["same"], none()), "y (Sigmoid): an input is missing or constant"),
        (with("Sigmoid", &["x:1"], none()), "an input does not exist"),
        (with("Sigmoid", &["z"], none()), "there is no node z"),
        (with("Sigmoid", &["y"], none()), "a node needs its own result"),
        (with("Add", &["x", "t"], none()), "the shapes of its inputs do not match"),
        (with("Add", &["f", "three"], none()), "only one number or one for each channel"),
        (with("Add", &["x", "none"], none()), "a constant is not a number"),
        (with("Transpose", &["x", "two"], none()), "the shapes of its inputs do not match"),
        (with("Reshape", &["x", "two"], none()), "a size is out of range"),
        (with("ConcatV2", &["x", "t", "one"], none()), "the shapes of its inputs do not match"),
        (with("ResizeBilinear", &["x", "one"], none()), "expected two sizes"),
        (with("ResizeBilinear", &["x", "three"], none()), "not a constant of integers"),
        (with("LeakyRelu", &["x"], json!({ "alpha": { "f": 2 } })), "its slope is not from 0 to 1"),
        (with("Conv2D", &["x", "same"], window([1, 1], "VALID")), "the shapes of its inputs"),
        (with("Conv2D", &["t", "x"], window([1, 1], "VALID")), "its weights are not constants"),
        (with("Conv2D", &["t", "same"], window([0, 1], "VALID")), "has an invalid size"),
        (with("Conv2D", &["t", "same"], none()), "`strides` are not those of an image"),
        (with("MaxPool", &["t"], window([1, 1], "SAME")), "`ksize` are not those of an image"),
        (wrong(views(&[])), "no output depends on an input"),
        (wrong(views(&["same"])), "an output is never computed"),
        (wrong(Graph::new(&[1, 1 << 20, 1 << 20], &["x"])), "too large"),
        (wrong(Graph { bytes: vec![0; 3], ..small() }), "ends before the last constant"),
        (wrong(Graph { bytes: vec![0; 99], ..small() }), "goes beyond the last constant"),
    ] {
        assert!(message.contains(expected), "{message}: {expected}");
    }
    let garbage = Network::read_graph_model(b"{\"modelTopology\": {}}", &[], None).unwrap_err();
    assert!(garbage.to_string().contains("not a TensorFlow.js graph model: missing field `node`"));
}

#[test]
fn broken_models_are_errors_or_other_networks() {
    for graph in [small(), split()] {
        let (json, weights) = graph.files();
        for n in 0..json.len() {
            assert!(Network::read_graph_model(&json[..n], &weights, None).is_err());
        }
        let mut read = 0;
        let files = [json, weights];
        for (k, i) in (0..2).flat_map(|k| (0..files[k].len()).map(move |i| (k, i))) {
            for value in [b'0', b'9', b'-', 0x7f, 0x80, 0xff, files[k][i] ^ 1] {
                let mut bad = files.clone();
                bad[k][i] = value;
                if let Ok(network) = Network::read_graph_model(&bad[0], &bad[1], None) {
                    let n = network.input_shape().iter().product();
                    if network.work() < 1 << 20 {
                        assert!(network.run(vec![1.0; n]).is_ok());
                    }
                    read += 1;
                }
            }
        }
        assert!(read > 100, "{read}");
    }
}
