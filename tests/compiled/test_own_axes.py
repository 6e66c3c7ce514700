"""Bodies of rods in axes of their own: their motion is that of the file's, whatever axes the file has."""

from dataclasses import replace

import numpy as np
import pytest

import hybridyn
from benchmarks.operations import total
from hybridyn.compiled.code.scalars import GUARD_LIMIT
from hybridyn.compiled.equations.chains import Chain, sweep
from hybridyn.compiled.equations.expressions import numbers, zeros
from hybridyn.compiled.equations.idle.motion import idle_motions, lines_of_balls
from hybridyn.compiled.equations.own_axes import own_positions, own_rates, rates_in_file
from hybridyn.compiled.equations.request import request
from hybridyn.compiled.equations.rigid import Links, aligned, axes_of, links_of
from hybridyn.compiled.equations.states import random_states
from hybridyn.compiled.programs.direct import direct_program
from hybridyn.compiled.programs.inverse import inverse_program
from hybridyn.compiled.programs.whole_robot import function_of, programs
from hybridyn.structure.building import build_robot
from hybridyn.structure.parameters.chosen import Parameters
from tests.compiled import rods
from tests.support.samples import slow


@pytest.mark.parametrize("digits", [16, 3], ids=["rotations", "rounded"])
def test_bodies_in_axes_of_their_own_move_as_those_of_the_file(digits: int) -> None:
    """Placements of rounded numbers are no rotations: they stay beside the quaternion of the ball."""
    robot = build_robot(rods.ball_gough(1))
    m, q = robot.modules[0].mechanism, numbers(robot.modules[0].mechanism.postures[0])
    lines = lines_of_balls(m, idle_motions(m, ()), [""] * m.tree.nv, m.spec.outputs)
    links = {i: replace(x, R=np.round(x.R, digits)) for i, x in links_of(m.spec.tree).items()}
    turns = axes_of(links, m.spec.outputs, lines)
    own = aligned(links, turns, lines, m.length)
    assert sum(link.ball is not None for link in own.values()) == len(lines) == 6
    v, a = numbers(np.random.default_rng(0).normal(size=(2, m.tree.nv)))
    before = moved(links, q, v, a)
    after = moved(own, own_positions(own, q), own_rates(own, v), own_rates(own, a))
    for body in before.V:
        T = turns[body]
        for X, Y in ((before.R0[body] @ T, after.R0[body]), (before.p0[body], after.p0[body])):
            assert np.abs(X - Y).max() < 1e-14  # a few roundings of lengths near one
        for X, Y in ((before.V[body], after.V[body]), (before.c[body], after.c[body])):
            assert np.abs(np.concatenate([T.T @ X[:3], T.T @ X[3:]]) - Y).max() <= 1e-12 * np.abs(X).max()
    assert np.abs(rates_in_file(own, own_rates(own, v)) - v).max() < 1e-15


def moved(links: Links, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> Chain:
    """Compute the motion of links on a base at rest from numbers."""
    return sweep(links, q, v, zeros(6), a, zeros(6))


@pytest.mark.parametrize("name", ["crank", slow("ball_gough")])
def test_models_of_rods_on_balls_take_fewer_operations_than_on_universal_joints(name: str) -> None:
    """The axes of rods in files are random here, and cost a rotation of their coordinates alone."""
    asked = [request(build_robot(getattr(rods, name)(1, foot)), None) for foot in ("ball", "universal")]
    for program in (inverse_program, direct_program):
        ball, universal = (total(program(one)) for one in asked)
        assert ball < 0.75 * universal


@pytest.mark.parametrize(
    ("name", "kind", "turn"), [("crank", "spherical", 0.3), ("slides", "spherical", 0.0)]
)
def test_placements_of_balls_are_arguments_of_models(name: str, kind: str, turn: float) -> None:
    """What an argument turns is multiplied where it is known, beside the quaternion of the ball."""
    robot = build_robot(getattr(rods, name)(2))
    joint = next(x.name for x in robot.description.joints if "rod" in x.name and x.kind == "spherical")
    parameters = Parameters(robot.description, [f"rotation:{joint}"])
    program = programs(robot, None, models=("ddm",), parameters=parameters.slots)["ddm"]
    values = parameters.nominal + turn
    design = robot.with_parameters({f"rotation:{joint}": values})
    q, v, _, tau = random_states(design, 3)
    given = parameters.slot_values(values[None])[0]
    for sample, wanted in zip(zip(q, v, tau, strict=True), hybridyn.ddm(design, q, v, tau), strict=True):
        found, guard = function_of(program)(*sample, given)
        assert float(guard) <= GUARD_LIMIT
        assert np.abs(np.array(found).ravel() - wanted).max() <= 1e-10 * np.abs(wanted).max()
