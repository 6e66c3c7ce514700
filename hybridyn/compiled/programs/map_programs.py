"""Programs of the map between motors and output joints, for exported C: one from each side to the other.

With E_A the rates of all joints over those of side A, and E_B over those of side B, both from the closures:

    rates of B = E_A[B] rates of A            efforts of B = E_B[A]^T efforts of A        (equal power)

One Newton step closes the loops, as in the program "close".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ...assembly.posture import check_joints, modules_of
from ...dynamics.quantities.joint_map import joint_map, motors_beside
from ...dynamics.quantities.regular_map import regular_map
from ...linkage.tree import Tree
from ...spatial import Array, Index
from ...structure.module import Module
from ...structure.robot import HybridRobot
from ...symbols import Expression
from ..equations.expressions import pack, symbols
from ..equations.request import Request
from ..equations.scales import GUARD_CLOSED, largest, squares
from ..equations.states import moving_states
from ..loops.loop_rows import LoopRows
from ..program import Program
from .close import loop_writer
from .loop_kernels import Kernel, LoopKernel

#: Random postures at which the joints are tried before the map is written.
TRIED = 8


@dataclass(frozen=True)
class Side:
    """Joints on one side of a map.

    Attributes:
        name: "motor" or "joint".
    """

    name: str
    joints: tuple[str, ...]


def map_programs(request: Request, joints: Sequence[str]) -> list[Program]:
    """Build "map_to_joints" and "map_to_motors".

    Inputs are "near", a posture of the last tick, and positions, rates and efforts of one side, named after
    it ("motor_position", ...). Outputs are "q", the posture after a Newton step from "near" with these
    positions, positions, rates and efforts of the other side, and the matrix of rates by rows
    ("joints_per_motors", "motors_per_joints"). The guard is at most 1 if the loops were closed before the
    step; else call again with "q".

    Raises:
        SingularityError: The joints do not fit their modules.
        TrajectoryError: A joint is unknown, or has several freedoms.
    """
    robot = request.robot
    check_joints(robot, joints)
    _check_regular(robot, joints)
    sides = Side("joint", tuple(joints)), Side("motor", motors_beside(robot, joints))
    numbers = modules_of(robot, joints)
    return [_program(request, numbers, sides[1], sides[0]), _program(request, numbers, sides[0], sides[1])]


def _check_regular(robot: HybridRobot, joints: Sequence[str]) -> None:
    """Check that the map is regular at some posture: home, or a random one.

    Raises:
        SingularityError: All are singular, or the joints do not fit their modules.
    """
    postures = np.concatenate([robot.home[None], moving_states(robot, TRIED)[0]])
    found, kept = regular_map(robot, postures, joints)
    if found is None:
        joint_map(robot, postures[kept[0] if kept else 0], joints)  # says what is wrong


def map_values(robot: HybridRobot, q: Array, joints: Sequence[str], rates: Array) -> dict[str, Array]:
    """Compute inputs and outputs of both programs at postures by the general path, by name.

    Args:
        q: Positions, shape (T, nq). Singular ones get zeros.
        rates: Any numbers, shape (T, n), from which rates and efforts of the motors are taken.
    """
    motors = len(motors_beside(robot, joints))
    found, kept = regular_map(robot, q, joints)
    rate, effort = (np.resize(np.roll(rates, shift, axis=1), (len(q), motors)) for shift in (0, 1))
    wide, block = len(joints), len(joints) * motors
    widths = {
        "joint_position": wide, "motor_position": motors, "joint_rate": wide, "joint_effort": wide,
        "joints_per_motors": block, "motors_per_joints": block,
    }  # fmt: skip
    out = {name: np.zeros((len(q), size)) for name, size in widths.items()}
    if found is not None:
        known = {
            "joint_position": found.joint_positions, "motor_position": found.motor_positions,
            "joint_rate": found.joint_rates(rate[kept]), "joint_effort": found.joint_efforts(effort[kept]),
            "joints_per_motors": found.joints_per_motors, "motors_per_joints": found.motors_per_joints,
        }  # fmt: skip
        for name, values in known.items():
            out[name][kept] = values.reshape(len(kept), -1)
    return out | {"motor_rate": rate, "motor_effort": effort}


def _program(request: Request, numbers: list[int], given: Side, wanted: Side) -> Program:
    """Build the program from one side to the other."""
    robot, m, k = request.robot, len(given.joints), len(wanted.joints)
    matrix, parts, modules = (
        f"{wanted.name}s_per_{given.name}s",
        ("position", "rate", "effort"),
        robot.modules,
    )
    own, other = ([_of_module(module, side) for module in modules] for side in (given, wanted))
    blocks = [(b[:, None] * m + a).ravel() for a, b in zip(own, other, strict=True)]
    inputs = {"near": "q"} | {f"{given.name}_{part}": "own" for part in parts}
    outputs = {"q": "q"} | {f"{wanted.name}_{part}": "other" for part in parts} | {matrix: "block"}
    rest = [
        np.setdiff1d(np.arange(size), np.concatenate([at[n] for n in numbers]))
        for size, at in ((robot.nq, [module.q_index for module in modules]), (k * m, blocks))
    ]
    kinds = {"own": (m, own), "other": (k, other), "block": (k * m, blocks)}
    w = loop_writer(request, f"map_to_{wanted.name}s", inputs, outputs, **kinds)
    for number in numbers:
        w.add(("map", number), [number], _kernel(modules[number], given, wanted, GUARD_CLOSED[request.dtype]))
    w.keep(
        **{name: (of, at) for name, of, at in zip(("q", matrix), ("near", ""), rest, strict=True) if len(at)}
    )
    return w.program()


def _of_module(module: Module, side: Side) -> Index:
    """Return the numbers of the joints of a side that a module holds."""
    return np.array([i for i, name in enumerate(side.joints) if name in module.joints], dtype=int)


def _kernel(module: Module, given: Side, wanted: Side, closed: float) -> Kernel:
    """Return the kernel of a module."""
    A, B = (_freedoms(module, side) for side in (given, wanted))
    kernel, back = LoopKernel([module], A), LoopKernel([module], B)
    for one, side in ((kernel, given), (back, wanted)):
        one.check_independent(
            f"{side.name}s", f"the {side.name}s {', '.join(side.joints)} are not independent"
        )
    loops = kernel.loops
    near_col, near = symbols("near", loops.tree.nq)
    columns = [symbols(name, len(A)) for name in ("position", "rate", "effort")]
    position, rate, effort = (values for _, values in columns)
    q = _placed(loops.tree, near, A, position)
    rows = kernel.rows(q)
    step, guard, there = _followed(kernel, rows, B)
    _, of_back, per_wanted = _followed(back, rows, A)
    size = largest(step / loops.unit) / closed
    moved = loops.moved(q, step)
    outputs = [
        pack(moved), pack(_positions(loops.tree, moved, B)), pack(there.dot(rate)),
        pack(per_wanted.T.dot(effort)), pack(there), ca.fmax(ca.fmax(guard, of_back), size),
    ]  # fmt: skip
    return kernel.kernel("map", [near_col, *(column for column, _ in columns)], outputs)


def _followed(kernel: LoopKernel, rows: LoopRows, wanted: list[int]) -> tuple[Expression, Any, Expression]:
    """Return a Newton step, the guard of its pivots, and rates of wanted freedoms over the given ones."""
    step, motions, doubts = kernel.loops.solved(rows.K, -rows.residual[:, None], kernel.given)
    return step[:, 0], squares(doubts), motions[wanted]


def _freedoms(module: Module, side: Side) -> list[int]:
    """Return the freedoms of a module's spanning tree that the joints of a side are, in their order."""
    slices = dict(zip(module.joints, module.mechanism.spanning.v_slices, strict=True))
    return [slices[name].start for name in side.joints if name in slices]


def _placed(tree: Tree, q: Expression, freedoms: list[int], positions: Expression) -> Expression:
    """Return a posture with other positions of some joints."""
    out = q.copy()
    for joint, at, to in zip(tree.joints, tree.q_slices, tree.v_slices, strict=True):
        if to.start in freedoms:
            x = positions[freedoms.index(to.start)]
            out[at] = [ca.cos(x), ca.sin(x)] if joint.kind.endless else [x]
    return out


def _positions(tree: Tree, q: Expression, freedoms: list[int]) -> Expression:
    """Return the positions of some joints, those of continuous ones within half a turn."""
    starts = [at.start for at in tree.v_slices]
    places = [tree.q_slices[starts.index(freedom)] for freedom in freedoms]
    entries = [ca.atan2(*q[at][::-1]) if at.stop - at.start == 2 else q[at.start] for at in places]
    return np.array([*entries, None], dtype=object)[:-1]
