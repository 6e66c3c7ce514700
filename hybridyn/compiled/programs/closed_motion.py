"""What stays while a motion keeps loops closed and prescribed coordinates at their values, on symbols.

These are rows c(q, p) of all closures of a robot's spanning tree and of coordinates of links, with their
first two time derivatives along a motion. Whoever differentiates them over parameters p needs no pivots, and
any rows serve that vanish on the same motions: those of a whole rotation compare it with a fixed one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np

from ...joints import displacement
from ...linkage.closures import Closures
from ...linkage.motion import Motion
from ...linkage.targets import COORDINATES
from ...linkage.tree import Tree
from ...structure.module_spec import ModuleSpec
from ...symbols import Expression, dot
from ..equations.expressions import filled, pack, symbols
from ..equations.request import Request
from ..equations.rigid import links_of
from .closing.rows import coordinate_rows
from .general import WIDTH, motion_of
from .kinematics import kinematics_program
from .whole_robot import function_of


class PrescribedLink(NamedTuple):
    """Coordinates of a link that are prescribed.

    Attributes:
        link: The link.
        other: The link in which they are measured.
        names: Coordinates, of `COORDINATES`; "turn" for the whole rotation; an axis of the link that has a
            direction, "along x".
    """

    link: str
    other: str
    names: tuple[str, ...]


class ClosedMotion(NamedTuple):
    """The rows of a robot as expressions.

    Attributes:
        q, v, a, p: Columns of symbols: the state and the numbers in slots.
        fixed: Rotations with which whole ones are compared, row by row, nine symbols each.
        now: These rotations as functions of q and p.
        c: Rows that stay zero, or at prescribed values.
        c_dot: Their rates.
        c_ddot: Their accelerations.
        q_dot: The rate of q.
        closing: Number of rows that belong to closures, the first ones.
    """

    q: ca.SX
    v: ca.SX
    a: ca.SX
    p: ca.SX
    fixed: ca.SX
    now: ca.SX
    c: ca.SX
    c_dot: ca.SX
    c_ddot: ca.SX
    q_dot: ca.SX
    closing: int


def closed_motion(request: Request, prescribed: Sequence[PrescribedLink]) -> ClosedMotion:
    """Write the rows of a robot's closures, and of coordinates of links."""
    robot, arguments = request.robot, request.arguments
    (q, qs), (v, vs), (a, as_) = symbols("q", robot.nq), symbols("v", robot.nv), symbols("a", robot.nv)
    p = ca.SX(0, 1) if arguments is None else arguments.column  # type: ignore[union-attr]
    q_dot = pack(
        *(
            displacement.rate(kind, qs[at], vs[to])
            for kind, at, to in zip(robot.kinds, robot.q_slices, robot.v_slices, strict=True)
        )
    )
    levels: list[list[ca.SX]] = [[], [], []]
    for k, module in enumerate(robot.modules):
        own = None if arguments is None else arguments.of_modules[k]
        spec = module.mechanism.spec if own is None else own.spec
        if module.mechanism.spanning_closures.rows:
            rows = _of_module(spec, qs[module.q_index], vs[module.v_index], as_[module.v_index])
            for level, part in zip(levels, rows, strict=True):
                level.append(part)
    closing = sum(part.numel() for part in levels[0])
    fixed, now = ca.SX.sym("fixed", 9 * len(_turns(prescribed))), ca.SX(0, 1)
    if prescribed:
        c, now = _of_links(request, prescribed, q, fixed)
        c_dot = ca.jtimes(c, q, q_dot)
        c_ddot = ca.jtimes(c_dot, q, q_dot) + ca.jtimes(c_dot, v, a)
        for level, part in zip(levels, (c, c_dot, c_ddot), strict=True):
            level.append(part)
    c, c_dot, c_ddot = (ca.vertcat(*level) for level in levels)
    return ClosedMotion(q, v, a, p, fixed, now, c, c_dot, c_ddot, q_dot, closing)


