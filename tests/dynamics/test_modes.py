"""Linkages with modes of different mobility: that of home's mode counts, and another one is refused."""

from dataclasses import replace

import numpy as np
import pytest

import hybridyn
from hybridyn import SingularityError
from hybridyn.description.records import Description
from hybridyn.structure.building import build_robot
from tests.hard.degenerate import scissors
from tests.oracle import Oracle
from tests.support.comparing import refused


def two_modes(turns: tuple[float, float], spread: float) -> tuple[Description, np.ndarray]:
    """Return a lift whose bars lie on each other, two bars in a row, and a posture that spreads them instead.

    Args:
        turns: How far each stage is turned from upright, against the one below [rad].
        spread: How far the bars of the posture are from upright [rad].
    """
    upright = scissors(2, np.pi / 2)
    names = sorted(upright.home, key=lambda name: int(name[1 : name.index("_")]))

    def moved(*by: float) -> dict[str, tuple[float, ...]]:
        return {name: (upright.home[name][0] + x,) for name, x in zip(names, by, strict=True)}

    first, second = turns
    folded, spread_out = (
        moved(0, first, first, second, second),
        moved(np.sin(spread), -spread, spread, -2 * spread, 2 * spread),
    )
    q = np.concatenate([spread_out[name] for name in Oracle(upright).joint_names])
    return replace(upright, home=folded), q


def test_a_posture_in_a_mode_of_fewer_freedoms_is_refused() -> None:
    """Home's mode counts; in another one its two freedoms would be wrong."""
    description, q = two_modes((0.4, 0.5), 0.3)
    robot, oracle = build_robot(description), Oracle(description)
    assert np.abs(oracle.residual(q)).max() < 1e-14
    assert robot.mobility == 2
    assert oracle.motions(q).shape[1] == 1
    rest = np.zeros(robot.nv)
    for call in (
        lambda: hybridyn.idm(robot, q, rest, rest),
        lambda: hybridyn.idm(robot, q, rest, rest, on_singular="least-norm"),
        lambda: hybridyn.ddm(robot, q, rest, np.zeros(1)),
        lambda: hybridyn.mass_matrix(robot, q, joints=["w2_revolute", "t4_revolute"]),
    ):
        error = refused(call, SingularityError, "another mode of the linkage")
        assert error.what == "closures"


@pytest.mark.slow
def test_compiled_models_refuse_it_too() -> None:
    description, q = two_modes((0.4, 0.5), 0.3)
    model, rest = hybridyn.compile(build_robot(description)), np.zeros(5)
    for call in (lambda: model.idm(q, rest, rest), lambda: model.ddm(q, rest, np.zeros(1))):
        refused(call, SingularityError, "another mode of the linkage")
