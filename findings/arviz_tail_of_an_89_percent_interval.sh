#!/usr/bin/env bash
# arviz 1.3.0 with arviz-stats 1.3.3: the effective sample size that `az.summary` shows beside an interval is not that of its ends.
#
# Guess: with the default `stats.ci_prob` of 0.89 the table has the 89 % interval, from 5.5 to 94.5 %, and `ess_tail` is the
# smaller effective sample size of these two quantiles, as it was of the 5 and 95 % ones in ArviZ 0.x, Stan and posterior.
# What happens: `ess_tail` takes 0.89 for a quantile and mirrors it: it is of 11 and 89 %, the ends of a 78 % interval (here 600,
# where the interval's ends have 763). `prob=(0.055, 0.945)` has to be given by hand.
# Why it matters: who compares pcadlang's table with ArviZ's, or sets a lower bound on ess_tail as papers advise, compares
# numbers of different tails, and ArviZ 1.x and 0.x differ on the same draws. Nothing warns.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
for python in python3 python3.12 python3.13 "$HOME"/.pyenv/versions/3.1[2-9].*/bin/python; do
  "$python" -c 'import sys; sys.exit(sys.version_info < (3, 12))' 2>/dev/null && break
done
"$python" -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check \
  arviz==1.3.0 arviz-base==1.3.1 arviz-plots==1.3.2 arviz-stats==1.3.3 xarray==2026.9.0 numpy==2.5.5
"$work/venv/bin/python" - <<'PY'
import sys
import arviz as az
import numpy as np

# Four chains of an autoregression that moves slowly.
rng = np.random.default_rng(1)
x = np.zeros((4, 2000))
for t in range(1, 2000):
    x[:, t] = 0.9 * x[:, t - 1] + rng.normal(size=4)
data = az.from_dict({"posterior": {"x": x}})
table = az.summary(data, round_to="none")


def tail(low, high):
    return float(az.ess(data, method="tail", prob=(low, high))["x"])


shown = float(table["ess_tail"].iloc[0])
low, high = (float(table[c].iloc[0]) for c in ("eti89_lb", "eti89_ub"))
print(f"arviz {az.__version__}, stats.ci_prob {az.rcParams['stats.ci_prob']}")
print(f"interval {low:.3f} to {high:.3f}: its ends are the quantiles {(x < low).mean():.3f} and {(x < high).mean():.3f}")
print(f"ess_tail {shown:.1f}; of 5.5 and 94.5 %: {tail(0.055, 0.945):.1f}; of 11 and 89 %: {tail(0.11, 0.89):.1f}")
interval = np.allclose([(x < low).mean(), (x < high).mean()], [0.055, 0.945], atol=0.001)
if not (interval and np.isclose(shown, tail(0.11, 0.89)) and not np.isclose(shown, tail(0.055, 0.945))):
    sys.exit("no longer so")
PY
