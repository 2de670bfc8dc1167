"""Jobs on a Ray cluster of several nodes in one machine: nodes are lost, join, and are full."""

import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image
import pytest
from conftest import IMAGES
from numpy.typing import NDArray

import pcadlang
import pcadlang.command

ray = pytest.importorskip("ray")

import pcadlang.ray as on_ray  # noqa: E402
from pcadlang.ray import attempts, jobs  # noqa: E402

# The workers cannot import this file.
ray.cloudpickle.register_pickle_by_value(sys.modules[__name__])

CASES = "abcdef"
OPTIONS: dict[str, Any] = {
    "set": {"size": 32, "tries": 5, "keep": 1},
    "steps": 3000,
    "warmup": 5,
    "chains": 2,
}
TIMES = re.compile(r"seconds|per_second|begun|step_size_seconds")


class Nodes:
    """A cluster whose nodes are processes of this machine."""

    def __init__(self) -> None:
        from ray.cluster_utils import Cluster

        quick = {"health_check_period_ms": 500, "health_check_failure_threshold": 4}
        head = {"num_cpus": 0, "include_dashboard": False, "_system_config": quick}
        self.cluster: Any = Cluster(initialize_head=True, head_node_args=head)
        self.workers: list[Any] = []
        ray.init(address=self.cluster.address, logging_level="warning")

    def add(self, **options: Any) -> Any:
        """Adds a node with one processor."""
        node = self.cluster.add_node(num_cpus=1, **options)
        self.workers.append(node)
        return node

    def kill(self, node: Any) -> None:
        """Kills a node, as a power failure does."""
        self.workers.remove(node)
        self.cluster.remove_node(node, allow_graceful=False)

    def stop(self) -> None:
        """Stops everything."""
        ray.shutdown()
        self.cluster.shutdown()


@pytest.fixture(scope="module")
def head() -> Iterator[Nodes]:
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    nodes = Nodes()
    yield nodes
    nodes.stop()


@pytest.fixture
def nodes(head: Nodes) -> Iterator[Nodes]:
    """A cluster without nodes that work; each test adds its own."""
    yield head
    for node in list(head.workers):
        head.kill(node)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A few small photographs."""
    folder = tmp_path_factory.mktemp("data")
    photo = PIL.Image.open(IMAGES / "coffee_cup.png").convert("RGB")
    for i, name in enumerate(CASES):
        (folder / name).mkdir()
        photo.resize((72 + 4 * i, 80)).save(folder / name / "image.png")
    return folder


@pytest.fixture(scope="module")
def alone(dataset: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results of one machine."""
    out = tmp_path_factory.mktemp("alone") / "out"
    return pcadlang.evaluate("lathe.pcad", dataset, out=out, threads=1, quiet=True, **OPTIONS)


def on_cluster(dataset: Path, out: Path, **options: Any) -> Path:
    """Evaluates with a checkpoint every fifth of a second."""
    return on_ray.evaluate("lathe.pcad", dataset, out=out, checkpoint=0.2, **OPTIONS, **options)


def without_times(path: Path) -> Any:
    """A file without what differs between two runs on one machine."""
    if path.name in ("report.html", "table.md") or path.suffix == ".checkpoint":
        return None
    if path.name == "trajectory.jsonl":
        # States for a film, written on a clock of their own: a run that is killed may lose some.
        return None
    content = path.read_bytes()
    if path.suffix == ".csv":
        return [line for line in content.splitlines() if b"Elapsed Time" not in line]
    if path.name in ("run.json", "summary.json", "evaluation.json"):
        return timeless(json.loads(content))
    return content


def timeless(value: Any) -> Any:
    """JSON without times."""
    if isinstance(value, dict):
        return {k: timeless(v) for k, v in value.items() if not TIMES.search(k)}
    return [timeless(v) for v in value] if isinstance(value, list) else value


def assert_same(found: Path, expected: Path) -> None:
    """Compares two folders bit for bit, times left out."""
    names = [
        sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file())
        for folder in (found, expected)
    ]
    assert names[0] == names[1]
    for name in names[0]:
        assert without_times(found / name) == without_times(expected / name), name


