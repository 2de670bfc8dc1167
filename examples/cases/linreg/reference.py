"""Writes reference.json beside each d.csv: the posterior of linreg.pcad by quadrature over the noise, the line integrated out.

slope ~ normal(0, 2), intercept ~ normal(0, 5), noise ~ half_cauchy(0, 1), y ~ normal(slope x + intercept, noise).
Run: python reference.py (needs numpy)
"""

import json
import pathlib

import numpy as np

for path in sorted(pathlib.Path(__file__).parent.glob("*/d.csv")):
    x, y = np.loadtxt(path, delimiter=",", skiprows=1).T
    a = np.stack([x, np.ones_like(x)], 1)
    prior = np.diag([1 / 2**2, 1 / 5**2])
    noise = np.exp(np.linspace(np.log(1e-3), np.log(1e3), 20001))
    log_weight, means, covs = [], [], []
    for s in noise:
        precision = prior + a.T @ a / s**2
        mean = np.linalg.solve(precision, a.T @ y / s**2)
        # The density of y with the line integrated out, up to a constant; half-Cauchy prior; the step is even in log noise.
        fit = -0.5 * (y @ y / s**2 - mean @ precision @ mean)
        log_weight.append(fit - len(y) * np.log(s) - 0.5 * np.linalg.slogdet(precision)[1] - np.log1p(s**2) + np.log(s))
        means.append(mean)
        covs.append(np.linalg.inv(precision))
    w = np.exp(np.array(log_weight) - max(log_weight))
    w /= w.sum()
    means, covs = np.array(means), np.array(covs)
    mean = w @ means
    cov = np.tensordot(w, covs + np.einsum("ni,nj->nij", means - mean, means - mean), 1)
    s_mean = w @ noise
    out = {
        "slope": {"mean": mean[0], "sd": cov[0, 0] ** 0.5},
        "intercept": {"mean": mean[1], "sd": cov[1, 1] ** 0.5},
        "noise": {"mean": s_mean, "sd": (w @ (noise - s_mean) ** 2) ** 0.5},
    }
    path.with_name("reference.json").write_text(json.dumps(out, indent=2) + "\n")
