"""Redundant loops that agree up to the rounding of their file are compiled, with the rank decided at load.

Rows that depend on others count like these, as in the general path.
"""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn.compiled.code.scalars import GUARD_LIMIT
from hybridyn.compiled.equations.states import random_states
from hybridyn.compiled.failures import difference
from hybridyn.compiled.verifying import verify
from hybridyn.effects.choice import choose
from hybridyn.spatial import Array
from hybridyn.structure.building import build_robot
from tests.robots.mechanisms import random_mechanism
from tests.support.samples import slow
from tests.support.written_out import Interpreted

#: Both paths balance all rows, and neglect the square of the file's rounding through the condition of the
#: rows; postures have other conditions than the median.
FILES = 10.0
#: Rounding of the arithmetic.
ROUNDING = 1e-12


def rounded(kind: str, seed: int, digits: int) -> hybridyn.HybridRobot:
    """Draw a mechanism with redundant loops whose file has so many digits."""
    exact = random_mechanism(seed, kind=kind)

    def written(T: Array) -> Array:
        """Round a frame as files do: its origin and its rotation vector."""
        turn = pin.exp3(np.round(pin.log3(T[:3, :3]), digits))
        return pin.SE3(turn, np.round(T[:3, 3], digits)).homogeneous

    joints = tuple(replace(j, placement=written(j.placement)) for j in exact.joints)
    closures = tuple(
        replace(c, frame_a=written(c.frame_a), frame_b=written(c.frame_b)) for c in exact.closures
    )
    return build_robot(replace(exact, joints=joints, closures=closures))


@pytest.mark.parametrize(
    ("kind", "seed", "digits"),
    [
        ("four_bar", 0, 7),
        ("four_bar", 1, 5),
        ("four_bar", 2, 4),
        *(slow("delta_bars", seed, 7 + seed) for seed in range(3)),
        *(slow("delta_bars", seed, 5) for seed in range(3)),
        slow("scara_delta", 0, 8),
    ],
)
def test_models_are_those_of_the_general_path_to_the_rounding(kind: str, seed: int, digits: int) -> None:
    robot = rounded(kind, seed, digits)
    (m,) = (module.mechanism for module in robot.modules if module.mechanism.reduction.rounded)
    rounding, neglected = m.rounding, (m.rounding / m.reduction.report.kept) ** 2
    assert 10.0**-digits / 4 < rounding < 10.0 ** (2 - digits)
    models = Interpreted(robot, ("idm", "ddm"))
    verify(models, robot, choose(robot, None))
    q, v, a, tau = random_states(robot, 8)
    for name, last, wanted in (("idm", a, hybridyn.idm(robot, q, v, a)), ("ddm", tau, a)):
        (found,), guard = models.batch(name, q, v, last)
        assert (guard <= GUARD_LIMIT).all()
        assert difference(found, wanted).max() <= ROUNDING + FILES * neglected
    open_by = q + max(1e-4, 100 * rounding) * np.random.default_rng(0).choice([-1.0, 1.0], size=q.shape)
    _, guard = models.batch("idm", open_by, v, a)
    assert not (guard <= GUARD_LIMIT).any()
