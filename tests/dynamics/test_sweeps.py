"""A trajectory is swept once: the dynamics compute each module's motion once and hand it on."""

import numpy as np
import pytest

import hybridyn
from hybridyn.description.shipped import find_robot
from hybridyn.dynamics.direct import direct_model
from hybridyn.dynamics.inverse import inverse_model
from hybridyn.linkage.tree import Tree


@pytest.mark.parametrize("name", ["five_bar", "lx4"])
def test_each_module_is_swept_once(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = hybridyn.load(find_robot(name))
    q, v, a = hybridyn.assemble(robot, motors={m: (np.zeros(3), 0.1, 0.2) for m in robot.motors})
    placed: list[int] = []
    own = Tree._placements

    def counted(tree: Tree, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        placed.append(id(tree))
        return own(tree, q)

    monkeypatch.setattr(Tree, "_placements", counted)
    found = inverse_model(robot, q, v, a)
    assert len(placed) == len(robot.modules)  # the spanning tree
    placed.clear()
    direct_model(robot, q, v, found.values)
    assert len(placed) == 2 * len(robot.modules)  # and the tree after the cuts, at x_ddot = 0


@pytest.mark.parametrize("name", ["five_bar", "lx4"])
def test_models_return_the_residual_of_their_states(name: str) -> None:
    robot = hybridyn.load(find_robot(name))
    q, v, a = hybridyn.assemble(
        robot, motors={m: (np.linspace(0.0, 0.01, 3), 0.0, 0.0) for m in robot.motors}
    )
    found = inverse_model(robot, q, v, a)
    assert np.array_equal(found.residual, hybridyn.closure_residual(robot, q))
    assert np.array_equal(direct_model(robot, q, v, found.values).residual, found.residual)
