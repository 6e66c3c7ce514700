"""Postures that close: how much work it is to find them; neither work saved nor keeping changes one."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.description.cache_folder import folder
from hybridyn.linkage import generic_postures as searching
from hybridyn.linkage import newton
from hybridyn.linkage.generic_postures import FOLDER, generic_postures, kept_generic_postures
from hybridyn.linkage.loop_problem import LoopProblem
from hybridyn.linkage.newton import close
from hybridyn.structure import mechanism
from hybridyn.structure.building import build_robot
from hybridyn.threads import VARIABLES, _controller, one_thread
from tests.hard.degenerate import parallelograms
from tests.linkage.jansen import walker
from tests.support.comparing import refused
from tests.support.files import save

COUNT = 24
pytestmark = pytest.mark.usefixtures("built_anew")


@pytest.fixture
def solved(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many systems are solved, call by call."""
    counts: list[int] = []
    solve = LoopProblem.solve

    def counting(self: LoopProblem, K: np.ndarray, *rest: np.ndarray) -> np.ndarray:
        counts.append(len(K))
        return solve(self, K, *rest)

    monkeypatch.setattr(LoopProblem, "solve", counting)
    return counts


def load(tmp_path: Path, text: str) -> hybridyn.HybridRobot:
    return hybridyn.load(save(tmp_path, text, "walker.urdf"))


def test_a_robot_that_cannot_be_assembled_is_refused_soon(tmp_path: Path, solved: list[int]) -> None:
    """Before, its 720 starts took 60 steps each, twice: 86,400 systems."""
    refused(
        lambda: load(tmp_path, walker(1, stretch=5.0)), hybridyn.AssemblyError, "no posture closes its loops"
    )
    assert sum(solved) < 720 * (newton.PATIENCE + 4) + COUNT * 60


def test_a_walker_written_with_few_digits_loads_soon(tmp_path: Path, solved: list[int]) -> None:
    """Axes off by 8e-5: the legs close to 1e-4, in few postures; before, 43,000 systems, twice."""
    robot = load(tmp_path, walker(1, tilt=4e-5))
    assert robot.mobility == 1
    assert sum(solved) < 43_000 / 3


def test_a_walker_far_from_home_finds_neighbours(tmp_path: Path, solved: list[int]) -> None:
    robot = load(tmp_path, walker(2, offset=1.5))
    (module,) = robot.modules
    m = module.mechanism
    assert robot.mobility == 1
    assert len(m.postures) == COUNT
    assert np.abs(m.closures.residual(m.postures, m.tree.sweep(m.postures))).max() < 1e-12


@pytest.mark.parametrize("angle", [1.0, 0.1, 1e-3])
def test_a_long_row_of_parallelograms_loads_soon(angle: float, solved: list[int]) -> None:
    """The flatter, the longer it took: 5,908 systems at the last. Steps of walks close in a few each."""
    robot = build_robot(parallelograms(10, angle))
    assert robot.modules[0].mechanism.tree.nv >= searching.LARGE
    assert robot.mobility == 1
    assert sum(solved) < 6 * 10 * 6


def test_a_long_search_is_told_with_its_reason(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Loading took minutes without a word; a closed home away from singular postures is silent."""
    monkeypatch.setattr(searching, "LARGE", 1)
    monkeypatch.setattr(searching, "WORTH_KEEPING", 1000)
    build_robot(parallelograms(2, 0.3))
    assert "takes up to minutes" not in caplog.text
    build_robot(parallelograms(2, 0.0))
    assert "takes up to minutes. A home with closed loops" in caplog.text


@pytest.mark.parametrize("name", ["five_bar", "delta", "scara_delta", "tanev"])
def test_postures_of_shipped_robots_keep_their_bits(name: str) -> None:
    """Against the first of 48 starts that close when none is given up."""
    for module in hybridyn.load(name).modules:
        m = module.mechanism
        if not m.closures.rows:
            continue
        scales = m.reduction.row_scale, m.reduction.col_scale
        problem = LoopProblem(m.closures, *scales, np.ones(m.tree.nv, dtype=bool))
        noise = np.random.default_rng(2010).uniform(-0.15, 0.15, (2 * COUNT, m.tree.nv)) * scales[1]
        starts = m.tree.integrate(np.tile(m.home, (2 * COUNT, 1)), noise)
        closed = close(problem, starts, least=True)
        good = (closed.residual <= 1e-4) & (closed.step < 1e-6)
        assert np.array_equal(m.postures, closed.q[good][:COUNT])


def test_equal_modules_are_worked_out_once(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[int] = []
    search = mechanism.kept_generic_postures
    monkeypatch.setattr(
        mechanism, "kept_generic_postures", lambda *a, **k: calls.append(1) or search(*a, **k)
    )
    robot = hybridyn.load("lx4")
    assert len(calls) == len({id(m.mechanism) for m in robot.modules})


@pytest.fixture
def pools(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """The pools of threads of this process, without a user's own rule for them."""
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)
    _controller.cache_clear()
    yield pytest.importorskip("threadpoolctl")
    _controller.cache_clear()


def of_blas(pools: Any) -> set[int]:
    return {p["num_threads"] for p in pools.threadpool_info() if p["user_api"] == "blas"}


def test_small_matrices_start_no_threads(pools: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    threads: list[int] = []
    search = mechanism.kept_generic_postures

    def watched(*arguments: object, **options: object) -> object:
        threads.extend(pool["num_threads"] for pool in pools.threadpool_info())
        return search(*arguments, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(mechanism, "kept_generic_postures", watched)
    with pools.threadpool_limits(limits=2, user_api="blas"):
        hybridyn.load("five_bar")
        assert of_blas(pools) == {2}
    assert threads
    assert set(threads) == {1}
    with one_thread():
        assert of_blas(pools) == {1}


def test_overlapping_calls_restore_the_number_of_threads(pools: Any) -> None:
    """The second call begins within the first and ends after it: its start must not look like the rule."""
    with pools.threadpool_limits(limits=2, user_api="blas"):
        first, second = one_thread(), one_thread()
        first.__enter__()
        second.__enter__()
        first.__exit__(None, None, None)
        assert of_blas(pools) == {1}
        second.__exit__(None, None, None)
        assert of_blas(pools) == {2}


def entries() -> list[Path]:
    return sorted((folder() / FOLDER).glob("*"))


def test_kept_postures_are_those_of_the_search(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HYBRIDYN_CACHE", str(tmp_path))
    monkeypatch.setattr(searching, "WORTH_KEEPING", 1)
    searched: list[Any] = []

    def counting(*given: Any) -> Any:
        """Search, and count it."""
        searched.append(given)
        return generic_postures(*given)

    monkeypatch.setattr(searching, "generic_postures", counting)
    first = hybridyn.load("five_bar").modules[0].mechanism
    again = hybridyn.load("five_bar").modules[0].mechanism
    assert len(searched) == len(entries()) == 1
    assert np.array_equal(first.postures, again.postures)
    assert first.best_residual == again.best_residual
    wanted, _ = generic_postures(*searched[0])
    assert np.array_equal(again.postures, wanted)
    closures, home, *rest = searched[0]
    kept_generic_postures(closures, np.nextafter(home, 4.0), *rest)
    assert len(searched) == len(entries()) == 2


def test_small_modules_are_not_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HYBRIDYN_CACHE", str(tmp_path))
    hybridyn.load("five_bar")
    assert not entries()
