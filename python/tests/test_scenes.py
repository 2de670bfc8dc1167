"""Views, pictures and meshes."""

import json
from pathlib import Path

import numpy as np
import pytest

import pcadlang

BALL = """include "std/scene.pcad" as scene;
    assume size ~ uniform(0.5, 1.5);
    assume view = scene.render(scene.affine(scale = size) * scene.sphere(1));
    observe normal(size, 0.1) = 1;"""


@pytest.fixture
def view() -> pcadlang.View:
    """A ball of radius 1."""
    trace = pcadlang.Program.parse(BALL).compile().generate({"size": 1.0})[0]
    return trace.view()


def test_a_view_is_drawn_as_arrays(view: pcadlang.View) -> None:
    mask, depth, normals = view.mask(64), view.depth(64), view.normals(64)
    assert mask.shape == depth.shape == (64, 64) and normals.shape == (64, 64, 3)
    assert mask.dtype == np.bool_ and depth.dtype == normals.dtype == np.float32
    np.testing.assert_array_equal(np.isfinite(depth), mask)
    np.testing.assert_allclose(np.linalg.norm(normals[mask], axis=1), 1, atol=1e-5)
    pieces = view.contours(64)
    radius = np.hypot(pieces[:, 0] - 32, pieces[:, 1] - 32)
    assert pieces.shape[1] == 4 and np.ptp(radius) < 0.5
    assert view.overlay().ndim == 3 and view.overlay().dtype == np.uint8


def test_a_solid_has_a_mesh(view: pcadlang.View) -> None:
    vertices, triangles = view.solid.mesh()
    np.testing.assert_allclose(np.linalg.norm(vertices, axis=1), 1, atol=1e-5)
    assert triangles.max() < len(vertices) and triangles.dtype == np.uint32
    assert view.solid.obj().startswith(("#", "v", "o")) and view.solid.glb()[:4] == b"glTF"
    trimesh = pytest.importorskip("trimesh")
    mesh = pcadlang.to_trimesh(view.solid)
    assert isinstance(mesh, trimesh.Trimesh) and mesh.is_watertight
    assert mesh.volume == pytest.approx(4 / 3 * np.pi, rel=0.02)


def test_photographs_are_paths_pictures_and_arrays(images: Path) -> None:
    pillow = pytest.importorskip("PIL.Image")
    program = pcadlang.Program.open("lathe.pcad").set(tries=5, keep=1)
    path = images / "coffee_cup.png"
    picture = pillow.open(path)
    drawn = [
        program.observe(photo=photo).compile().sample(chains=1, steps=3, warmup=3, seed=1)["H"]
        for photo in (path, str(path), picture, np.asarray(picture.convert("RGB")))
    ]
    for other in drawn[1:]:
        np.testing.assert_array_equal(other, drawn[0])


def test_hints_reach_the_program() -> None:
    text = """include "std/scene.pcad" as scene;
        data photo: image;
        let h = scene.hint(photo);
        assume seen = concat(h.box, h.axis.foot, h.axis.top, [h.axis.width], h.at[0], h.not[1]);
        assume n = len(h.outline) + (if h.drawn { 1 } else { 0 });
        assume x ~ normal(0, 1);"""
    photo = np.zeros((40, 60, 3), np.uint8)
    mask = np.zeros((20, 30), bool)
    mask[5:10] = True
    program = pcadlang.Program.parse(text).observe(photo=photo)
    hinted = program.hint(
        mask=mask,
        outline=[[1, 1], [9, 1], [9, 9]],
        box=[1, 2, 30, 20],
        axis=([5, 30], [6, 3], 8),
        at=np.array([[3, 4]]),
        not_=[[50, 4], [51, 5]],
    )
    trace = hinted.compile().simulate()
    np.testing.assert_array_equal(trace.value("seen"), [1, 2, 30, 20, 5, 30, 6, 3, 8, 3, 4, 51, 5])
    assert trace.value("n") == 4
    with pytest.raises(ValueError, match="outside the photograph of 60 x 40"):
        program.hint(at=[[3, 41]])
    with pytest.raises(ValueError, match="proportions"):
        program.hint(mask=mask.T)
    with pytest.raises(TypeError, match="truth values"):
        program.hint(mask=np.zeros((20, 30)))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="needs a photograph"):
        pcadlang.Program.parse(text).hint(box=[1, 2, 3, 4])


def test_wrong_photographs_are_errors(images: Path) -> None:
    program = pcadlang.Program.open("lathe.pcad")
    for wrong in [3, np.zeros((4, 4)), [1, 2], {"a": 1}]:
        with pytest.raises(TypeError):
            program.observe(photo=wrong)
    for shape in [(4,), (4, 4, 2), (4, 4, 3, 1)]:
        with pytest.raises(ValueError):
            program.observe(photo=np.zeros(shape, np.uint8))
    with pytest.raises(pcadlang.Error):
        program.observe(photo=np.zeros((0, 4, 3), np.uint8))
    with pytest.raises(pcadlang.Error, match="cannot read"):
        program.observe(photo=images / "none.png")
    with pytest.raises(pcadlang.Error):
        program.observe(picture=images / "coffee_cup.png").compile()


def test_a_person_is_fitted_to_a_photograph(images: Path) -> None:
    program = pcadlang.Program.open("human.pcad").set(tries=40, keep=4, climbs=10)
    assert program.params["person"]["type"] == "int" and not program.data["photo"]["optional"]
    model = program.observe(photo=images / "skier.jpg").compile()
    posterior = model.sample(chains=2, steps=20, warmup=20, seed=1)
    view = posterior.best.view()
    assert view.mask(128).any() and "nose" in " ".join(view.solid.landmarks)
    picture = pcadlang.picture(posterior)
    assert picture.size[0] > 100 and picture.mode == "RGB"


def test_cameras_are_dictionaries_or_files(view: pcadlang.View, tmp_path: Path) -> None:
    camera = {
        "model": "orthographic",
        "looks_along": [0, 0, -1],
        "up": [0, 1, 0],
        "image": [40, 20],
        "units_per_pixel": 0.2,
    }
    program = pcadlang.Program.parse(BALL)
    with pytest.raises(pcadlang.Error):
        program.camera({"wide": 3})
    file = tmp_path / "camera.json"
    file.write_text(json.dumps(camera))
    for given in (camera, file):
        assert program.camera(given).compile().simulate().view().size == (40, 20)


def test_pictures_have_sensible_sizes(view: pcadlang.View) -> None:
    for wrong in (0, 10**6):
        with pytest.raises(ValueError):
            view.mask(wrong)
    with pytest.raises(ValueError):
        view.overlay(np.zeros((3, 3), np.uint8))
    with pytest.raises(ValueError, match="64 x 64"):
        view.by_mask(np.zeros(5), 64)
    with pytest.raises(ValueError):
        view.by_contours(np.zeros((3, 4)), 64)