def test_a_node_is_killed_and_others_join(
    nodes: Nodes, dataset: Path, alone: Path, tmp_path: Path
) -> None:
    first, out = nodes.add(), tmp_path / "out"
    seen: list[on_ray.Progress] = []
    # Nodes can be added by the main thread only.
    driver = threading.Thread(
        target=on_cluster, args=(dataset, out), kwargs={"progress": seen.append}
    )
    driver.start()
    while not seen or not list(out.glob(".attempts/*/*/chain-1.checkpoint")):
        assert driver.is_alive()
        time.sleep(0.01)
    nodes.kill(first)
    nodes.add()
    nodes.add()
    driver.join(300)
    assert_same(out, alone)
    done = [p for p in seen if p.event == "done"]
    assert sorted(p.key for p in done) == list(CASES)
    assert [p.done for p in done] == [1, 2, 3, 4, 5, 6]
    assert any(p.event == "lost" for p in seen)
    assert len({p.node for p in done}) == 3, "nodes that join late work, too"
    # The command keeps everything: it is a folder of its own.
    pcadlang.evaluate("lathe.pcad", dataset, out=out, threads=1, **OPTIONS)
    assert_same(out, alone)


def test_a_driver_is_killed_and_starts_again(
    nodes: Nodes, dataset: Path, alone: Path, tmp_path: Path
) -> None:
    nodes.add()
    nodes.add()
    out = tmp_path / "out"
    code = f"""
import pathlib, ray, test_ray
ray.init(address={nodes.cluster.address!r}, logging_level="warning")
test_ray.on_cluster(pathlib.Path({str(dataset)!r}), pathlib.Path({str(out)!r}))
"""
    with subprocess.Popen([sys.executable, "-c", code], cwd=Path(__file__).parent) as driver:
        until = time.monotonic() + 120
        while sum(attempts.state(out / c) == "done" for c in CASES) < 2:
            assert driver.poll() is None and time.monotonic() < until
            time.sleep(0.02)
        driver.send_signal(signal.SIGKILL)
    done = {c: (out / c / "run.json").stat().st_ino for c in CASES if (out / c).exists()}
    assert 2 <= len(done) < len(CASES)
    seen: list[on_ray.Progress] = []
    on_cluster(dataset, out, progress=seen.append)
    assert_same(out, alone)
    assert {c: (out / c / "run.json").stat().st_ino for c in done} == done, "nothing is done twice"
    assert sorted([*done, *(p.key for p in seen if p.event == "done")]) == list(CASES)


def heavy(shared: int, item: int) -> NDArray[np.int64]:
    return np.full(shared, item)


def test_an_object_store_is_full(nodes: Nodes) -> None:
    nodes.add(object_store_memory=80 << 20)
    taken = {}

    def take(key: str, result: NDArray[np.int64]) -> None:
        time.sleep(0.2)
        assert (result == int(key)).all()
        taken[key] = result.nbytes

    # Eight results of 32 MiB are more than the node has room for: Ray spills them.
    tasks = {str(i): i for i in range(8)}
    jobs.drive(heavy, 4 << 20, tasks, take, at_once=8)
    assert taken == dict.fromkeys(tasks, 32 << 20)


def crash(shared: Path, item: int) -> int:
    (shared / str(time.time_ns())).touch()
    if item == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    if item == 2:
        raise pcadlang.CommandError("no such program")
    return item


def test_a_task_that_kills_its_worker_is_given_up_and_an_error_is_raised(
    nodes: Nodes, tmp_path: Path
) -> None:
    nodes.add()
    with pytest.raises(on_ray.Lost, match="1 was lost 3 times"):
        jobs.drive(crash, tmp_path, {"1": 1}, lambda key, result: None, retries=2)
    assert len(list(tmp_path.iterdir())) == 3
    with pytest.raises(pcadlang.CommandError, match="no such program"):
        jobs.drive(crash, tmp_path, {"2": 2}, lambda key, result: None)

    def interrupt(_: object) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        tasks = {str(i): i for i in range(3, 99)}
        jobs.drive(crash, tmp_path, tasks, lambda key, result: None, progress=interrupt)
    assert len(list(tmp_path.iterdir())) < 20, "the other tasks are cancelled"


def test_no_more_tasks_are_in_flight_than_there_is_room_for(nodes: Nodes, tmp_path: Path) -> None:
    nodes.add()
    seen: list[on_ray.Progress] = []
    tasks = {str(i): 10 * i for i in range(8)}
    take: list[str] = []
    jobs.drive(
        crash, tmp_path, tasks, lambda key, _: take.append(key), at_once=3, progress=seen.append
    )
    assert sorted(take) == sorted(tasks) and max(p.running for p in seen) == 2
    assert jobs.Room(1, None).tasks() >= jobs.AHEAD


