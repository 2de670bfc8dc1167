#!/usr/bin/env bash
# arviz 0.23.4: the effective sample size of a quantile may leave out all draws that are equal to the quantile.
#
# Guess: `az.ess(method="quantile", prob=0.05)` is that of the indicator "draw <= 5 % quantile", as its source (Vehtari et al.
# 2021) has it. Where draws are equal, such as those of a bounded quantity, of levels, or of a walk that stands still, a
# quantile between two equal draws is that draw.
# What happens: ArviZ interpolates by scipy's `mquantiles`, (1 - g) * a + g * a, which rounds to one unit in the last place below
# `a` for some values and numbers of draws. Then no draw is at or below the quantile, and the indicator is constant: here the
# 5 % tail counts as 2,400 independent draws where it is worth some 560. `np.quantile` and ArviZ 1.3 (arviz-stats 1.3.3) have `a`.
# Why it matters: `ess_tail` of a stuck chain is said to be as large as its other tail; which value and length do it looks random,
# so a comparison with another implementation fails once in a while.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
for python in python3 python3.11 python3.12 python3.13 "$HOME"/.pyenv/versions/3.1[1-9].*/bin/python; do
  "$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && break
done
"$python" -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check arviz==0.23.4 numpy==2.4.6 scipy==1.17.1 xarray==2026.9.0
"$work/venv/bin/python" - <<'PY'
import sys
import warnings
import numpy as np

warnings.simplefilter("ignore")
import arviz as az

# Four chains of a slow autoregression of heights in cm, with a lower bound: about a tenth of the draws are at it.
rng = np.random.default_rng(1)
x = np.full((4, 600), 175.0)
for t in range(1, 600):
    x[:, t] = 175 + 0.8 * (x[:, t - 1] - 175) + rng.normal(scale=4.2, size=4)
x = np.maximum(x, 166.23)


def size(draws, **how):
    return az.ess(az.convert_to_dataset({"x": draws}), **how)["x"].item()


bound = np.quantile(x, 0.05)
shown = size(x, method="quantile", prob=0.05)
right = size(1.0 * (x <= bound), method="mean")
print(f"arviz {az.__version__}; {(x == 166.23).mean():.3f} of the draws are 166.23, the 5 % quantile by numpy is {bound}")
print(f"size of the 5 % quantile: {shown:.1f}; of the indicator: {right:.1f}")
if not (bound == 166.23 and shown == x.size and right < x.size / 2):
    sys.exit("no longer so")
PY
