#!/bin/sh
# Fills fuzz/corpus with what the targets start from, made by tests/fuzz/main.rs and, for forests, by their crate.
set -e
cd "$(dirname "$0")/.."
export SEEDS="$PWD/fuzz/corpus"
cargo test --release --test fuzz write_seeds -- --ignored
cargo test --release --package pcadlang-contour-detectors --test programs write_seeds -- --ignored
