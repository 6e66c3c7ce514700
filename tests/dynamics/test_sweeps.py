"""What calls cost: a trajectory is swept once, motions are handed on; loops of single calls are advised."""

import itertools
import warnings
from collections import Counter
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled import repeated
from hybridyn.description.shipped import find_robot
from hybridyn.dynamics.direct import direct_model
from hybridyn.dynamics.inverse import inverse_model
from hybridyn.effects import LoadFriction
from hybridyn.linkage.tree import Tree
from hybridyn.structure.mechanism import Mechanism


@pytest.mark.parametrize("name", ["five_bar", "lx4"])
def test_each_module_is_swept_once(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """And the models return the residual of their states."""
    robot = hybridyn.load(find_robot(name))
    q, v, a = hybridyn.assemble(
        robot, motors={m: (np.linspace(0.0, 0.01, 3), 0.1, 0.2) for m in robot.motors}
    )
    placed: list[int] = []
    own = Tree._placements

    def counted(tree: Tree, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        placed.append(id(tree))
        return own(tree, q)

    monkeypatch.setattr(Tree, "_placements", counted)
    found = inverse_model(robot, q, v, a)
    assert len(placed) == len(robot.modules)  # the spanning tree
    placed.clear()
    direct = direct_model(robot, q, v, found.values)
    assert len(placed) == 2 * len(robot.modules)  # and the tree after the cuts, at x_ddot = 0
    assert np.array_equal(found.residual, hybridyn.closure_residual(robot, q))
    assert np.array_equal(direct.residual, found.residual)


@pytest.mark.parametrize("name", ["five_bar", "lx4"])
def test_friction_that_grows_with_load_sweeps_no_module_again(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = hybridyn.load(find_robot(name))
    q, v, a = hybridyn.assemble(robot, motors=dict.fromkeys(robot.motors, (0.0, 0.1, 0.2)))
    word = "radial" if name == "five_bar" else "normal"
    rubbing = ["default", LoadFriction(**{word: dict.fromkeys(robot.motors, 1e-3)})]
    counts = Counter[str]()
    for kind, method in ((Tree, "_placements"), (Mechanism, "basis")):
        own = getattr(kind, method)

        def counted(*given: Any, own: Any = own, method: str = method, **more: Any) -> Any:
            counts[method] += 1
            return own(*given, **more)

        monkeypatch.setattr(kind, method, counted)
    hybridyn.idm(robot, q, v, a, effects=rubbing)  # what a module keeps is computed at first
    counts.clear()
    hybridyn.idm(robot, q, v, a)
    without = counts.copy()
    counts.clear()
    hybridyn.idm(robot, q, v, a, effects=rubbing)
    assert counts == without


def test_many_single_calls_are_warned_of_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(repeated, "MANY_CALLS", 3)
    monkeypatch.setattr(repeated, "_general_calls", itertools.count(1))
    robot = hybridyn.load("five_bar")
    still, tau = np.zeros(robot.nv), np.zeros(2)
    hybridyn.idm(robot, *np.zeros((3, 9, robot.nv)) + robot.home * np.array([1, 0, 0])[:, None, None])
    hybridyn.idm(robot, robot.home, still, still)
    hybridyn.ddm(robot, robot.home, still, tau)
    with pytest.warns(hybridyn.PerformanceWarning, match=r"hybridyn\.compile\(robot\)") as caught:
        hybridyn.ddm(robot, robot.home, still, tau)
    assert caught[0].filename == __file__  # the line of the caller, not of hybridyn
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        hybridyn.ddm(robot, robot.home, still, tau)
