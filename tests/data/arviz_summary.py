"""Makes arviz_summary.json: draws of many shapes with what ArviZ says of them.

    pip install arviz==0.23.4 && python arviz_summary.py

`r_hat` and the rest are arviz.summary's own numbers, unrounded; `r_hat_split` is arviz.rhat, which folds after splitting
and so differs where the number of draws is odd. NaN is written as null.
"""
import json
import pathlib

import arviz
import numpy as np
from arviz.stats.diagnostics import _ess_mean, _ess_quantile, _multichain_statistics, _rhat_rank
from arviz.stats.stats_utils import quantile

rng = np.random.default_rng(20)


def ar1(chains, draws, rho):
    x = rng.normal(size=(chains, draws))
    for t in range(1, draws):
        x[:, t] = rho * x[:, t - 1] + np.sqrt(1 - rho * rho) * x[:, t]
    return x


def metropolis(chains, draws, sd):
    x = np.zeros((chains, draws))
    now = rng.normal(size=chains)
    for t in range(draws):
        new = now + sd * rng.normal(size=chains)
        accept = np.log(rng.uniform(size=chains)) < (now**2 - new**2) / 2
        now = np.where(accept, new, now)
        x[:, t] = now
    return x


cases = {
    'independent, 4 chains of 100': rng.normal(size=(4, 100)),
    'independent, 1 chain of 100': rng.normal(size=(1, 100)),
    'independent, 2 chains of 101': rng.normal(3, 2, size=(2, 101)),
    'independent, 3 chains of 64': rng.uniform(size=(3, 64)),
    'autocorrelated, 4 chains of 250': ar1(4, 250, 0.9),
    'autocorrelated, 1 chain of 333': ar1(1, 333, 0.97),
    'antithetic, 4 chains of 120': ar1(4, 120, -0.8),
    'antithetic, 2 chains of 57': ar1(2, 57, -0.3),
    'metropolis, 2 chains of 300': metropolis(2, 300, 2.4),
    'metropolis, 4 chains of 99': metropolis(4, 99, 0.2),
    'heavy tails, 4 chains of 200': rng.standard_cauchy(size=(4, 200)),
    'heavy tails, 2 chains of 75': rng.standard_t(1.5, size=(2, 75)),
    'one chain elsewhere': rng.normal(size=(4, 80)) + np.array([[0], [0], [0], [3]]),
    'one chain wider': rng.normal(size=(4, 80)) * np.array([[1], [1], [1], [6]]),
    'one chain stuck': np.vstack([rng.normal(size=(3, 60)), np.full((1, 60), 0.25)]),
    'trend': rng.normal(size=(2, 90)) + np.linspace(0, 4, 90),
    'binary': (rng.uniform(size=(4, 150)) < 0.3).astype(float),
    'counts': rng.poisson(3, size=(2, 131)).astype(float),
    'large offset': 1e6 + rng.normal(size=(4, 70)),
    'tiny scale': 1e-9 * rng.normal(size=(2, 50)),
    'constant': np.full((4, 40), 2.5),
    'constant, odd, one chain': np.full((1, 41), -1.0),
    'each chain constant': np.repeat([[0.0], [1.0]], 30, axis=1),
    'four draws': rng.normal(size=(2, 4)),
    'five draws': rng.normal(size=(3, 5)),
    'six draws': rng.normal(size=(1, 6)),
    'seven draws': rng.normal(size=(4, 7)),
    'nine draws, autocorrelated': ar1(2, 9, 0.9),
    'three draws': rng.normal(size=(4, 3)),
    'not a number': np.where(np.arange(50) == 20, np.nan, rng.normal(size=(2, 50))),
}

out = []
for name, x in cases.items():
    null = lambda v: float(v) if np.isfinite(v) else None
    with np.errstate(all='ignore'):
        mcse_mean, mcse_sd, bulk, tail, r_hat = _multichain_statistics(x)
        q = [np.nan] * 3 if np.isnan(x).any() else [float(quantile(x, p)[0]) for p in (0.05, 0.5, 0.95)]
        out.append(dict(
            name=name, chains=[[null(v) for v in c] for c in x],
            mean=null(x.mean()), sd=null(x.std(ddof=1)), q05=null(q[0]), q50=null(q[1]), q95=null(q[2]),
            mcse_mean=null(mcse_mean), mcse_sd=null(mcse_sd), ess_bulk=null(bulk), ess_tail=null(tail), r_hat=null(r_hat),
            r_hat_split=null(_rhat_rank(x)), ess_mean=null(_ess_mean(x)), ess_q25=null(_ess_quantile(x, 0.25))))
doc = dict(arviz=arviz.__version__, numpy=np.__version__, cases=out)
path = pathlib.Path(__file__).with_name('arviz_summary.json')
path.write_text(json.dumps(doc).replace('{"name"', '\n{"name"') + '\n')