def test_cases_that_fail_are_recorded_and_changed_settings_are_an_error(
    nodes: Nodes, dataset: Path, tmp_path: Path
) -> None:
    nodes.add()
    broken = tmp_path / "data"
    shutil.copytree(dataset / "a", broken / "a")
    (broken / "b").mkdir()
    (broken / "b" / "image.png").write_bytes(b"no picture")
    out = tmp_path / "out"
    with pytest.raises(pcadlang.CommandError, match="1 of 2 cases failed: b"):
        on_cluster(broken, out)
    rows = json.loads((out / "evaluation.json").read_bytes())["cases"]
    assert [row["status"] for row in rows] == ["done", "failed"] and "image" in rows[1]["error"]
    shutil.copy(dataset / "b" / "image.png", broken / "b" / "image.png")
    seen: list[on_ray.Progress] = []
    on_cluster(broken, out, progress=seen.append)
    assert [p.key for p in seen] == ["b"]
    with pytest.raises(pcadlang.CommandError, match="different settings: seed"):
        on_cluster(broken, out, seed=2)


def test_an_attempt_goes_on_from_the_checkpoint_of_another(dataset: Path, tmp_path: Path) -> None:
    work, target, line = tmp_path / "work", tmp_path / "target", [sys.executable, "-m", "pcadlang"]
    line += ["run", "lathe.pcad", "--observe", str(dataset / "a" / "image.png"), "--threads", "1"]
    options = {**OPTIONS, "steps": 6000, "checkpoint": "100ms", "resume": True, "quiet": True}
    line += pcadlang.command.arguments(options)

    def killed(made: Path) -> None:
        with subprocess.Popen([*line, "--out", str(made)]) as process:
            while not list(made.glob("chain-*.checkpoint")):
                assert process.poll() is None
                time.sleep(0.01)
            process.kill()
        raise pcadlang.CommandError("killed")

    def whole(made: Path) -> None:
        assert (made / "chain-1.checkpoint").exists() == bool(attempts.latest(work))
        subprocess.run([*line, "--out", str(made)], check=True)

    with pytest.raises(pcadlang.CommandError):
        attempts.complete(work, target, killed)
    assert attempts.latest(work) and not target.exists()
    attempts.complete(work, target, whole)
    attempts.complete(work, tmp_path / "expected", whole)
    assert_same(target, tmp_path / "expected")
    # A late attempt changes nothing.
    before = (target / "run.json").stat().st_ino
    attempts.complete(work, target, whole)
    assert (target / "run.json").stat().st_ino == before


def test_texts_of_several_nodes_have_the_same_numbers() -> None:
    from pcadlang.ray.chains import Groups, joined

    def node(codes: list[float], texts: list[str]) -> Groups:
        draw = (["draw"], np.arange(2))
        kind = (["chain", "draw"], np.array([codes]))
        level = (["kind_level"], np.array(texts))
        return {"posterior": {"draw": draw, "kind_level": level, "kind": kind}}

    both = joined([node([0, 1], ["cup", "vase"]), node([1, 0], ["lamp", "cup"])])["posterior"]
    assert both["kind_level"][1].tolist() == ["cup", "vase", "lamp"]
    assert both["kind"][1].tolist() == [[0, 1], [0, 2]]
    missing = joined([node([0, np.nan], ["cup"]), node([0, 0], ["lamp"])])["posterior"]
    np.testing.assert_array_equal(missing["kind"][1], [[0, np.nan], [1, 1]])


def test_chains_on_nodes_are_those_of_one_process(nodes: Nodes, tmp_path: Path) -> None:
    nodes.add()
    text = "assume w ~ mv_normal([0, 0], [[1, 0], [0, 1]]); observe normal(w[0], 1) = [1, 2] as y;"
    settings: dict[str, Any] = {"chains": 3, "steps": 50, "seed": 4}
    model = pcadlang.Program.parse(text).compile()
    expected = model.sample(**settings)
    for kept in (0, 3):
        seen: list[on_ray.Progress] = []
        recipe = on_ray.Recipe(text=text)
        found = on_ray.sample(recipe, out=tmp_path, progress=seen.append, **settings)
        assert len(seen) == 3 - kept
        ours, theirs = found.groups(), expected.groups()
        assert {g: list(a) for g, a in ours.items()} == {g: list(a) for g, a in theirs.items()}
        for group, arrays in theirs.items():
            for name, (dims, array) in arrays.items():
                assert ours[group][name][0] == dims
                np.testing.assert_array_equal(ours[group][name][1], array, strict=True)
        assert found.best(model).save() == expected.best.save()
        assert found.names == ["w"] and found["w"].shape == expected["w"].shape
    with pytest.raises(pcadlang.CommandError, match="other settings"):
        on_ray.sample(on_ray.Recipe(text=text), out=tmp_path, chains=3, steps=51, seed=4)


