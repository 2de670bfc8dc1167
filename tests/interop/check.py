"""Opens the folders of runs with ArviZ and CmdStanPy, and compares what they say with what the runs say."""

import json
import re
import sys
import warnings
from glob import glob

import arviz as az
import cmdstanpy
import numpy as np
import xarray as xr

# Of image scores two "observations" are all there is, and Pareto k says so.
warnings.filterwarnings("ignore", message="Estimated shape parameter of Pareto")
warnings.filterwarnings("ignore", message="The group .* not found")
warnings.filterwarnings("ignore", category=RuntimeWarning)
warnings.filterwarnings("ignore", category=FutureWarning)
warnings.filterwarnings("ignore", category=UserWarning)

OLD = az.__version__.startswith("0.")


def close(what, a, b, tolerance=1e-6):
    """Fails unless two numbers are the same, or both are none."""
    a = np.nan if a is None else float(a)
    b = np.nan if b is None else float(b)
    if not (np.isnan(a) and np.isnan(b)) and abs(a - b) > tolerance * max(1.0, abs(a), abs(b)):
        sys.exit(f"{what}: {a} is not {b}")


def parts(store):
    """The quantities under their names in the files of chains: the fields of a record one by one."""
    posterior = store["posterior"]
    for name, variable in posterior.data_vars.items():
        plain = re.sub(r"[\W_]+", "_", name).rstrip("_") if re.search(r"\W|__", name) else name
        field = f"{name}_field"
        if field in variable.dims:
            for f in variable[field].values:
                yield f"{plain}_{f}", variable.sel({field: f})
        else:
            yield plain + ("_" if plain in ("next", "in") else ""), variable


def dimensions(data):
    return {k: int(v) for k, v in data["posterior"].sizes.items() if k in ("chain", "draw")}


