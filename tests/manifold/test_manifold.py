"""The manifold of assembled postures: rows against `Closures`, charts, projection, and moves on joints."""

from itertools import pairwise

import numpy as np
import pytest

from hybridyn import closure_residual
from hybridyn.errors import AssemblyError
from hybridyn.joints.kinds import JointKind
from hybridyn.linkage.retraction import Retraction
from hybridyn.manifold.manifold import Manifold
from hybridyn.structure.building import build_robot
from hybridyn.structure.robot import HybridRobot
from tests.robots.mechanisms import random_mechanism, random_states
from tests.robots.shipped import shipped
from tests.support.comparing import ROUNDING, SOLVED, close_to, refused
from tests.support.samples import CHOSEN, some

KINDS = (
    "loop_fixed", "loop_cylindrical", "loop_planar", "loop_rows_y_perpendicular", "loop_rows_xz_parallel",
    "five_bar", "gough", "delta_bars", "gear_across", "gear_rack", "stack", "on_leg", "serial_all",
)  # fmt: skip
CLOSED = 1e-11  # the project's claim is 1e-10
STEP = 1e-6  # of central differences
DIFFERENCE = 1e-7  # what they leave: rounding of 1e-13 over the step
AWAY = 0.05  # how far charts are followed, rad or module lengths


def state_of(kind: str, base: str = "fixed") -> tuple[HybridRobot, np.ndarray, np.ndarray]:
    """Return a random robot with a state."""
    description = random_mechanism(0, kind=kind)
    q, v, _ = random_states(description, base, 0, 1)  # type: ignore[arg-type]
    return build_robot(description, base=base), q[0], v[0]  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", some(KINDS, (*CHOSEN, "loop_rows_y_perpendicular")))
def test_rows_are_those_of_the_closures(kind: str) -> None:
    robot, q, _ = state_of(kind)
    rng = np.random.default_rng(1)
    for module, rows in Manifold(robot).looped:
        m = module.mechanism
        x = m.spanning.integrate(q[None, module.q_index], 0.01 * rng.normal(size=(1, m.spanning.nv)))[0]
        motion, closures = m.spanning.sweep(x[None]), m.spanning_closures
        residual, K = rows.at(x)
        scales = (m.spanning_row_scale, m.spanning_col_scale)
        close_to(residual, closures.residual(x[None], motion)[0] * scales[0], ROUNDING)
        close_to(K, closures.matrix(motion, scales)[0], ROUNDING)


@pytest.mark.parametrize("kind", some(KINDS))
def test_charts_hold_every_motion_and_close_every_loop(kind: str) -> None:
    robot, q, v = state_of(kind, "floating")
    manifold = Manifold(robot)
    chart = manifold.chart(q)
    assert chart.size == robot.mobility
    u = chart.independent(v)
    close_to(chart.at_origin(u), v, SOLVED)
    y = AWAY * np.random.default_rng(2).normal(size=chart.size)
    posture = chart.lift(y, u)
    assert closure_residual(robot, posture.q) <= CLOSED
    assert manifold.opening(posture.q, posture.v)[0] <= CLOSED
    close_to(chart.independent(posture.xi), y, SOLVED)
    close_to(chart.independent(posture.v), u, SOLVED)


@pytest.mark.parametrize("kind", ["five_bar", "gough", "stack", "serial_all"])
def test_rates_are_the_derivative_of_positions(kind: str) -> None:
    robot, q, _ = state_of(kind, "floating")
    manifold = Manifold(robot)
    chart = manifold.chart(q)
    y, y_dot = AWAY * np.random.default_rng(3).normal(size=(2, chart.size))
    ends = [chart.lift(y + s * STEP * y_dot, y_dot) for s in (-1, 1)]
    rate = (ends[1].xi - ends[0].xi) / (2 * STEP)
    middle = chart.lift(y, y_dot)
    close_to(chart.independent(rate), y_dot, DIFFERENCE)
    close_to(chart.rates(chart.independent(manifold.retraction.push(middle.xi, rate))),
             manifold.retraction.push(middle.xi, rate), DIFFERENCE)  # fmt: skip


