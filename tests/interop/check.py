"""Opens the folders of runs with ArviZ and compares what it says with what the runs say."""

import json
import sys
import warnings
from glob import glob

import arviz as az
import numpy as np
import xarray as xr

# Of image scores two "observations" are all there is, and Pareto k says so.
warnings.filterwarnings("ignore", message="Estimated shape parameter of Pareto")
warnings.filterwarnings("ignore", message="The group .* not found")
warnings.filterwarnings("ignore", category=RuntimeWarning)
warnings.filterwarnings("ignore", category=FutureWarning)


def close(what, a, b, tolerance=1e-6):
    """Fails unless two numbers are the same, or both are none."""
    a = np.nan if a is None else float(a)
    b = np.nan if b is None else float(b)
    if not (np.isnan(a) and np.isnan(b)) and abs(a - b) > tolerance * max(1.0, abs(a), abs(b)):
        sys.exit(f"{what}: {a} is not {b}")


def check(run):
    csv = az.from_cmdstan(sorted(glob(f"{run}/chain-*.csv")))
    store = az.InferenceData.from_datatree(xr.open_datatree(f"{run}/inference.zarr", engine="zarr"))
    with open(f"{run}/summary.json") as f:
        said = json.load(f)["quantities"]
    chains = csv.posterior.sizes["chain"], csv.posterior.sizes["draw"]
    if chains != (store.posterior.sizes["chain"], store.posterior.sizes["draw"]):
        sys.exit(f"{run}: {chains} draws in the files of chains, {dict(store.posterior.sizes)} in the store")

    # The same numbers both ways, and the summaries of the run.
    compared = 0
    for name, variable in store.posterior.data_vars.items():
        other = csv.posterior.get(name.replace(".", "/"))
        if other is None or other.shape != variable.shape:
            continue
        np.testing.assert_array_equal(other.values, variable.values, err_msg=f"{run}: {name}")
        key = name.replace(".", "/")
        if variable.ndim == 2 and key in said:
            close(f"{run}: mean of {name}", said[key]["mean"], variable.values.mean(), 1e-9)
            if said[key]["r_hat"] is not None:
                # `arviz.rhat` drops the middle one of an odd number of draws before it takes the median;
                # `arviz.summary`, whose choice ours is, does not.
                r_hat = az.summary({"x": variable.values}, kind="diagnostics", round_to="none")["r_hat"].iloc[0]
                close(f"{run}: R-hat of {name}", said[key]["r_hat"], r_hat, 1e-6)
            compared += 1
    if compared == 0:
        sys.exit(f"{run}: nothing was compared")
    stats = store.sample_stats
    np.testing.assert_array_equal(stats["lp"].values, csv.sample_stats["lp"].values)
    close(f"{run}: divergences", stats["diverging"].values.sum(), csv.sample_stats["diverging"].values.sum())

    # Tables, plots and loo, from both.
    for data in (csv, store):
        names = [n for n, v in data.posterior.data_vars.items() if not np.isnan(v.values).any()]
        table = az.summary(data, var_names=names)
        if len(table) == 0:
            sys.exit(f"{run}: an empty summary")
        az.plot_trace(data, var_names=names[:3])
    if run.endswith("/line") and not (stats["step_size"].values > 0).all():
        sys.exit(f"{run}: no step sizes of NUTS")
    loo = az.loo(store)
    total = store.log_likelihood["observed"].sum("observation").values
    # The factors of lathe.pcad, about its box and the frame, are no observations.
    if not run.endswith("/lathe"):
        np.testing.assert_allclose(total, stats["log_likelihood_sum"].values, rtol=1e-9, atol=1e-9)
    again = az.loo(csv)
    close(f"{run}: elpd_loo", loo.elpd_loo, again.elpd_loo, 1e-9)
    labels = store.log_likelihood["observation"].values.tolist()
    if store.observed_data["observed"].shape != (len(labels),):
        sys.exit(f"{run}: {len(labels)} names of observed values")
    print(f"{run.rsplit('/', 1)[-1]}: {chains[0]} x {chains[1]} draws, elpd_loo {loo.elpd_loo:.2f}, of {labels[:3]}")


for run in sys.argv[1:]:
    check(run)