def _of_module(spec: ModuleSpec, q: Expression, v: Expression, a: Expression) -> list[ca.SX]:
    """Return the residual of a module's closures and its first two time derivatives."""
    tree = Tree([*links_of(spec.spanning).values()])
    closures = Closures(tree, [*spec.closures], [*spec.couplings])
    motion = tree.sweep(q[None], v[None], a[None])
    first, second = closures.rates(motion, v[None], a[None])
    return [pack(x[0]) for x in (closures.residual(q[None], motion), first, second)]


def _turns(prescribed: Sequence[PrescribedLink]) -> list[PrescribedLink]:
    """Return the links whose whole rotation is prescribed."""
    return [one for one in prescribed if "turn" in one.names]


def _of_links(
    request: Request, prescribed: Sequence[PrescribedLink], q: ca.SX, fixed: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """Return the coordinates of links, and their rotations where these are prescribed as a whole."""
    still = ca.SX.zeros(request.robot.nv, 1)
    found = _bodies(request, q, still, still)
    rows, now = list[ca.SX](), list[ca.SX]()
    for one in prescribed:
        R, p = _seen_from(request, found, one)
        for name in one.names:
            if name == "turn":
                before = fixed[9 * len(now) : 9 * len(now) + 9]
                R_0 = filled([before[i] for i in range(9)], 3, 3)
                rows.append(_turned(dot(R_0.T, R)))
                now.append(pack(R))
            elif name.startswith("along "):
                rows.append(pack(R[:, "xyz".index(name[-1])]))
            else:
                rows.append(pack([coordinate_rows(R, p)[0][COORDINATES.index(name)]]))
    return ca.vertcat(*rows), ca.vertcat(*now) if now else ca.SX(0, 1)


def _bodies(request: Request, q: ca.SX, v: ca.SX, a: ca.SX) -> ca.SX:
    """Return the numbers of all bodies' motions (`kinematics_program`)."""
    arguments = [] if request.arguments is None else [request.arguments.column]  # type: ignore[union-attr]
    found: ca.SX = function_of(kinematics_program(request)).call([q, v, a, *arguments])[0]
    return found


def _seen_from(request: Request, found: ca.SX, one: PrescribedLink) -> tuple[Expression, Expression]:
    """Return axes and origin of a link, seen from another one."""
    (R, p), (R_o, p_o) = (_placed(request, found, link) for link in (one.link, one.other))
    return dot(R_o.T, R), dot(R_o.T, p - p_o)


def _placed(request: Request, found: ca.SX, link: str) -> tuple[Expression, Expression]:
    """Return axes and origin of a link in the world, from the motions of all bodies."""
    motion = _moved(request, found, link)
    return motion.R[0], motion.p[0]


def _moved(request: Request, found: ca.SX, link: str) -> Motion:
    """Return the motion of a link in the world, one sample, from the motions of all bodies."""
    body, R, p = request.places[link]
    motion = motion_of(filled([found[WIDTH * body + i] for i in range(WIDTH)], 1, WIDTH))
    return motion.then(Motion.at_rest(1, np.asarray(R), np.asarray(p)))


def link_motion(request: Request, link: str) -> ca.Function:
    """Write the motion of a link in the world.

    Returns:
        From q, v, a and the numbers in slots to position, velocity, angular velocity, acceleration of the
        origin (classical) and angular acceleration, 15 numbers, [m, rad, s], world axes.
    """
    robot, arguments = request.robot, request.arguments
    given = [ca.SX.sym(name, size) for name, size in (("q", robot.nq), ("v", robot.nv), ("a", robot.nv))]
    p = ca.SX(0, 1) if arguments is None else arguments.column  # type: ignore[union-attr]
    m = _moved(request, _bodies(request, *given), link)
    rows = [x[0] for x in (m.p, m.p_dot, m.w, m.p_ddot, m.w_dot)]
    return ca.Function("link", [*given, p], [pack(*rows)])


def _turned(R: Expression) -> ca.SX:
    """Return three numbers that vanish with a small rotation, and whose rates are its rates."""
    return pack([(R[2, 1] - R[1, 2]) / 2, (R[0, 2] - R[2, 0]) / 2, (R[1, 0] - R[0, 1]) / 2])