def test_projection_closes_and_changes_least() -> None:
    robot = build_robot(shipped("gough_stewart"))
    manifold, rng = Manifold(robot), np.random.default_rng(4)
    q = robot.home + 1e-3 * rng.normal(size=robot.nq)
    v = rng.normal(size=robot.nv)
    closed, kept = manifold.project(q, v)
    assert manifold.residual(closed)[0] <= CLOSED < manifold.residual(q)[0]
    assert manifold.opening(closed, kept)[0] <= CLOSED < manifold.opening(closed, v)[0]
    again = manifold.project(closed, kept)
    close_to(again[0], closed, SOLVED)
    close_to(again[1], kept, SOLVED)
    tangent = manifold.chart(closed).at_origin(np.eye(6)) / manifold.unit[:, None]
    assert (
        np.abs(tangent.T @ ((v - kept) / manifold.unit)).max() <= SOLVED
    )  # what went was across the manifold


def test_postures_out_of_reach_name_the_module() -> None:
    robot = build_robot(shipped("five_bar"))
    chart = Manifold(robot).chart(robot.home)
    words, module = r"m1_right_lower.*out of reach", "m1_right_lower"
    refused(lambda: chart.lift(np.array([30.0, 20.0]), np.zeros(2)), AssemblyError, words, module=module)


# -------------------------------------------------------------------- moves on joints

ALL = ("revolute", "continuous", "prismatic", "spherical", "planar", "floating")


def moves(kinds: tuple[str, ...]) -> tuple[Retraction, np.ndarray, int]:
    """Return the moves of some joints with a random posture and the number of freedoms."""
    at = np.cumsum([0] + [JointKind(k).nq for k in kinds]), np.cumsum([0] + [JointKind(k).nv for k in kinds])
    slices = [[slice(int(x), int(y)) for x, y in pairwise(a)] for a in at]
    retraction = Retraction([JointKind(kind) for kind in kinds])
    q = np.zeros(int(at[0][-1]))
    for kind, where in zip(kinds, slices[0], strict=True):
        if kind == "continuous":
            q[where.start] = 1
        elif kind == "planar":
            q[where.start + 2] = 1
        elif kind in ("spherical", "floating"):
            q[where.stop - 1] = 1
    nv = int(at[1][-1])
    return retraction, retraction.move(q, np.random.default_rng(6).normal(size=nv)), nv


@pytest.mark.parametrize("size", [1e-6, 1e-2, 1.0])
def test_moves_and_their_rates(size: float) -> None:
    retraction, q, nv = moves(ALL)
    rng = np.random.default_rng(7)
    xi, rate = size * rng.normal(size=nv), rng.normal(size=nv)
    moved = retraction.move(q, xi)
    close_to(retraction.difference(q, moved), xi, 1e-9)  # of turns as small as 1e-6
    v = retraction.push(xi, rate)
    close_to(retraction.pull(xi, v), rate, ROUNDING)
    ahead, behind = (retraction.move(q, xi + s * STEP * rate) for s in (1, -1))
    by_difference = (retraction.difference(moved, ahead) - retraction.difference(moved, behind)) / (2 * STEP)
    close_to(v, by_difference, DIFFERENCE)


def test_the_posture_halfway_sees_both_ends_alike() -> None:
    retraction, q, nv = moves(ALL)
    xi = np.random.default_rng(8).normal(size=nv)
    to = retraction.move(q, xi)
    half = retraction.centred(xi) / 2
    # Halfway: turn by half of xi; then both ends lie at plus and minus `half` from there.
    middle = retraction.move(to, -half)
    turns = [x for x in range(nv) if abs(half[x] - xi[x] / 2) < 1e-15]
    assert len(turns) == nv - 5  # all but the translations of the planar and the floating joint
    # A step back from the end by -half turns first and shifts in the end's axes, so positions are put in by
    # hand.
    for at, rows in ((slice(8, 10), slice(6, 8)), (slice(12, 15), slice(9, 12))):
        middle[at] = (q[at] + to[at]) / 2
        assert half[rows].any()
    close_to(retraction.move(middle, half), to, ROUNDING)
    close_to(retraction.move(middle, -half), q, ROUNDING)
