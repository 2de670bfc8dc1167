"""Results in the forms that other libraries expect. Each is imported when it is needed."""

from typing import TYPE_CHECKING, Any, Protocol

from pcadlang._native import Posterior, Solid, Trace, View

if TYPE_CHECKING:
    import numpy
    import numpy.typing


class Grouped(Protocol):
    """What has draws in ArviZ's groups: a `Posterior`, the chains of a cluster."""

    def groups(self) -> "dict[str, dict[str, tuple[list[str], numpy.typing.NDArray[Any]]]]":
        """The arrays of each group by name, with the names of their dimensions."""
        ...


def to_arviz(posterior: Grouped) -> Any:
    """The posterior as ArviZ has it, with coordinates.

    The groups are `posterior`, `sample_stats` and, with observations, `log_likelihood` and
    `observed_data`: those that the command writes as `inference.zarr`.

    Returns:
        An `xarray.DataTree`; with ArviZ before 1.0, an `arviz.InferenceData`.

    Raises:
        ImportError: if ArviZ is not installed (`pip install pcadlang[arviz]`).
    """
    import arviz
    import xarray

    from pcadlang._native import __version__

    about = {"inference_library": "pcadlang", "inference_library_version": __version__}
    groups: dict[str, Any] = {}
    for name, arrays in posterior.groups().items():
        coordinates = {n: v for n, (dims, v) in arrays.items() if dims == [n]}
        variables = {n: (dims, v) for n, (dims, v) in arrays.items() if n not in coordinates}
        groups[name] = xarray.Dataset(variables, coords=coordinates, attrs=about)
    # ArviZ 1 has the old name too: it stands for the tree, which is made another way.
    if arviz.__version__.startswith("0."):
        return arviz.InferenceData(**groups)
    return xarray.DataTree.from_dict(groups)


def to_trimesh(solid: Solid) -> Any:
    """The solid as a `trimesh.Trimesh`, in scene units, y up.

    Raises:
        ImportError: if trimesh is not installed (`pip install pcadlang[meshes]`).
    """
    import trimesh

    vertices, triangles = solid.mesh()
    return trimesh.Trimesh(vertices=vertices, faces=triangles, process=False)


def picture(
    of: View | Trace | Posterior, photo: "numpy.typing.NDArray[numpy.uint8] | None" = None
) -> Any:
    """The scene drawn over a photograph, as a picture of PIL.

    Args:
        of: A view, or the trace or posterior (its best state) that has one.
        photo: height x width x 3 bytes; by default the one that the trace observes.

    Raises:
        ImportError: if Pillow is not installed (`pip install pcadlang[pictures]`).
    """
    import PIL.Image

    trace = of.best if isinstance(of, Posterior) else of
    view = trace.view() if isinstance(trace, Trace) else trace
    if photo is None and isinstance(trace, Trace):
        photo = trace.photo
    return PIL.Image.fromarray(view.overlay(photo))