def check(run):
    files = sorted(glob(f"{run}/chain-*.csv"))
    fit = cmdstanpy.from_csv(files)
    stan = az.from_cmdstanpy(fit)
    csv = az.from_cmdstan(files) if OLD else stan
    tree = xr.open_datatree(f"{run}/inference.zarr", engine="zarr")
    store = az.InferenceData.from_datatree(tree) if OLD else tree
    with open(f"{run}/summary.json") as f:
        said = json.load(f)["quantities"]
    if not dimensions(csv) == dimensions(stan) == dimensions(store):
        sys.exit(f"{run}: {dimensions(csv)} draws in the files of chains, {dimensions(store)} in the store")

    # The same numbers, bit by bit, all ways.
    compared = 0
    for name, variable in parts(store):
        draws = variable.values
        for where, other in [("ArviZ", csv["posterior"]), ("CmdStanPy", stan["posterior"])]:
            np.testing.assert_array_equal(other[name].values, draws, err_msg=f"{run}: {name} by {where}")
        np.testing.assert_array_equal(fit.stan_variable(name), draws.reshape(-1, *draws.shape[2:]), err_msg=name)
        compared += 1
    if compared == 0 or compared < len(store["posterior"].data_vars):
        sys.exit(f"{run}: only {compared} quantities were compared")

    # The summaries of the run, of scalars and of elements of arrays.
    for key, ours in said.items():
        found = re.fullmatch(r"(\w+)(?:\[([\d,]+)\])?", key)
        if not found or found[1] not in store["posterior"].data_vars or "most_frequent" in ours:
            continue
        at = tuple(int(i) for i in found[2].split(",")) if found[2] else ()
        x = store["posterior"][found[1]].values[(..., *at)]
        close(f"{run}: mean of {key}", ours["mean"], x.mean(), 1e-9)
        if ours["r_hat"] is not None and ours["ess_tail"] is not None:
            data = az.convert_to_dataset({"x": x}) if OLD else az.from_dict({"posterior": {"x": x}})
            table = az.summary(data, kind="diagnostics", round_to="none")
            close(f"{run}: bulk size of {key}", ours["ess_bulk"], table["ess_bulk"].iloc[0])
            # The quantile is numpy's: that of ArviZ 0.23 may round to just below draws that are all equal (findings).
            tail = min(
                np.asarray(az.ess(xr.Dataset({"x": (("chain", "draw"), 1.0 * (x <= q))}), method="mean")["x"]).item()
                for q in np.quantile(x, (0.05, 0.95))
            )
            close(f"{run}: tail size of {key}", ours["ess_tail"], tail)
            # Of an odd number of draws `arviz.rhat`, and the summary of ArviZ 1, drop the middle one before the
            # ranks are taken; the summary of ArviZ 0.23, whose choice ours is, does not.
            if OLD or x.shape[1] % 2 == 0:
                close(f"{run}: R-hat of {key}", ours["r_hat"], table["r_hat"].iloc[0])
    stats = store["sample_stats"]
    np.testing.assert_array_equal(stats["lp"].values, csv["sample_stats"]["lp"].values)
    diverging = stats["diverging"].values.sum()
    close(f"{run}: divergences", diverging, csv["sample_stats"]["diverging"].values.sum())

    # Tables, plots and loo, from both.
    for data in (csv, store):
        posterior = data["posterior"]
        names = [n for n, v in posterior.data_vars.items() if not np.isnan(v.values).any()]
        if len(az.summary(data, var_names=names)) == 0:
            sys.exit(f"{run}: an empty summary")
        if OLD:
            az.plot_trace(data, var_names=names[:3])
        else:
            az.plot_trace(data, var_names=names[:3], backend="matplotlib")
    if run.endswith("/line") and not (stats["step_size"].values > 0).all():
        sys.exit(f"{run}: no step sizes of NUTS")
    # A slow machine makes a few draws of a picture in ten seconds; ArviZ 1.3 wants five in the tail.
    enough = store["posterior"].sizes["chain"] * store["posterior"].sizes["draw"] >= 100
    loo = az.loo(store) if enough else None
    elpd = float("nan") if loo is None else loo.elpd_loo if OLD else loo.elpd
    total = store["log_likelihood"]["observed"].sum("observation").values
    # The factors of lathe.pcad, about its box and the frame, are no observations.
    if not run.endswith("/lathe"):
        np.testing.assert_allclose(total, stats["log_likelihood_sum"].values, rtol=1e-9, atol=1e-9)
    if OLD and enough:
        close(f"{run}: elpd_loo", elpd, az.loo(csv).elpd_loo, 1e-9)
    labels = store["log_likelihood"]["observation"].values.tolist()
    if store["observed_data"]["observed"].shape != (len(labels),):
        sys.exit(f"{run}: {len(labels)} names of observed values")
    if run.endswith("/shapes"):
        shapes(store["posterior"], fit)
    print(f"{run.rsplit('/', 1)[-1]}: {dimensions(store)}, elpd_loo {float(elpd):.2f}, of {labels[:3]}")


def shapes(posterior, fit):
    """What tests/interop/shapes.pcad says about itself."""
    a = posterior["a"].values
    assert posterior["R"].dims[2:] == ("R_dim_0", "R_dim_1") and posterior["R"].shape[2:] == (3, 3)
    np.testing.assert_array_equal(posterior["R"].values[..., 1, 1], 4 * a)
    np.testing.assert_array_equal(posterior["R"].values[..., 0, 2], np.full_like(a, 2))
    assert fit.stan_variable("R").shape[1:] == (3, 3) and fit.stan_variable("stack").shape[1:] == (3, 2, 2)
    np.testing.assert_array_equal(fit.stan_variable("R")[:, 1, 0], 3)
    np.testing.assert_array_equal(fit.stan_variable("stack")[:, 0, 1, 0], 3)
    assert posterior["P_field"].values.tolist() == ["x", "y"]
    np.testing.assert_array_equal(posterior["parts"].sel(parts_field="h").values[..., 2], 3 * a)
    kinds = posterior["kind_level"][posterior["kind"]].values
    np.testing.assert_array_equal(kinds, np.where(a > 0, "thin = vase", "cup"))


print(f"ArviZ {az.__version__}, CmdStanPy {cmdstanpy.__version__}")
for run in sys.argv[1:]:
    check(run)
