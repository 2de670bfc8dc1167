#!/usr/bin/env bash
# Opens runs with ArviZ itself: the README's own commands, limits of time, structures that change. Needs Python 3.10 or later and, the first
# time, a way to install packages; a machine without either is told so and passes.
#
#     tests/interop/run.sh            PCADLANG: the program (built if not given)
set -euo pipefail
cd "$(dirname "$0")/../.."
venv=target/interop
if [ ! -x "$venv/bin/python" ] && ! python3 -m venv "$venv"; then
  echo "interop: no Python to make an environment with; NOT RUN"
  exit 0
fi
if ! "$venv/bin/pip" install --quiet --retries 1 --timeout 20 --disable-pip-version-check -r tests/interop/requirements.txt; then
  echo "interop: ArviZ cannot be installed here; NOT RUN"
  exit 0
fi
if [ -z "${PCADLANG:-}" ]; then
  cargo build --release --bin pcadlang
  PCADLANG=target/release/pcadlang
fi
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
"$PCADLANG" run human.pcad --observe examples/images/skier.jpg --seed 1 --time 10s --quiet --out "$out/human"
"$PCADLANG" run lathe.pcad --observe examples/images/coffee_cup.png --seed 1 --time 10s --quiet --out "$out/lathe"
"$PCADLANG" run linreg.pcad --seed 1 --quiet --out "$out/linreg"
"$PCADLANG" run tests/interop/line.pcad --seed 1 --quiet --out "$out/line"
"$PCADLANG" run tests/interop/parts.pcad --seed 1 --quiet --out "$out/parts"
"$PCADLANG" run tests/interop/parts.pcad --seed 1 --time 1s --quiet --out "$out/timed"
MPLBACKEND=Agg "$venv/bin/python" tests/interop/check.py "$out"/human "$out"/lathe "$out"/linreg "$out"/line "$out"/parts "$out"/timed
