"""What each closure holds and leaves free, by its record, and what counts as closed."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from hybridyn.description.records import Closure, Description, Joint, Link
from tests.comparing import ROUNDING, refused
from tests.judging import drawn
from tests.oracle import Oracle
from tests.sketch import CLOSURES, Sketch


@pytest.mark.parametrize("kind", CLOSURES)
def test_closures_hold_what_their_record_says(kind: str) -> None:
    """Move B from a closed placement: something is missed except along what the record leaves free."""
    translations, rotation = CLOSURES[kind]
    rng, pi = np.random.default_rng(0), np.pi
    frames = [pin.exp6(rng.normal(size=6)).homogeneous for _ in range(2)]
    closure = Closure("c", kind, "base", frames[0], "body", frames[1], translations, rotation)
    links = tuple(Link(name, 1.0, np.zeros(3), np.eye(3)) for name in ("base", "body"))
    joint = Joint("j", "floating", "base", "body", np.eye(4), np.array([0.0, 0.0, 1.0]))
    oracle = Oracle(Description("two", links, (joint,), (closure,)))

    def missed(A_to_B: pin.SE3) -> float:
        body = pin.SE3(frames[0]) * A_to_B * pin.SE3(frames[1]).inverse()
        return float(np.abs(oracle.residual(pin.SE3ToXYZQUAT(body))).max(initial=0.0))

    z = np.array([0.0, 0.0, 1.0])
    start = {
        "free": pin.exp3(rng.normal(size=3)),
        "perpendicular": pin.exp3(0.7 * z) @ pin.exp3(np.array([pi / 2, 0, 0])) @ pin.exp3(0.4 * z),
        "parallel": pin.exp3(0.7 * z),
        "fixed": np.eye(3),
    }[rotation]
    z_B = start @ z
    turns = {
        "free": (list(np.eye(3)), []),
        "perpendicular": ([z, z_B], [np.cross(z, z_B)]),
        "parallel": ([z], [np.array([1.0, 0, 0]), np.array([0, 1.0, 0])]),
        "fixed": ([], list(np.eye(3))),
    }[rotation]
    at = np.array([0.0 if i in translations else 0.3 * i + 0.1 for i in range(3)])
    assert missed(pin.SE3(start, at)) <= ROUNDING
    for i in range(3):
        moved = missed(pin.SE3(start, at + 0.2 * np.eye(3)[i]))
        assert moved == pytest.approx(0.2) if i in translations else moved <= ROUNDING
    for free, axes in zip((True, False), turns, strict=True):
        for axis in axes:
            moved = missed(pin.SE3(pin.exp3(0.3 * axis) @ start, at))
            assert moved <= ROUNDING if free else moved == pytest.approx(np.sin(0.3))


def test_loops_out_of_reach_and_turned_axes_are_no_closure() -> None:
    description, _, ((q, _), _, _) = drawn("four_bar", "fixed")
    closure, far = description.closures[0], np.eye(4)
    far[0, 3] = 5.0
    unreachable = replace(description, closures=(replace(closure, frame_b=closure.frame_b @ far),))
    refused(lambda: Oracle(unreachable).close(q), ValueError, "do not close")
    back = closure.frame_b @ np.diag([1.0, -1.0, -1.0, 1.0])
    turned = replace(description, closures=(replace(closure, frame_b=back),))
    assert np.abs(Oracle(description).residual(q)).max() <= ROUNDING
    assert Oracle(turned).residual(q).min() == pytest.approx(-1.0)
    refused(lambda: Oracle(turned).close(q), ValueError, "do not close")


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
