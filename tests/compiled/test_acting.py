"""Wrenches on links, as arguments and by contact with the ground, are those of the general path."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.code.scalars import GUARD_LIMIT
from hybridyn.compiled.equations.acting import acting_on
from hybridyn.compiled.equations.request import request
from hybridyn.compiled.equations.states import moving_states
from hybridyn.compiled.exporting import export
from hybridyn.compiled.programs.designs import changed
from hybridyn.effects import Bushings, GravityCompensation, GroundContact, LineSprings
from hybridyn.structure.building import build_robot
from hybridyn.structure.parameters.chosen import Parameters
from hybridyn.structure.robot import HybridRobot
from tests.compiled.test_export import run_test
from tests.oracle import Base
from tests.robots.mechanisms import KINDS, random_mechanism
from tests.support.comparing import close_to, refused
from tests.support.samples import slow
from tests.support.written_out import Interpreted

#: Of the largest: rounding, times the condition of the motions.
SAME = 1e-10
STATES = 3


def taking(robot: HybridRobot) -> list[str]:
    """Return the links on which compiled models take wrenches."""
    out = []
    for link in robot.bodies.place:
        try:
            acting_on(robot, link)
        except hybridyn.ModelError:
            continue
        out.append(link)
    return out


def contact(links: list[str]) -> GroundContact:
    """Return a contact of two points of each link, so deep in the ground that most of them touch it."""
    points = {link: [[0.0, 0.0, 0.0], [0.1, 0.05, -0.1]] for link in links}
    return GroundContact(points, 300.0, 0.2, 0.6, width=0.05, height=3.0)


def laws(links: list[str]) -> list[Any]:
    """Return every law of wrenches that follow the motion of links, on two links."""
    points = [[0.1, 0.0, 0.2], [0.3, -0.2, 0.4]]
    frames = [[0.1, 0.0, 0.2, 0.0, 0.6, 0.0, 0.8], [0.3, -0.2, 0.4, 0.48, 0.6, 0.0, 0.64]]
    threes: list[Any] = [{"b": x} for x in ([3, 2, 4], [0.3, 0.1, 0.2], [30, 20, 10], [3, 4, 2])]
    return [
        contact(links), GravityCompensation(dict.fromkeys(links, 0.7)),
        LineSprings({"l": links}, {"l": points}, {"l": 30.0}, {"l": 3.0}, {}, {}, {"l": 0.3}),
        Bushings({"b": links}, {"b": frames}, *threes),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "base"),
    [
        (slow if (kind, base) != ("five_bar", "floating") else pytest.param)(kind, base)
        for kind in ("five_bar", "delta", "lx4", *sorted({*KINDS} - {"five_bar", "sps_thin"}))
        for base in ("fixed", "moving", "floating")
    ],
)
def test_forces_are_those_of_the_general_path(kind: str, base: Base) -> None:
    """On some links of outputs and of legs; wrenches are about as large as the robot's weight.

    Not on rods without inertia about their lines, which a torque about these turns infinitely fast.
    """
    made = build_robot(random_mechanism(2, kind=kind, base=base), base=base) if kind in KINDS else None
    robot = made or hybridyn.load(kind, base=base)
    rng = np.random.default_rng(0)
    links = [*rng.permutation(taking(robot))[:4]]
    effects = ["default", *laws(links[:2])]
    models = Interpreted(robot, ("idm", "ddm"), effects, wrenches=links)
    q, v, tau = moving_states(robot, STATES)
    given = rng.normal(size=(STATES, len(links), 6))
    acting: Any = {"effects": effects, "wrenches": {link: given[:, i] for i, link in enumerate(links)}}
    rows = given.reshape(STATES, -1)
    a = hybridyn.ddm(robot, q, v, tau, **acting)
    more = [np.zeros((STATES, 6))] if base == "moving" else []
    (found,), guard = models.batch("ddm", q, v, tau, *more, rows)
    good = guard <= GUARD_LIMIT
    assert good.any()
    assert np.abs(found - a)[good].max() <= SAME * np.abs(a).max()
    (found,), guard = models.batch("idm", q, v, a, rows)
    good = guard <= GUARD_LIMIT
    if all(len(m.motors) == m.mobility for m in robot.modules[base == "floating" :]):
        assert good.any()
        assert np.abs(found - tau)[good].max(initial=0.0) <= SAME * np.abs(tau).max(initial=1.0)


def test_links_without_motion_are_refused() -> None:
    robot = hybridyn.load("five_bar")
    wrong = {"m1_tol": "did you mean", robot.description.root: "the base does not move by forces"}
    for link, words in wrong.items():
        asked = request(robot, None, wrenches=[link])
        refused(lambda asked=asked: asked.given_wrenches, hybridyn.ModelError, words)


@pytest.mark.slow
def test_a_robot_that_stands_is_exported(tmp_path: Path) -> None:
    """The inverse model of a free base takes the ground's wrenches; the reference is the general path's."""
    robot = hybridyn.load("five_bar", base="floating")
    feet = ["m1_tool", "m1_base"]
    export(robot, tmp_path, ["default", contact(["m1_tool"])], name="bar", wrenches=feet)
    header = (tmp_path / "bar.h").read_text()
    assert "0..5  m1_tool" in header
    assert "a must be a motion that weight" in header
    printed = run_test(tmp_path, "bar")
    for model in ("idm", "ddm", "idm_from_motors"):
        assert f"{model} 4: guard" in printed


@pytest.mark.slow
def test_steps_with_contact_are_those_of_the_general_path() -> None:
    robot = hybridyn.load("five_bar", base="floating")
    effects = ["default", contact(["m1_tool"])]
    compiled = hybridyn.compile(robot, effects)
    runs = [
        hybridyn.simulate(
            robot, robot.home, np.zeros(robot.nv), (0.0, 1e-3), effects=effects, method="rk4", step=1e-4,
            compiled=model,
        )
        for model in (None, compiled)
    ]  # fmt: skip
    assert compiled.recomputed == 0
    for name in ("q", "v"):
        close_to(getattr(runs[1], name)[-1], getattr(runs[0], name)[-1], 1e-7)


def test_forces_follow_parameters() -> None:
    """Masses that weights follow, and placements that move points of the laws in their bodies."""
    robot = hybridyn.load("five_bar")
    links = ["m1_tool", "m1_left_upper"]
    effects = ["default", *laws(links)]
    names = ["mass:m1_left_upper", "centre:m1_left_upper", "position:m1_tool_mount"]
    parameters = Parameters(robot.description, names)
    models = Interpreted(robot, ("idm", "ddm"), effects, wrenches=links, parameters=parameters.slots)
    slots = parameters.slot_values((1.1 * parameters.nominal + 0.02)[None])[0]
    other = changed(robot, parameters, slots)
    q, v, tau = moving_states(other, STATES)
    given = np.random.default_rng(0).normal(size=(STATES, 2, 6))
    acting: Any = {"effects": effects, "wrenches": {link: given[:, i] for i, link in enumerate(links)}}
    a, rows = hybridyn.ddm(other, q, v, tau, **acting), given.reshape(STATES, -1)
    numbers = np.tile(slots, (STATES, 1))
    for model, last, wanted in (("ddm", tau, a), ("idm", a, tau)):
        (found,), guard = models.batch(model, q, v, last, numbers, rows)
        assert guard.max() <= GUARD_LIMIT
        close_to(found, wanted, SAME)
