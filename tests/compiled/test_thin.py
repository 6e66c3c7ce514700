"""Rods whose inertia or centre are arguments, with inertia about their line or without, unlike the file.

Each design is computed as the general path computes it, or handed over. Where it is computed, the equations
of motion hold to rounding, and accelerations agree but for what rounding does along a spin of little inertia.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Literal, get_args

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.code.scalars import GUARD_LIMIT
from hybridyn.compiled.equations.states import moving_states
from hybridyn.compiled.programs.whole_robot import function_of, programs
from hybridyn.compiled.verifying import BALANCED
from hybridyn.description.records import Description, Link
from hybridyn.dynamics.backward import unbalanced
from hybridyn.effects.choice import choose
from hybridyn.spatial import Array
from hybridyn.structure.building import build_robot
from hybridyn.structure.parameters.chosen import Parameters
from tests.compiled import rods
from tests.support.samples import slow

#: Of the largest acceleration of a motor: rounding through the loops and through the coupling with a spin.
MOTORS = 1e-8
#: Roundings of the inertia about all axes that the inertia about a line may have in two computations.
ROUNDINGS = 1e3

#: Inertia about the line, in m l^2.
AXIAL = (0.0, 1e-15, 1e-13, 1e-12, 1e-6, 1e-9, 1e-3, 0.05)
#: Neither rounding nor certainly an inertia: the general path decides.
UNSURE = (1e-13, 0.0)
#: Distance of the centre from the line, in lengths of the rod.
BESIDE = (0.0, 1e-12, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-3)

Base = Literal["fixed", "moving", "floating"]


def oblique(description: Description) -> Description:
    """Turn the last hinge of each rod's three, so that none is along the rod: its spin is of all three."""
    links = {joint.child for joint in description.joints}
    hinges = [j for j in description.joints if j.kind == "revolute" and "rod" in j.child and j.child in links]
    turned = {j.name: replace(j, axis=_aside(j.axis)) for j in hinges}
    return replace(description, joints=tuple(turned.get(j.name, j) for j in description.joints))


def _aside(axis: Array) -> Array:
    out = axis + 0.5 * np.roll(axis, 1) + 0.3 * np.roll(axis, 2)
    return out / np.linalg.norm(out)


def design(link: Link, axial: float, beside: float) -> dict[str, Array]:
    """Return the centre, beside the line, and the inertia of a rod, with some inertia about its line."""
    length = 2 * np.linalg.norm(link.com)
    line = link.com / np.linalg.norm(link.com)
    about = np.outer(line, line)
    inertia = link.mass * length**2 * ((np.eye(3) - about) / 12 + axial * about)
    across = np.cross(line, [0.3, -0.5, 0.8])
    return {
        f"centre:{link.name}": link.com + beside * length * across / np.linalg.norm(across),
        f"inertia:{link.name}": inertia[np.triu_indices(3)],
    }


def designs(every: bool) -> Iterator[tuple[float, float]]:
    """Yield inertias about the line and distances of the centre: all pairs, or every other one alone."""
    for i, axial in enumerate(AXIAL):
        for j, beside in enumerate(BESIDE):
            if every or (i * j == 0 and (i + j) % 2 == 0) or (axial == AXIAL[-1] and not beside):
                yield axial, beside


def judge(
    robot: hybridyn.HybridRobot, like: hybridyn.HybridRobot, given: list[Array], found: Array, tiny: float
) -> None:
    """Compare accelerations that a model has computed itself with those of the general path, one sample."""
    q, v, tau, base = given
    more = {"base_acceleration": base} if robot.base == "moving" else {}
    wanted = hybridyn.ddm(like, q, v, tau, **more)
    whole = found.copy()
    whole[: 6 * (robot.base == "moving")] = base[: 6 * (robot.base == "moving")]
    left = unbalanced(like, choose(like, None), q[None], v[None], whole[None], tau[None])
    assert left[0] <= BALANCED
    size = np.abs(wanted).max()
    motors = robot.motor_v
    assert np.abs(found - wanted)[motors].max() <= MOTORS * np.abs(wanted[motors]).max()
    limit = MOTORS if not tiny else MOTORS + ROUNDINGS * 2.0**-52 / tiny
    assert np.abs(found - wanted).max() <= limit * size


@pytest.mark.parametrize(
    ("name", "foot", "base", "thin", "every"),
    [
        ("crank", "floating", "fixed", True, False),
        ("crank", "ball", "moving", False, False),
        slow("crank", "floating aside", "floating", True, True),
        slow("crank", "floating", "moving", False, True),
        slow("crank", "ball", "floating", True, True),
        slow("crank", "revolutes", "moving", True, True),
        slow("crank", "oblique", "fixed", False, True),
        slow("crank", "universal", "moving", True, True),
        slow("slides", "ball", "fixed", True, False),
        slow("slides", "ball", "moving", False, False),
        slow("slides", "revolutes", "floating", True, False),
        slow("slides", "universal", "moving", False, False),
        slow("ball_gough", "floating", "moving", True, False),
    ],
)
def test_designs_are_the_general_paths_or_handed_over(
    name: str, foot: str, base: Base, thin: bool, every: bool
) -> None:
    assert base in get_args(Base)
    own = "revolutes" if foot == "oblique" else foot
    description = getattr(rods, name)(3, own, thin=thin)
    description = oblique(description) if foot == "oblique" else description
    robot = build_robot(description, base=base)
    link = next(link for link in description.links if "rod" in link.name or "lower" in link.name)
    names = [f"centre:{link.name}", f"inertia:{link.name}"]
    parameters = Parameters(description, names)
    program = function_of(programs(robot, None, models=("ddm",), parameters=parameters.slots)["ddm"])
    computed, rng = set(), np.random.default_rng(5)
    q, v, tau = moving_states(robot, 2, 4)
    v[0] = 0.0
    for axial, beside in designs(every):
        values = design(link, axial, beside)
        like = robot.with_parameters(values)
        numbers = parameters.slot_values(np.concatenate([*values.values()])[None])[0]
        for t in range(2):
            acceleration = rng.normal(size=6) * 5.0
            given = [q[t], v[t], tau[t], *([acceleration] if base == "moving" else []), numbers]
            a, guard = program(*given)
            if float(guard) <= GUARD_LIMIT:
                judge(robot, like, [q[t], v[t], tau[t], acceleration], np.array(a).ravel(), axial + beside**2)
                computed.add((axial, beside))
    sure = {(0.05, 0.0), (1e-6, 0.0)} | (set() if foot == "oblique" else {(0.0, 0.0)})
    assert computed >= sure
    assert foot not in ("ball", "floating") or UNSURE not in computed


