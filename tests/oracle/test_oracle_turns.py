"""Residuals of couplings between continuous joints, whose positions count whole turns."""

from __future__ import annotations

import numpy as np
import pytest

from hybridyn.description.records import Coupling, Description, Joint, Link
from tests.comparing import ROUNDING
from tests.oracle import Oracle
from tests.sketch import Sketch

WOUND = 1e2 * ROUNDING  # angles of many turns lose digits


def geared(*ratios: float) -> Oracle:
    """Return the oracle of wheels on one shaft, coupled by ratios."""
    links = [Link("base", 0.0, np.zeros(3), np.zeros((3, 3)))]
    links += [Link(f"w{i}", 1.0, np.zeros(3), np.eye(3)) for i in range(len(ratios))]
    joints = [
        Joint(f"j{i}", "continuous", "base", f"w{i}", np.eye(4), np.array([0.0, 0.0, 1.0]))
        for i in range(len(ratios))
    ]
    terms = tuple((f"j{i}", ratio) for i, ratio in enumerate(ratios))
    return Oracle(Description("geared", tuple(links), tuple(joints), (), (Coupling("gear", terms, 0.3),)))


@pytest.mark.parametrize("ratios", [(1.0, 3.14), (0.558, 1.0), (2.0, 3.0), (1.0, 2.37, -0.4), (2.0,)])
def test_a_wound_posture_is_closed(ratios: tuple[float, ...]) -> None:
    rng = np.random.default_rng(1)
    oracle = geared(*ratios)
    for _ in range(10):
        angles = 20.0 * rng.uniform(-1.0, 1.0, len(ratios))
        angles[0] = (0.3 - np.dot(ratios[1:], angles[1:])) / ratios[0]
        assert abs(oracle.residual(angles)[0]) <= WOUND


def test_no_posture_on_another_turn_is_closed() -> None:
    oracle = geared(1.0, 3.14)
    for turns in range(-60, 61):
        q = np.array([0.3 + 0.06 + 2 * np.pi * turns, 0.0])
        assert abs(oracle.residual(q)[0] - 0.06 - 2 * np.pi * turns) <= WOUND


def test_bearings_that_hold_nothing_more_leave_every_motion() -> None:
    """Rows that are zero to rounding are dependent, though none is larger."""
    sketch = Sketch(np.random.default_rng(0))
    axis = sketch.direction()
    sliding = sketch.joint("prismatic", "base", np.zeros(3), axis)
    sketch.close("prismatic", "base", sliding, axis, axis)
    oracle = Oracle(sketch.description("drawer"))
    q = np.array(sketch.home[sliding.removesuffix("_link")])
    assert 0 < np.abs(oracle.rows(q)).max() < ROUNDING
    assert oracle.motions(q).shape == (1, 1)
