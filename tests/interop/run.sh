#!/usr/bin/env bash
# Opens runs with ArviZ 0.23 and 1.3 and CmdStanPy, and with rstan, posterior, coda and loo of R: the README's own commands, limits of time,
# structures that change, quantities of every shape. ArviZ 0.23 needs Python 3.11 or later, ArviZ 1.3 Python 3.12 or later, both the first time
# a way to install packages; R's packages are those of Debian. What a machine does not have is said (NOT RUN), and passes.
#
#     tests/interop/run.sh            PCADLANG: the program (built if not given)
set -euo pipefail
cd "$(dirname "$0")/../.."

# The first Python of at least this version, if there is one.
python_from() {
  local python
  for python in python3 python3.1{1,2,3,4} "$HOME"/.pyenv/versions/3.1[0-9].*/bin/python; do
    if "$python" -c "import sys, venv; sys.exit(sys.version_info < (3, $1))" 2>/dev/null; then
      echo "$python"
      return
    fi
  done
}

# An environment with ArviZ NAME for Python 3.MINOR or later; false if it cannot be had.
environment() {
  local venv=target/interop_$1 python
  if [ ! -x "$venv/bin/python" ]; then
    python=$(python_from "$2")
    if [ -z "$python" ] || ! "$python" -m venv "$venv"; then
      echo "interop: ArviZ $1: no Python 3.$2 or later to make an environment with; NOT RUN"
      return 1
    fi
  fi
  if ! "$venv/bin/pip" install --quiet --retries 1 --timeout 20 --disable-pip-version-check -r "tests/interop/arviz_$1.txt"; then
    echo "interop: ArviZ $1 cannot be installed here; NOT RUN"
    return 1
  fi
}

# R with the packages; CI installs them, which takes a minute or two.
r_packages() {
  local all='for (p in c("rstan", "posterior", "coda", "loo", "jsonlite")) if (!requireNamespace(p, quietly = TRUE)) quit(status = 1)'
  Rscript -e "$all" >/dev/null 2>&1 && return
  if [ -n "${CI:-}" ] && [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
    timeout 60 apt-get update -qq >/dev/null 2>&1 || true
    timeout 240 apt-get install -y -qq --no-install-recommends r-base-core r-cran-{rstan,posterior,coda,loo,jsonlite} >/dev/null 2>&1 || true
  fi
  Rscript -e "$all" >/dev/null 2>&1
}

if [ -z "${PCADLANG:-}" ]; then
  cargo build --release --bin pcadlang
  PCADLANG=target/release/pcadlang
fi
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
"$PCADLANG" run human.pcad --observe examples/images/skier.jpg --seed 1 --time 10s --quiet --out "$out/human"
"$PCADLANG" run lathe.pcad --observe examples/images/coffee_cup.png --seed 1 --time 10s --quiet --out "$out/lathe"
"$PCADLANG" run linreg.pcad --seed 1 --quiet --out "$out/linreg"
for program in line parts shapes; do
  "$PCADLANG" run "tests/interop/$program.pcad" --seed 1 --quiet --out "$out/$program"
done
"$PCADLANG" run tests/interop/parts.pcad --seed 1 --time 1s --quiet --out "$out/timed"
runs=("$out"/human "$out"/lathe "$out"/linreg "$out"/line "$out"/parts "$out"/timed "$out"/shapes)
if environment 0 11; then MPLBACKEND=Agg target/interop_0/bin/python tests/interop/check.py "${runs[@]}"; fi
if environment 1 12; then MPLBACKEND=Agg target/interop_1/bin/python tests/interop/check.py "${runs[@]}"; fi
if r_packages; then
  Rscript tests/interop/check.R "${runs[@]}"
else
  echo "interop: R with rstan, posterior, coda and loo cannot be installed here; NOT RUN"
fi