#: Largest part of the terms that may be left: accelerations of a spin of little inertia reach 1e7 rad/s^2.
LEFT = 1e-10


def near_the_border(rng: np.random.Generator, link: Link) -> tuple[Link, float, float]:
    """Return a rod that is thin, nearly thin or round, the inertia of its spin, and its coupling, in m l^2.

    Its centre is beside the line by rounding or by more, and the line is no principal axis.
    """
    length, line = 2 * np.linalg.norm(link.com), link.com / np.linalg.norm(link.com)
    axial, beside = (
        0.0 if rng.random() < 0.3 else 10.0 ** rng.uniform(*of) for of in ((-16.0, -9.0), (-15.0, -4.0))
    )
    skew = 0.9 * np.sqrt(axial / 12) * (0.0 if rng.random() < 0.3 else 10.0 ** rng.uniform(-5.0, 0.0))
    across = np.cross(line, [0.3, -0.5, 0.8])
    across /= np.linalg.norm(across)
    about, tilted = np.outer(line, line), np.outer(across, line)
    inertia = link.mass * length**2 * ((np.eye(3) - about) / 12 + axial * about + skew * (tilted + tilted.T))
    changed = replace(link, com=link.com + beside * length * across, inertia=(inertia + inertia.T) / 2)
    return changed, axial + beside**2, float(np.hypot(beside, skew))


@pytest.mark.parametrize(
    ("name", "seeds"),
    [
        ("crank", [1]),
        slow("crank", [0, *range(2, 120)]),
        slow("slides", range(12)),
        slow("ball_gough", range(6)),
    ],
    ids=["few", "many", "slides", "ball_gough"],
)
def test_rods_near_the_border_are_the_general_paths_or_handed_over(name: str, seeds: Sequence[int]) -> None:
    """Of a file, and designs. Rounding of the spin's inertia grows by its coupling with other motions."""
    computed = set()
    for seed in seeds:
        rng = np.random.default_rng([seed, 51])
        foot: rods.Foot = rng.choice(["ball", "floating", "floating aside", "revolutes"])
        base: Base = rng.choice(get_args(Base))
        as_drawn = getattr(rods, name)(int(rng.integers(40)), foot, thin=name != "crank" and bool(seed % 2))
        at = next(
            i for i, x in enumerate(as_drawn.links) if ("rod" in x.name or "lower" in x.name) and x.mass
        )
        link, spun, coupled = near_the_border(rng, as_drawn.links[at])
        links = (*as_drawn.links[:at], link, *as_drawn.links[at + 1 :])
        robot = build_robot(replace(as_drawn, links=links), base=base)
        parameters = Parameters(as_drawn, [f"centre:{link.name}", f"inertia:{link.name}"])
        values = np.concatenate([link.com, link.inertia[np.triu_indices(3)]])
        design = [parameters.slot_values(values[None])[0]]
        ways = {
            "file": (robot, (), []),
            "design": (build_robot(as_drawn, base=base), parameters.slots, design),
        }
        states = [x[0] for x in moving_states(robot, 1, seed)]
        more = {"base_acceleration": rng.normal(size=6) * 5.0} if base == "moving" else {}
        growth = 2.0**-52 * (coupled / spun) ** 2 if spun else 0.0
        for way, (own, slots, numbers) in ways.items():
            program = function_of(programs(own, None, models=("ddm",), parameters=slots)["ddm"])
            a, guard = program(*states, *more.values(), *numbers)
            if float(guard) <= GUARD_LIMIT:
                computed.add(way)
                near_the_general_path(robot, states, np.array(a).ravel(), more, growth)
    assert computed == {"file", "design"}


def near_the_general_path(
    robot: hybridyn.HybridRobot, states: list[Array], found: Array, more: dict[str, Array], growth: float
) -> None:
    """Hold accelerations to the equations of motion, and those of motors to the general path's."""
    q, v, tau = states
    found[: 6 * len(more)] = next(iter(more.values()), found[:0])
    left = unbalanced(robot, choose(robot, None), q[None], v[None], found[None], tau[None])
    assert left[0] <= LEFT
    wanted = hybridyn.ddm(robot, q, v, tau, **more)[robot.motor_v]
    assert np.abs(found[robot.motor_v] - wanted).max() <= (MOTORS + growth) * np.abs(wanted).max()
