"""The judge of gradients: differences of robots that the general path builds, assembles and computes."""

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

import hybridyn
from hybridyn.compiled.programs.designs import changed
from hybridyn.description.records import Description
from hybridyn.dynamics.link_motion import kinematics
from hybridyn.gradients.kept import has_undriven
from hybridyn.joints import displacement
from hybridyn.spatial import Array
from hybridyn.structure.parameters.chosen import Parameters
from hybridyn.structure.robot import HybridRobot
from tests.robots.posing import position

#: Largest step in the parameters, and quotients that are extrapolated, each of half the step before.
STEP, LEVELS = 2e-4, 3
#: Least agreement, relative to the largest number: rounding of postures (1e-15) over the smallest step counts
#: for 2e-10, the most of 200 mechanisms and of the shipped robots, and where loops are ill conditioned for as
#: many times more.
AGREE = 1e-9


class Design(NamedTuple):
    """A motion of a robot of some design, by the general path."""

    q: Array
    v: Array
    a: Array
    tau: Array
    found: Array


def numbers_of(description: Description, seed: int, each: int = 4) -> list[str]:
    """Draw parameters of each kind."""
    rng = np.random.default_rng(seed)

    def some(names: list[str], count: int) -> list[str]:
        return [names[i] for i in rng.permutation(len(names))[:count]]

    heavy = [link.name for link in description.links if link.mass > 0]
    joints = some([joint.name for joint in description.joints], each)
    ends = [f"{c.name}/{side}" for c in description.closures for side in ("predecessor", "successor")]
    return [
        *(f"mass:{name}" for name in some(heavy, each)),
        *(f"centre:{name}" for name in some(heavy, each)),
        *(f"inertia:{name}" for name in some(heavy, 1)),
        *(f"placement:{name}" for name in joints[: each // 2]),
        *(f"position:{name}" for name in joints[each // 2 :]),
        *(f"position:{name}" for name in some(ends, each // 2)),
    ]


def near_home(robot: hybridyn.HybridRobot, seed: int = 1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a motion near home; accelerations of free bases are those of efforts."""
    rng = np.random.default_rng(seed)
    motors: dict[str, Any] = {}
    for name in robot.motors:
        step = 0.005 if robot.kinds[robot.joint_index[name]].slides else 0.05
        x = float(position(robot, name, robot.home)) + step * rng.standard_normal()
        motors[name] = (x, 0.3 * rng.standard_normal(), rng.standard_normal())
    base: Mapping[str, Any] = {}
    if robot.base == "floating":
        pose = np.array([0, 0, 1, 0, 0, np.sin(0.1), np.cos(0.1)])
        base = {robot.description.root: (pose, np.full(6, 0.1), np.zeros(6))}
    q, v, a = hybridyn.assemble(robot, motors=motors, platforms=base)
    if robot.base == "floating":
        a = hybridyn.ddm(robot, q, v, rng.standard_normal(len(motors)))
    return q, v, a


def design(
    robot: HybridRobot, q: Array, v: Array, a: Array, tau: Array | None = None, keep: Sequence[str] = ()
) -> Callable[[HybridRobot], Design]:
    """Return what assembles a robot of another design with the same motion of its motors, and computes it.

    Args:
        tau: Efforts of the direct model; by default those of the inverse one.
        keep: Joints, or coordinates of links, that stay instead of the motors.
    """
    joints = [name for name in keep or robot.motors if name in robot.joints]
    at = [robot.v_slices[robot.joint_index[name]].start for name in joints]
    motors = {
        name: (position(robot, name, q), float(v[k]), float(a[k])) for name, k in zip(joints, at, strict=True)
    }
    solved = has_undriven(robot)
    root, platforms = robot.description.root, {}
    links = {name.partition("/")[0] for name in keep if name not in joints}
    for link in links or ([root] if robot.base != "fixed" else []):
        motion = kinematics(robot, q, v, a, links=[link])[link]
        levels = motion.pose, motion.twist, motion.acceleration
        names = [name.rpartition("/")[2] for name in keep if name.startswith(link)]
        partial = tuple({n: float(x["xyz".index(n)]) for n in names} for x in levels)
        platforms[link] = partial if names else levels

    def at_design(other: HybridRobot) -> Design:
        found = hybridyn.assemble(other, motors=motors, platforms=platforms, guess=q)
        efforts = hybridyn.idm(other, *found, passive="solved" if solved else "given")
        return Design(*found, efforts, hybridyn.ddm(other, *found[:2], efforts if tau is None else tau))

    return at_design


def differences(
    robot: HybridRobot,
    parameters: Parameters,
    along: Array,
    q: Array,
    at_design: Callable[[HybridRobot], Design],
) -> tuple[Design, Design]:
    """Return derivatives along a direction of the parameters, shape (k,), those of q over freedoms.

    Displacements are those from the positions q of the robot itself: quotients have even errors alone then.
    Beside them stand their own errors: what the last extrapolation changed.
    """

    def moved(step: float) -> Design:
        slots = parameters.slot_values((parameters.nominal + step * along)[None])[0]
        return at_design(changed(robot, parameters, slots))

    table = []
    for level in range(LEVELS):
        one, other = (moved(sign * STEP / 2**level) for sign in (1, -1))
        way = [
            np.subtract(*(displacement.difference(kind, q[None, k], x.q[None, k])[0] for x in (one, other)))
            for kind, k in zip(robot.kinds, robot.q_slices, strict=True)
        ]
        both = [np.concatenate(way), *(x - y for x, y in zip(one[1:], other[1:], strict=True))]
        table.append([x / (2 * STEP / 2**level) for x in both])
    before = table
    for level in range(1, LEVELS):
        before = table
        pairs = pairwise(table)
        table = [[y + (y - x) / (4**level - 1) for x, y in zip(*pair, strict=True)] for pair in pairs]
    changed_by = [np.abs(x - y) for x, y in zip(table[0], before[-1], strict=True)]
    return Design(*table[0]), Design(*changed_by)


def agrees(
    robot: HybridRobot,
    names: Sequence[str],
    state: tuple[Array, Array, Array],
    seed: int = 0,
    keep: Sequence[str] = (),
    agree: float = AGREE,
) -> hybridyn.DesignGradients:
    """Compare all gradients along a random direction of the parameters with differences.

    Numbers that open loops are left out; freedoms that nothing determines, too.
    """  # fmt: skip
    gradients = hybridyn.DesignGradients(robot, names, keep=keep or None)
    q, v, a = state
    efforts = gradients.idm(q, v, a)
    tau = efforts.value
    own = [*gradients.motion(q, v, a), efforts.over, gradients.ddm(q, v, tau).over]
    opened, unknown = np.isnan(own[3]).all(axis=0), np.isnan(own[0]).all(axis=1)
    p = gradients.parameters.nominal
    along = np.random.default_rng(seed).standard_normal(len(p)) * np.maximum(np.abs(p), 0.1)
    along[opened] = 0.0
    along *= min(1.0, 10.0 / efforts.condition)  # near singular postures a step leads far
    at_design = design(robot, q, v, a, tau, keep)
    wanted, errors = differences(robot, gradients.parameters, along, q, at_design)
    solved = has_undriven(robot)  # accelerations without a motor follow the parameters, and are not held
    for k, (mine, theirs) in enumerate(zip(own, wanted, strict=True)):
        if k == 2 and solved:
            continue
        known = np.ones(len(theirs), dtype=bool) if k == 3 else ~unknown
        size = np.abs(theirs[known]).max(initial=0.0) + 1e-2  # rounding over the smallest step, where none
        off = np.abs(np.nan_to_num(mine[known]) @ along - theirs[known]).max(initial=0.0)
        allowed = agree * size * efforts.condition + errors[k][known].max(initial=0.0)
        assert off <= allowed, (Design._fields[k], off, allowed, efforts.condition)
    return gradients
