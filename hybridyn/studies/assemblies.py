"""Search for all postures with given motor positions and platform poses, from seeded random starts.

Each start takes undamped Newton steps of limited length, whether or not the residual decreases, until it
converges to some posture. Postures with small basins of attraction are therefore reached as well. The
postures reached are closed to rounding as in `assemble`, and counted.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..assembly.assemble import place_base
from ..assembly.chain.coupling import chains_of
from ..assembly.follow import follow
from ..assembly.module_request import module_request, on_own_bases, place_bodies
from ..assembly.requests import Requests, gather_requests, in_root
from ..assembly.spanning import settled, spanning_positions
from ..assembly.task import Task, closure_residual, module_task
from ..description.names import listed
from ..errors import AssemblyError, TrajectoryError
from ..linkage.motion import Motion
from ..linkage.newton import SMALLEST_STEP
from ..spatial import Array, Index, Mask
from ..streams.departures import position_limits
from ..structure.module import Module
from ..structure.robot import HybridRobot
from ..threads import one_thread

#: Two postures are equal if no mark that distinguishes postures differs by more (module lengths, cosines).
SAME_ASSEMBLY = 1e-5
#: A mark that an idle motion of size `NUDGE` changes by `NUDGED` or more does not distinguish postures.
NUDGE, NUDGED = 1e-3, 1e-5
#: Longest step of the search [rad, module lengths], maximum number of steps, and the residual of a start
#: that has converged.
LONGEST_STEP, MOST_STEPS, CONVERGED = 1.0, 60, 1e-10
#: Regularisation of the normal equations of the least-norm steps, relative to their trace.
REGULARISATION = 1e-12
#: Number of starts per batch: small enough that their arrays stay in the cache.
STARTS_AT_ONCE = 1000
#: Maximum number of postures of a robot; the numbers of stacked modules multiply.
MOST_POSTURES = 10_000


@dataclass(frozen=True, eq=False)
class Assemblies:
    """The postures found, ordered by distance from the home posture.

    Attributes:
        q: Positions on the spanning tree, shape (n, nq); cut wrists follow their platforms.
        counts: Number of starts that led to each, shape (n,); for stacked modules, the smallest number of
            its modules.
        residual: Closure residual of each, relative to its module's length, shape (n,).
        within_limits: Whether all joints of each posture are within their position limits, shape (n,).
        starts: Number of random starts per module.
        unseen: Estimated probability that one more start finds another posture (Good and Turing: the share of
            the starts whose posture no other start found). If it is above 0, use more starts.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> found = hybridyn.assemblies(robot, motors=[0.1, 0.2], starts=50)
        >>> found.within_limits
        array([ True, False])
        >>> bool(found.residual.max() < 1e-12)
        True
    """

    q: Array
    counts: Index
    residual: Array
    within_limits: Mask
    starts: int
    unseen: float


@one_thread()
def assemblies(
    robot: HybridRobot,
    *,
    motors: Mapping[str, object] | None = None,
    platforms: Mapping[str, object] | None = None,
    starts: int = 1000,
    seed: int = 0,
) -> Assemblies:
    """Find the postures with given motor positions and platform poses.

    Two postures are equal if they agree in the placements of the outputs, the positions of the motors, the
    origins and centres of mass of the legs' links, and the closure points. Whole turns, signs of
    quaternions, a rod's idle spin, and the two solutions of a universal joint for a straight leg therefore
    do not distinguish postures. Of such variants the one nearest to the home posture is returned.

    Args:
        robot: The robot.
        motors: As in `hybridyn.assemble`, one sample; rates are not used.
        platforms: As in `hybridyn.assemble`, one sample.
        starts: Number of random starts per module with loops.
        seed: Seed of the starts; the same seed finds the same postures.

    Returns:
        The postures. Each closes all loops; joints may be beyond their limits. The search may miss postures:
        see `Assemblies.unseen`.

    Raises:
        AssemblyError: There is no posture, it is underdetermined, or stacked modules have more than 10,000.
        TrajectoryError: A name is unknown, a shape is wrong, or there are several samples.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> found = hybridyn.assemblies(robot, motors=[0.1, 0.2], starts=50)
        >>> len(found.q)  # the tool below the elbows, and above
        2
    """
    requests = gather_requests(robot, motors, platforms)
    if not requests.single:
        raise TrajectoryError("assemblies takes one sample: numbers, and poses of shape (7,)")
    return search(robot, requests, starts, seed)


@one_thread()
def search(robot: HybridRobot, requests: Requests, starts: int, seed: int) -> Assemblies:
    """Find the postures of checked requests for one sample; errors are those of `assemblies`."""
    if starts < 1:
        raise TrajectoryError(f"starts must be at least 1, not {starts}")
    requests = in_root(robot, requests, robot.home)
    # A chain of one module is refused by what it leaves open.
    for chain in (one for one in chains_of(robot, requests)[1] if len(one.modules) > 1):
        names = listed(robot.modules[k].name for k in chain.modules)
        raise AssemblyError(
            f"the pose of '{chain.poses[0].link}' moves {names} together; their postures are searched one "
            "module after the other: give motors, or the pose of each module relative to its base",
            module=robot.modules[chain.modules[-1]].name,
        )
    q, counts, unseen = _search(robot, requests, starts, seed)
    return Assemblies(q, counts, closure_residual(robot, q), _within_limits(robot, q), starts, unseen)


def _within_limits(robot: HybridRobot, q: Array) -> Mask:
    """Check which postures, shape (n, nq), keep every joint within its limits."""
    within = np.ones(len(q), dtype=bool)
    for joint in robot.description.joints:
        if joint.kind.additive and (limits := position_limits(joint)):
            x = q[:, robot.q_slices[robot.joint_index[joint.name]].start]
            within &= (x >= limits[0]) & (x <= limits[1])
    return within


def _search(robot: HybridRobot, requests: Requests, starts: int, seed: int) -> tuple[Array, Index, float]:
    """Search the modules from the base outwards, each for every posture of the modules below it.

    Returns:
        `q`, `counts` and `unseen` of `Assemblies`.

    Raises:
        AssemblyError: A module has no posture for some of them, or there are too many.
    """
    q, counts, unseen, bodies = robot.home[None].copy(), np.array([starts]), 0.0, {0: Motion.at_rest(1)}
    place_base(robot, requests, q, *np.zeros((2, 1, robot.nv)))
    known: dict[tuple[int, bytes], tuple[Array, Index]] = {}
    for number in range(robot.base == "floating", len(robot.modules)):
        module, alone = robot.modules[number], on_own_bases(requests, robot, number)
        found = []
        for row in range(1 if alone else len(q)):
            below = {body: motion.take(np.array([row])) for body, motion in bodies.items()}
            task = module_task(robot, module, module_request(requests, robot, number, below))
            asked = task.problem.residual(module.mechanism.home[None], np.zeros(1, dtype=int))
            key = id(module.mechanism), np.round(np.concatenate([task.known, asked], axis=1), 9).tobytes()
            if key not in known:
                known[key] = postures(robot, module, task, starts, seed)
            found.append(known[key])
        found = found * len(q) if alone else found
        _check_number(module, sum(len(own) for _, own in found))
        rows = np.repeat(np.arange(len(q)), [len(own) for _, own in found])
        q = q[rows]
        q[:, module.q_index] = np.concatenate([own for own, _ in found])
        counts = np.minimum(counts[rows], np.concatenate([own for _, own in found]))
        once = max(float((own == 1).sum()) for _, own in found) / starts
        unseen = 1 - (1 - unseen) * (1 - once)
        bodies = {body: motion.take(rows) for body, motion in bodies.items()}
        motion = module.mechanism.spanning.sweep(q[:, module.q_index])
        place_bodies(robot, module, motion, bodies)
    return q, counts, unseen


def _check_number(module: Module, total: int) -> None:
    """Refuse a number of postures that would take too long."""
    if total > MOST_POSTURES:
        raise AssemblyError(
            f"module '{module.name}': with the modules below it, it has at least {total} postures "
            f"(limit {MOST_POSTURES}): the numbers of stacked modules multiply. Give the poses of some "
            "platforms",
            module=module.name,
        )


def postures(robot: HybridRobot, module: Module, task: Task, starts: int, seed: int) -> tuple[Array, Index]:
    """Find the postures of one module, shape (n, nq), and the number of starts that led to each, shape (n,).

    Raises:
        AssemblyError: There is none.
    """
    m, rng = module.mechanism, np.random.default_rng(seed)
    nearest, task = follow(task, m.home)
    reached = [nearest]
    if m.closures.rows:
        spread = np.where(m.tree.linear, m.length, np.pi)
        for first in range(0, starts, STARTS_AT_ONCE):
            noise = rng.uniform(-spread, spread, (min(STARTS_AT_ONCE, starts - first), m.tree.nv))
            reached.append(_reached(task, m.tree.integrate(np.tile(m.home, (len(noise), 1)), noise)))
    x = settled(m, np.concatenate(reached))
    marks = marks_of(module, x)[:, unchanged_by_idle_motions(task, module, x[:8])]
    label, counts = grouped(marks)
    counts[0] = counts[0] - 1 if m.closures.rows else starts  # the posture of `assemble` is no random start
    turned = np.abs(m.tree.difference(np.tile(m.home, (len(x), 1)), x) / task.problem.col_scale).sum(axis=1)
    kept = np.array([np.flatnonzero(label == i)[np.argmin(turned[label == i])] for i in range(len(counts))])
    order = np.lexsort([*np.round(marks[kept].T / SAME_ASSEMBLY), np.round(turned[kept] / SAME_ASSEMBLY)])
    x = x[kept[order]]
    guess = robot.home[module.q_index]
    one_by_one = [spanning_positions(module, row[None], m.tree.sweep(row[None]), guess) for row in x]
    return np.concatenate(one_by_one), counts[order]


def _reached(task: Task, q: Array) -> Array:
    """Compute the closed postures reached from starts, shapes (starts, nq) and (closed, nq)."""
    problem, q = task.problem, task.with_known(q, np.zeros(len(q), dtype=int))
    active, there = np.arange(len(q)), np.zeros(len(q), dtype=bool)
    for _ in range(MOST_STEPS):
        motion = problem.tree.sweep(q[active])
        residual = problem.residual(q[active], np.zeros(len(active), dtype=int), motion)
        there[active] = np.abs(residual).max(axis=1, initial=0.0) < CONVERGED
        K = problem.matrix(motion, np.zeros(len(active), dtype=int), every=False)[:, :, problem.free]
        square = K @ K.transpose(0, 2, 1)
        size = np.trace(square, axis1=1, axis2=2)[:, None, None]
        square += (REGULARISATION * size + np.finfo(float).tiny) * np.eye(square.shape[1])
        dx = np.zeros((len(active), problem.tree.nv))
        dx[:, problem.free] = -(K.transpose(0, 2, 1) @ np.linalg.solve(square, residual[..., None]))[..., 0]
        length = np.abs(dx).max(axis=1, initial=0.0)
        there[active] |= length < SMALLEST_STEP  # for targets that contradict one another within tolerance
        dx *= np.minimum(1.0, LONGEST_STEP / np.maximum(length, LONGEST_STEP))[:, None]
        q[active] = problem.tree.integrate(q[active], dx * problem.col_scale)
        active = active[~there[active]]
        if not len(active):
            break
    result = task.solve(q[there], np.zeros(there.sum(), dtype=int))
    return result.q[task.closed(result)]


def marks_of(module: Module, x: Array) -> Array:
    """Compute the dimensionless marks that distinguish postures, shape (T, marks): see `assemblies`."""
    m = module.mechanism
    motion = m.tree.sweep(x)
    marks = [motion.p[:, 1:].reshape(len(x), -1) / m.length]
    for i, link in enumerate(m.spec.leg_bodies):
        if link is not None and link.mass:
            marks.append((motion.p[:, i + 1] + motion.R[:, i + 1] @ link.com) / m.length)
    for c in m.closures.closures:
        marks.append((motion.p[:, c.body_a] + motion.R[:, c.body_a] @ c.p_a) / m.length)
        marks.append((motion.p[:, c.body_b] + motion.R[:, c.body_b] @ c.p_b) / m.length)
    marks += [motion.R[:, body].reshape(len(x), 9) for body in m.spec.outputs]
    for i, (joint, at) in enumerate(zip(m.tree.joints, m.tree.q_slices, strict=True)):
        if m.tree.v_slices[i].start in module.motor_columns:
            value = x[:, at]
            turned = [np.cos(value), np.sin(value)] if joint.kind.additive else [value]
            marks += [value / m.length] if joint.kind.slides else turned
    return np.concatenate(marks, axis=1)


def unchanged_by_idle_motions(task: Task, module: Module, x: Array) -> Mask:
    """Determine the marks that no idle motion changes, shape (marks,), from a few postures (T, nq)."""
    problem = task.problem
    K = problem.matrix(problem.tree.sweep(x), np.zeros(len(x), dtype=int))[:, :, problem.free]
    here = marks_of(module, x)
    still = np.ones(here.shape[1], dtype=bool)
    for idle in np.moveaxis(np.linalg.svd(K)[2][:, problem.rank or 0 :], 1, 0):
        dx = np.zeros((len(x), problem.tree.nv))
        dx[:, problem.free] = NUDGE * idle
        moved = marks_of(module, problem.tree.integrate(x, dx * problem.col_scale))
        still &= np.abs(moved - here).max(axis=0) < NUDGED
    return still


def grouped(marks: Array) -> tuple[Index, Index]:
    """Group equal rows of marks, shape (n, marks); return the group of each row and the group sizes."""
    label = np.full(len(marks), -1)
    groups = 0
    while (label < 0).any():
        rest = np.flatnonzero(label < 0)
        label[rest[np.abs(marks[rest] - marks[rest[0]]).max(axis=1, initial=0.0) <= SAME_ASSEMBLY]] = groups
        groups += 1
    return label, np.bincount(label)