def test_a_bank_in_shards_is_that_of_one_machine(nodes: Nodes, tmp_path: Path) -> None:
    options = subprocess.run(
        [sys.executable, "-m", "pcadlang", "learn", "--help"], capture_output=True, check=True
    )
    if b"--first" not in options.stdout:
        pytest.skip("the command has no `learn --first`")
    nodes.add()
    expected = tmp_path / "expected.bank"
    pcadlang.command.call("learn", ["lathe_parts.pcad", "-n", "23"], {"out": expected, "seed": 3})
    found = on_ray.learn("lathe_parts.pcad", out=tmp_path / "found.bank", n=23, shard=5, seed=3)
    assert found.read_bytes() == expected.read_bytes()
    assert not (tmp_path / "found.bank.shards").exists()


def test_a_trade_off_has_the_errors_of_one_machine(nodes: Nodes, tmp_path: Path) -> None:
    nodes.add()
    cases = Path(__file__).parents[2] / "examples" / "cases" / "linreg"
    settings = tmp_path / "settings.json"
    plan = {"base": {"steps": 200}, "vary": {"chains": [1, 2]}, "cross": {"warmup": [50, 60]}}
    settings.write_text(json.dumps(plan))
    options: dict[str, Any] = {"cases": cases, "settings": settings, "threads": 1, "seeds": 2}
    alone = pcadlang.tradeoff("linreg.pcad", out=tmp_path / "alone", jobs=1, **options)
    together = tmp_path / "together"
    for kept in (0, 12):
        seen: list[on_ray.Progress] = []
        on_ray.tradeoff("linreg.pcad", out=together, progress=seen.append, **options)
        assert len(seen) == 12 - kept
        of = [errors(folder) for folder in (alone, together)]
        assert of[0] == of[1] and len(of[0]) == 24


def errors(folder: Path) -> dict[tuple[str, str, int], Any]:
    """What does not depend on time, by run."""
    runs = [json.loads(line) for line in (folder / "runs.jsonl").read_text().splitlines()]
    found = {(r["setting"], r["case"], r["seed"]): (r["scores"], r["steps"]) for r in runs}
    assert len(found) == len(runs), "no run is there twice"
    return found


@pytest.mark.slow
def test_nodes_are_killed_in_twenty_runs(
    nodes: Nodes,
    dataset: Path,
    alone: Path,
    tmp_path: Path,
    request: pytest.FixtureRequest,
    capsys: pytest.CaptureFixture[str],
) -> None:
    if "slow" not in str(request.config.getoption("markexpr")):
        pytest.skip("run with -m slow")
    nodes.add()
    nodes.add()
    killed = lost = 0
    for run in range(20):
        draw, seen, ended = random.Random(run), list[on_ray.Progress](), list[Path]()

        def work(out: Path, seen: list[on_ray.Progress] = seen, ended: list[Path] = ended) -> None:
            ended.append(on_cluster(dataset, out, progress=seen.append))

        # Nodes can be added by the main thread only.
        thread = threading.Thread(target=work, args=(tmp_path / str(run),))
        thread.start()
        for _ in range(2):
            thread.join(draw.uniform(1, 6))
            if thread.is_alive():
                nodes.kill(draw.choice(nodes.workers))
                killed += 1
                nodes.add()
        thread.join(120)
        assert ended, "nothing is lost"
        assert_same(ended[0], alone)
        assert sorted(p.key for p in seen if p.event == "done") == list(CASES)
        lost += sum(p.event == "lost" for p in seen)
        with capsys.disabled():
            print(f"run {run + 1}: {killed} nodes killed, {lost} attempts lost, 0 differ")
    assert killed >= 20 and lost > 0
