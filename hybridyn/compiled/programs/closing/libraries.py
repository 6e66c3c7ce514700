"""The libraries that close the loops of a robot, or of its designs: one for each choice of what is given."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ....assembly.assemble import assemble_requests
from ....assembly.chain.coupling import ways_between
from ....assembly.chain.places import motion_of
from ....assembly.poses import PoseRequest
from ....assembly.requests import Requests
from ....assembly.spanning import spanning_positions
from ....errors import HybridynError
from ....linkage.angles import angles_of
from ....linkage.motion import Motion
from ....linkage.newton import LoopProblem, close
from ....linkage.targets import COORDINATES
from ....manifold.manifold import Manifold
from ....spatial import Array, Mask, cross, rotation_from_vector
from ....structure.parameters.entries import Parameters
from ....structure.robot import HybridRobot, joint_position
from ...code.scalars import Scalar
from ...failures import check_agreement
from ...library.artifact import Artifact
from ...library.building import best_lanes
from ...library.cache import Built
from ...library.closed_rows import ClosedRows, Rows
from ..designs import designs_to_verify
from ..sources import kept, robot_key
from .coupled import Coupled, Split, split_poses
from .members import Wanted, members_of, wanted_of
from .module_parts import (
    CLOSED_TO_ROUNDING,
    Part,
    lanes_for,
    numbers,
    places_at,
    posture_of,
    upright_is_meant,
)
from .own_requests import modules_of, structure_of

if TYPE_CHECKING:
    from ...code.library_source import Source


@dataclass(frozen=True)
class Closing:
    """The library for one choice of given joints and targets.

    Attributes:
        parts: The modules that it closes.
        rows: The loaded library.
        chains: Those of them that poses couple.
    """

    parts: list[Part]
    rows: ClosedRows
    chains: list[Coupled]

    def numbers(self, wanted: Wanted) -> Rows:
        """Return what is prescribed, see `module_parts.numbers`."""
        every = [numbers(self.parts, wanted.own), *(one.wanted(wanted.requests) for one in self.chains)]
        g, g_dot, g_ddot = (np.concatenate(level, axis=1) for level in zip(*every, strict=True))
        return g, g_dot, g_ddot

    def at_home(self, robot: HybridRobot, given: Rows) -> Rows | None:
        """Return the home posture of designs, whose loops may be open, see `place`."""
        q, p, g = posture_of(self.parts, robot.home)
        for one in self.chains:
            known = given[0][0, len(g) : len(g) + one.given.size]
            g = np.concatenate([g, one.numbers_at(robot, q[None], known, met=False)[0]])
        return self.headed((q, p, g), given)

    def place(self, robot: HybridRobot, q: Array, given: Rows, *, met: bool = False) -> Rows | None:
        """Return the closed posture at a guess, see `place_of` and `headed`.

        Args:
            robot: The robot.
            q: Positions of the spanning tree, shape (nq,).
            given: As from `numbers`; the first row is near the guess.
            met: Whether the guess meets it.
        """
        return self.headed(place_of(robot, self.parts, q, self.chains, given[0][0], met=met), given, met=met)

    def headed(self, place: Rows | None, given: Rows, *, met: bool = False) -> Rows | None:
        """Return a posture whose headings become those of what is given.

        None where an angle is meant in another triple than the upright one, which kernels of a module know.

        Args:
            place: As from `place_of`.
            given: As from `numbers`; the first row is near the posture.
            met: Whether the posture meets it.
        """
        if place is None or not upright_is_meant(self.parts, place[0], given[0][0], met=met):
            return None
        end = given[0].shape[1] - sum(one.given.size for one in self.chains)
        for one in self.chains:
            end += one.given.size
            headings = slice(end - len(one.given.turning), end)
            given[0][:, headings] = place[2][headings]
        return place


class ClosingLibraries:
    """Loads libraries as requests need them, and keeps the last ones."""

    def __init__(self, robot: HybridRobot, designs: Parameters | None = None) -> None:
        """Start without any library.

        Args:
            designs: Numbers that are arguments, of designs in lanes; None for rows of the robot itself.
        """
        self.robot, self._designs = robot, designs
        self._known: dict[tuple[object, ...], Closing | None] = {}
        self._splits: dict[tuple[object, ...], Split] = {}

    def known(self, requests: Requests) -> Closing | None:
        """Return the library for requests if it is loaded."""
        return self._known.get(structure_of(requests))

    def asked(self, requests: Requests) -> tuple[Closing, Rows] | None:
        """Return the library for requests, built if it is new, and what they prescribe, see `numbers`.

        None if the general path must close the loops; it says what is wrong, after the modules before.
        """
        try:
            wanted = self._wanted(requests)
            if wanted is None:
                return None
            closing = kept(self._known, structure_of(requests), partial(self._loaded, wanted))
        except HybridynError:
            return None
        return None if closing is None else (closing, closing.numbers(wanted))

    def artifact(self, requests: Requests) -> Artifact | None:
        """Return the library for requests, built or not; None if the general path closes the loops."""
        wanted = self._wanted(requests)
        members = None if wanted is None else members_of(self.robot, wanted)
        return None if members is None else self._artifact(requests, *members)

    def _wanted(self, requests: Requests) -> Wanted | None:
        """Return what is asked of each module, or None if the general path must close the loops."""
        if self._designs is not None and (self.robot.base != "fixed" or self.moves_posed_links(requests)):
            return None
        split = kept(self._splits, structure_of(requests), partial(split_poses, self.robot, requests))
        if self._designs is not None and any(self._moves_chain(requests, *chain) for chain in split[1]):
            return None
        return wanted_of(self.robot, requests, split)

    def moves_posed_links(self, requests: Requests) -> bool:
        """Return whether a number of the designs places a link in its body whose whole pose is prescribed.

        Prescribed poses are those of bodies, computed once; those of coordinates are computed in C.
        """
        whole = [pose for pose in requests.poses if pose.motion is not None]
        return self._placed(link for pose in whole for link in (pose.link, pose.other))

    def _placed(self, links: Iterable[str]) -> bool:
        """Return whether a number of the designs places one of some links in its body."""
        joints = self.robot.description.joints
        above = {joint.child: joint for joint in joints if joint.kind == "fixed"}
        slots = self._designs.slots if self._designs else ()
        placing = {slot.name for slot in slots if slot.table == "joints"}
        for link in links:
            while link in above:
                if above[link].name in placing:
                    return True
                link = above[link].parent
        return False

    def _moves_chain(self, requests: Requests, modules: Sequence[int], poses: Sequence[int]) -> bool:
        """Return whether a number of the designs moves what the kernels of a chain have as constants.

        These are frames in bodies, and those of modules that do not move.
        """
        robot, some = self.robot, [requests.poses[i] for i in poses]
        links = {link for pose in some for link in (pose.link, pose.other)}
        links |= {robot.modules[k].base for k in modules}
        on_the_way = {k for pose in some for way in ways_between(robot, pose) for k, _ in way}
        return self._placed(links) or not on_the_way <= {*modules}

    def _loaded(self, wanted: Wanted) -> Closing | None:
        """Load the library for a choice of given joints and targets; None if there is none."""
        members = members_of(self.robot, wanted)
        alone = getattr(sys, "_is_gil_enabled", lambda: True)()  # rows share one workspace
        if members is None or (self._designs is None and not (alone and best_lanes() > 1)):
            return None
        otherwise = f"{'assemble' if self._designs is None else 'designs'}: the general path closes the loops"
        rows = self._artifact(wanted.requests, *members).tried(self._rows, otherwise)
        return None if rows is None else Closing(members[0], rows, members[1])

    def _rows(self, built: Built) -> ClosedRows:
        return ClosedRows(built, free=self._designs is not None)

    def _artifact(self, requests: Requests, parts: list[Part], chains: list[Coupled]) -> Artifact:
        """Return the library of some parts; a new one is compared with the general path at some designs."""
        robot, designs = self.robot, self._designs
        slots = None if designs is None else designs.slots
        lanes = best_lanes() if designs is not None else min(best_lanes(), lanes_for(parts))
        scalar = Scalar("float64", lanes)

        def write() -> Source:
            """Generate the C source."""
            from ...equations.arguments import ChosenNumbers
            from .closing_source import closing_source

            return closing_source(
                robot, parts, scalar, None if slots is None else ChosenNumbers(robot, slots), chains
            )

        def check(built: Built) -> None:
            """Compare a new library with the general path."""
            rows, nominal = self._rows(built), [(np.zeros(0), robot, True)]
            for design, like, _ in nominal if designs is None else designs_to_verify(robot, designs):
                own = (parts, chains) if like is robot else _like(parts, like, requests)
                if own and chains:
                    check_chains(Closing(own[0], rows, own[1]), like, requests, design)
                elif own:
                    check_rows(rows, like, own[0], design)

        name = f"closing {structure_of(requests)!r} {robot_key(robot, None)} {scalar!r} {slots!r}"
        return Artifact(robot, name, write, check)


def _like(
    parts: list[Part], robot: HybridRobot, requests: Requests
) -> tuple[list[Part], list[Coupled]] | None:
    """Return parts and chains of another design for the same requests; None if its structure is another."""
    try:
        wanted = wanted_of(robot, requests, split_poses(robot, requests))
        members = None if wanted is None else members_of(robot, wanted)
    except HybridynError:
        return None
    structures = [
        [(part.given, part.module.mechanism.spec.topology) for part in group]
        for group in (members[0] if members else [], parts)
    ]
    return members if structures[0] == structures[1] else None


#: Nothing is prescribed.
NOTHING_KNOWN = np.zeros(0)


def place_of(
    robot: HybridRobot,
    parts: list[Part],
    guess: Array,
    chains: Sequence[Coupled] = (),
    known: Array = NOTHING_KNOWN,
    *,
    met: bool = False,
) -> Rows | None:
    """Return the closed posture at a guess, see `ClosedRows.close`; None if its loops do not close near it.

    Args:
        parts: Its modules but a free base.
        guess: Positions of the spanning tree, shape (nq,).
        chains: Those of them that poses couple.
        known: What is prescribed, shape (numbers,); `met` as in `Coupled.numbers_at`.
        met: Whether the guess has it.
    """
    q, cut = guess.copy(), []
    for part in parts:
        m, at = part.module.mechanism, part.module.q_index
        x = m.cut.positions(q[None, at])
        if m.closures.rows:
            scale = m.reduction.row_scale
            open_by = np.abs(m.closures.residual(x, m.tree.sweep(x)) * scale).max()
            if not open_by <= CLOSED_TO_ROUNDING:
                every = np.ones(m.tree.nv, dtype=bool)
                found = close(LoopProblem(m.closures, scale, m.reduction.col_scale, every), x)
                if not found.residual[0] <= max(robot.closure_tolerance, 1e-12):
                    return None
                x = found.q
                q[at] = spanning_positions(part.module, x, m.tree.sweep(x), q[at])[0]
        cut.append(x)
    p, g = places_at(parts, cut, 1)
    numbers = g[0]
    for one in chains:
        own = known[len(numbers) : len(numbers) + one.given.size]
        numbers = np.concatenate([numbers, one.numbers_at(robot, q[None], own, met=met)[0]])
    return q, p[0], numbers


#: Number of generic postures that are tried, and how far the row is from each (rad, module lengths).
POSTURES, ROW_AWAY = 4, 1e-3
#: Largest turn of joints of modules without loops, away from a singular home [rad, module lengths].
BENT = 0.7
#: Largest difference from the general path, relative to the largest entry of each result: rounding, through
#: the condition of loops at any posture.
ROWS_AGREE = 1e-8


def check_rows(rows: ClosedRows, robot: HybridRobot, parts: list[Part], design: Array) -> None:
    """Compare rows near generic postures with moving states of the general path.

    Args:
        rows: The library, as far as it is certain.
        robot: The robot, or another design of it.
        parts: The modules that it closes.
        design: Numbers in the slots, shape (slots,).

    Raises:
        CompileError: A row of which the library is certain differs.
    """
    compared, manifold = _compared(robot, parts), Manifold(robot)
    for number in range(POSTURES):
        start, wanted = robot.home.copy(), (robot.home.copy(), *np.zeros((2, robot.nv)))
        given = [_move(part, number, start, wanted) for part in parts]
        room = [x[None, None].copy() for x in wanted]
        place = place_of(robot, parts, start)
        row = [np.concatenate(own)[None] for own in zip(*given, strict=True)]
        if place is None or not rows.close(design[None], place, row, room, guess=False, strict=True)[0]:
            continue
        q, v, _ = found = [x[0, 0] for x in room]
        spun = (
            [manifold.residual(q)[0], manifold.opening(q, v)[0]] if any(part.spins for part in parts) else []
        )
        offs = [
            np.abs(x - right)[at].max(initial=0.0) / (1.0 + np.abs(right).max())
            for x, right, at in zip(found, wanted, compared, strict=True)
        ]
        check_agreement(robot, "motion of the loops", [*offs, *spun], ROWS_AGREE)


def _compared(robot: HybridRobot, parts: list[Part]) -> tuple[Mask, Mask, Mask]:
    """Return the positions, rates and accelerations that do not depend on how far rods have spun."""
    q, v = np.ones(robot.nq, dtype=bool), np.ones(robot.nv, dtype=bool)
    for part in parts:
        module, m = part.module, part.module.mechanism
        balls = [m.spec.tree_joint[m.tree.dof_body[spin.col] - 1] for spin in part.spins]
        wrists = [joint for wrist in m.spec.wrists for joint in wrist.joints if part.spins]
        for joint in (*balls, *wrists):
            if joint is not None:
                q[module.q_index[m.spanning.q_slices[joint]]] = False
                v[module.v_index[m.spanning.v_slices[joint]]] = False
    return q, v, v


def _move(part: Part, number: int, start: Array, wanted: Rows) -> Rows:
    """Write a closed posture of a module into `start`, a moving state nearby into `wanted`.

    Returns:
        What is prescribed in that state, its rates and accelerations, shapes (numbers,), (rates,), (rates,).
    """
    module, m = part.module, part.module.mechanism
    rng, tree = np.random.default_rng(number), m.tree
    at, to = module.q_index, module.v_index
    x = m.postures[number % len(m.postures)][None]
    start[at] = spanning_positions(module, x, tree.sweep(x), start[at])[0]
    Psi = m.basis(m.closures.matrix(tree.sweep(x))).Psi
    way = Psi @ rng.normal(size=m.mobility)
    size = np.abs(way / m.reduction.col_scale).max(initial=1.0)
    every, r = np.ones(tree.nv, dtype=bool), m.reduction
    near = tree.integrate(x, ROW_AWAY / size * way)
    x = close(LoopProblem(m.closures, r.row_scale, r.col_scale, every, (), r.rank), near).q
    K = m.closures.matrix(tree.sweep(x))
    x_dot = m.basis(K).Psi @ rng.normal(size=m.mobility)
    basis = m.basis(K, m.closures.rates(tree.sweep(x, x_dot), x_dot)[1])
    x_ddot = basis.Psi @ rng.normal(size=m.mobility) + basis.drift
    motion = tree.sweep(x, x_dot, x_ddot)
    q = spanning_positions(module, x, motion, start[at])
    v, a = m.spanning_rates(q, x, x_dot, x_ddot)
    wanted[0][at], wanted[1][to], wanted[2][to] = q[0], v[0], a[0]
    held, bodies = part.given.columns(tree), part.given.bodies
    twists = [np.concatenate([motion.p_dot[0, b], motion.w[0, b]]) for b in bodies]
    accelerations = [np.concatenate([motion.p_ddot[0, b], motion.w_dot[0, b]]) for b in bodies]
    for one in part.given.coordinates:
        first = np.zeros(1, dtype=int)
        twists.append((one.target.matrix(tree, motion) @ x_dot[0])[0])
        accelerations.append(-one.target.rates(motion, first)[1][0])
    return (
        part.given.of_posture(tree, x)[0],
        np.concatenate([x_dot[0, held], *twists]),
        np.concatenate([x_ddot[0, held], *accelerations]),
    )


def check_chains(closing: Closing, robot: HybridRobot, requests: Requests, design: Array) -> None:
    """Compare rows of modules that poses couple with the general path, near generic postures.

    Args:
        closing: The library, and what it closes of the robot.
        robot: The robot, or another design of it.
        requests: Requests that it answers.
        design: Numbers in the slots, shape (slots,).

    Raises:
        CompileError: A row of which the library is certain differs.
    """
    compared = _compared(robot, closing.parts)
    for number in range(POSTURES):
        start = robot.home.copy()
        for part in closing.parts:
            _move(part, number, start, (start.copy(), *np.zeros((2, robot.nv))))
        start = bent(robot, start, number)
        asked = nearby_requests(robot, requests, closing.chains, start, number)
        wanted = wanted_of(robot, asked, split_poses(robot, asked))
        row = None if wanted is None else closing.numbers(wanted)
        place = None if row is None else closing.place(robot, start, row)
        if place is None or row is None:
            continue
        room = [np.empty((1, 1, n)) for n in (robot.nq, robot.nv, robot.nv)]
        if not closing.rows.close(design[None], place, row, room, guess=False, strict=True)[0]:
            continue
        try:
            right = assemble_requests(robot, asked, start)
        except HybridynError:
            continue
        offs = [
            np.abs(x[0] - y)[:, at].max(initial=0.0) / (1.0 + np.abs(y).max())
            for x, y, at in zip(room, right, compared, strict=True)
        ]
        check_agreement(robot, "motion of the chains", offs, ROWS_AGREE)


def bent(robot: HybridRobot, q: Array, seed: int) -> Array:
    """Return a posture, shape (nq,), with modules without loops turned: arms may be straight at home."""
    q, rng = q.copy(), np.random.default_rng(seed)
    for _, module in modules_of(robot):
        m, at = module.mechanism, module.q_index
        if not m.closures.rows:
            turn = BENT * rng.uniform(-1.0, 1.0, (1, m.spanning.nv)) * m.spanning_col_scale
            q[at] = m.spanning.integrate(q[None, at], turn)[0]
    return q


def nearby_requests(
    robot: HybridRobot, requests: Requests, chains: Sequence[Coupled], q: Array, seed: int
) -> Requests:
    """Return requests like some others near a posture, shape (nq,), where chains move and all else stays."""
    rng, states = np.random.default_rng(seed), (q[None], *np.zeros((2, 1, robot.nv)))
    joints = {
        name: np.array([[float(joint_position(robot, q, name))], [0.0], [0.0]]) for name in requests.joints
    }
    moving = {i: one for one in chains for i in one.poses}
    poses = []
    for i, pose in enumerate(requests.poses):
        link, other = (motion_of(robot, name, states) for name in (pose.link, pose.other))
        seen, size = link.seen_from(other), 0.0
        if i in moving:
            size = max(float(one.target.units.max()) for one in moving[i].relatives)
        shift, turn, v, w, a, alpha = (
            ROW_AWAY * rng.normal(size=(6, 1, 3)) * np.array([size, bool(size)] * 3)[:, None, None]
        )
        R = np.matmul(rotation_from_vector(turn), seen.R)
        pose = _pointing_nearby(pose, Motion(R, seen.p + shift, w, v, alpha, a))
        if pose.motion is not None:
            poses.append(pose._replace(motion=Motion(R, seen.p + shift, w, v, alpha, a)))
            continue
        values = np.concatenate([seen.p + shift, angles_of(seen.R) + turn], axis=1)
        every = dict(
            zip(
                COORDINATES,
                np.stack([values, *(np.concatenate(x, axis=1) for x in ((v, w), (a, alpha)))]).T,
                strict=True,
            )
        )
        poses.append(pose._replace(coordinates={name: every[name].T for name in pose.coordinates}))
    return requests._replace(samples=1, single=False, joints=joints, poses=tuple(poses), strict=True)


def _pointing_nearby(pose: PoseRequest, motion: Motion) -> PoseRequest:
    """Return a pose with the direction, distance and orientation of a link's motion, shape (1, ...)."""
    if pose.turn is not None:
        pose = pose._replace(turn=motion)
    if pose.direction is not None:
        axis, w = pose.direction[0], motion.w
        d = motion.R[:, :, axis]
        d_dot = cross(w, d)
        levels = np.stack([d, d_dot, cross(motion.w_dot, d) + cross(w, d_dot)])
        pose = pose._replace(direction=(axis, levels))
    if pose.distance is not None:
        centre = pose.distance[1][:, :1]
        far = np.linalg.norm(motion.p - centre[0], axis=1)
        speeds = motion.p_dot[:, 0], motion.p_ddot[:, 0]
        pose = pose._replace(distance=(np.stack([far, *speeds]), centre))
    return pose
