#!/bin/sh
# Fills fuzz/corpus with what the targets start from, made by tests/fuzz/main.rs.
set -e
cd "$(dirname "$0")/.."
SEEDS="$PWD/fuzz/corpus" cargo test --release --test fuzz write_seeds -- --ignored
