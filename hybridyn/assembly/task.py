"""The problem of closing one module's loops at every sample of a trajectory, and whether it has a solution.

Read `module_task` first: what is given must determine the posture, and rates must stay bounded.
`closure_residual` states how far any posture is from closing the loops.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..description.groups import Groups
from ..description.names import counted, listed
from ..errors import AT_SAMPLE, AssemblyError, SingularityError
from ..linkage.loop_problem import LoopProblem
from ..linkage.newton import RESIDUAL_ROUNDING, SMALLEST_STEP, Closed, close
from ..linkage.reduction import LegBlock, decide_rank
from ..linkage.targets import CoordinateTarget, named_rows, row_measures
from ..spatial import Array, Index, Mask, in_turn, indices
from ..structure.module import Module
from ..structure.robot import HybridRobot
from ..structure.samples import as_positions
from .free_motions import IDLE, effects
from .module_request import ModuleRequest

#: Rows over the free freedoms are singular if their reciprocal condition number is below this.
SINGULAR_ROWS = 1e-10
#: A joint can stay in place of a motion that moves it by more than this part of the motion's size: far above
#: rounding, and such that the motion it leaves is not nearly the same.
MOVED = 1e-3
#: Ratio of computed to prescribed rates above which a singularity is suspected.
BOUNDED = 1e6
#: Given rates and accelerations may differ from the nearest ones that keep the loops closed by this part of
#: the sample's largest, which counts as 1 rad or module length per second at least: rounding passes, also at
#: rest, a wrong or missing one does not.
CONTRADICTION = 1e-2
#: Rows that contradict one another within the tolerance are accepted if their reciprocal condition number
#: is above this.
CONTRADICTING_RANK = 1e-9


def too_many(wanted: int, left: Mapping[str, int], independent: int | None = None) -> str:
    """Return how many numbers poses prescribe, and how many freedoms they find, by module.

    Args:
        wanted: The numbers.
        left: The freedoms of each module.
        independent: How many of the numbers are independent, if fewer.
    """
    each = ", ".join(f"{count} of '{module}'" for module, count in left.items())
    if independent is not None and independent < min(wanted, sum(left.values())):
        return f"; poses prescribe {wanted} numbers, of which {independent} are independent"
    return f"; poses prescribe {wanted} numbers, and find {sum(left.values())} freedoms ({each})"


class WeakRows(NamedTuple):
    """Rows that lose rank at singular postures.

    Attributes:
        rows: Scaled rows over some motions, shape (T, rows, motions).
        rank: Their rank at generic postures.
        motions: The motions at the first posture, scaled, shape (nv, motions).
    """

    rows: Array
    rank: int
    motions: Array


class Freedom(NamedTuple):
    """A freedom of a tree, for messages.

    Attributes:
        name: Its joint or platform.
        unit: Its unit, "m" or "rad".
        at: Number of its coordinate in q, if it has one of its own.
        lower: Least position, minus infinity without limits.
        upper: Largest position.
    """

    name: str
    unit: str
    at: int | None = None
    lower: float = -np.inf
    upper: float = np.inf


class Task(NamedTuple):
    """A problem at every sample of a trajectory.

    Attributes:
        problem: Rows and free freedoms.
        known: Positions, shape (T, nq); only those of the joints in `given` are used.
        given: Indices of the joints whose positions are given.
        tolerance: Largest scaled residual of a closed posture.
        module: The module's name, for messages.
        row_names: Name of each row's closure, coupling or target, for messages.
        freedoms: What is told of each freedom.
    """

    problem: LoopProblem
    known: Array
    given: Sequence[int]
    tolerance: float
    module: str
    row_names: Sequence[str]
    freedoms: Sequence[Freedom]

    def with_known(self, q: Array, samples: Index) -> Array:
        """Return positions with the given joints set to their values."""
        q, at = q.copy(), indices(self.problem.tree.q_slices[joint] for joint in self.given)
        q[:, at] = self.known[samples][:, at]
        return q

    def solve(self, q: Array, samples: Index, *, enough: float = np.inf) -> Closed:
        """Close the loops from starts q, with the given joints at their values; `enough` as in `close`."""
        return close(self.problem, self.with_known(q, samples), samples, enough=enough)

    def closed(self, result: Closed) -> Mask:
        """Check which samples converged and closed, shape (T,)."""
        problem = self.problem
        return closed_samples(result, self.tolerance, problem.rank, lambda q: self.weak_rows(q)[0].rows)

    def weak_rows(self, q: Array, samples: Index | None = None) -> list[WeakRows]:
        """Return the scaled rows over the free freedoms, which lose rank at singular postures."""
        problem = self.problem
        K = problem.matrix(problem.tree.sweep(q), samples)[:, :, problem.free]
        rank = min(K.shape[1:]) if problem.rank is None else problem.rank
        return [WeakRows(K, rank, np.eye(problem.tree.nv)[:, problem.free])]

    def loose(self, q: Array) -> Array:
        """Return motions that keep loops closed at a posture (1, nq), whatever is given, shape (nv, k)."""
        problem = self.problem
        K = replace(problem, targets=()).matrix(problem.tree.sweep(q))
        rank = decide_rank(K, problem.rank_tolerance).rank
        out: Array = np.linalg.svd(K[0])[2][rank:].T
        return out

    @property
    def label(self) -> str:
        """The module, for messages."""
        return f"module '{self.module}'"

    @property
    def row_measures(self) -> list[tuple[float, str] | None]:
        """What one is of each row of a target, see `row_measures`; None for rows of loops."""
        loops: list[tuple[float, str] | None] = [None] * self.problem.closures.rows
        return loops + [one for target in self.problem.targets for one in row_measures(target)]

    @property
    def redundant(self) -> bool:
        """Whether what is given leaves freedoms to a rule: never in a module of its own."""
        return False

    def predicted(self, q: Array, samples: Index) -> Array | None:
        """Return where a rule leads from postures that nearly meet the rows, (T, nq), or None without one."""
        return None

    def surplus(self, q: Array) -> str:
        """Return what to say of poses that prescribe more than what else is given leaves, or "".

        Args:
            q: A posture, shape (1, nq).
        """
        problem = self.problem
        wanted = sum(len(target.units) for target in problem.targets)
        K = problem.matrix(problem.tree.sweep(q))[:, : problem.closures.rows, problem.free]
        left = int(problem.free.sum()) - decide_rank(K, problem.rank_tolerance).rank
        return too_many(wanted, {self.module: left}) if wanted > left else ""

    def open_by(self, q: Array) -> float:
        """Return the largest scaled residual of the closures at postures, whatever is given."""
        loops = replace(self.problem, targets=())
        return float(np.abs(loops.residual(q, np.arange(len(q)))).max(initial=0.0))

    def closed_near(self, q: Array) -> Closed:
        """Close the loops near postures, whatever is given; postures that close to rounding stay."""
        free = np.ones(self.problem.tree.nv, dtype=bool)
        loops = replace(self.problem, free=free, targets=(), rank=None, blocks=())
        open_by = np.abs(loops.residual(q, np.arange(len(q)))).max(axis=1, initial=0.0)
        if (open_by <= RESIDUAL_ROUNDING).all():
            return Closed(q, open_by, np.zeros(len(q)), 0)
        return close(loops, q)

    def from_here(self, q: Array, samples: Index) -> Task:
        """Return the way from postures to samples, two samples for each, one after the other."""
        motion = self.problem.tree.sweep(q)
        targets = [target.from_here(motion, samples) for target in self.problem.targets]
        problem = replace(self.problem, targets=targets)
        return self._replace(problem=problem, known=in_turn(q, self.known[samples]))

    def lacking(self, q: Array, samples: Index) -> Array:
        """Return the length that the loops lack in any posture, see `shortfall`."""
        from .shortfall import shortfall  # loops that close need none

        return shortfall(self.problem, self.with_known(q, samples), samples, self.given, self.tolerance)

    def mirrored(self, q: Array, samples: Index) -> Mask:
        """Check which samples take an angle in the other of its triples: there it is not the prescribed one.

        Args:
            q: Postures, shape (n, nq).
            samples: Their indices, shape (n,).
        """
        targets = [t for t in self.problem.targets if isinstance(t, CoordinateTarget) and t.turns]
        out = np.zeros(len(q), dtype=bool)
        if targets:
            motion = self.problem.tree.sweep(q)
            for target in targets:
                out |= target.missed(motion, samples, self.tolerance)
        return out

    def headed(self, q: Array, samples: Index, *, done: float | None = None) -> Task:
        """Return the task whose angles are told apart by postures, see `CoordinateTarget.headed`.

        Args:
            q: Postures at consecutive samples, shape (n, nq).
            samples: Their indices, shape (n,).
            done: Where one posture is, as a part of the way from its sample to the next: it counts for this
                way alone. None for postures at samples, of which the last counts for all later ones.
        """
        if not any(isinstance(target, CoordinateTarget) and target.turns for target in self.problem.targets):
            return self
        motion = self.problem.tree.sweep(q)
        targets = [target.headed(motion, samples, on=done is None) for target in self.problem.targets]
        return self._replace(problem=replace(self.problem, targets=targets))

    def headed_at(self, q: Array, values: Array) -> Task:
        """Return the task of one pose with the headings of its coordinates at postures.

        Args:
            q: A posture for each sample, shape (T, nq).
            values: Coordinates of the pose there, see `CoordinateTarget.headed_at`.
        """
        motion = self.problem.tree.sweep(q)
        targets = [target.headed_at(motion, values) for target in self.problem.targets]
        return self._replace(problem=replace(self.problem, targets=targets))

    def between(self, sample: int, fractions: Array) -> Task:
        """Interpolate the task from a sample to the next, one new sample per fraction, shape (n,)."""
        tree = self.problem.tree
        start = np.tile(self.known[sample], (len(fractions), 1))
        whole = tree.difference(self.known[sample : sample + 1], self.known[sample + 1 : sample + 2])
        known = tree.integrate(start, fractions[:, None] * whole)
        known[fractions == 1.0] = self.known[sample + 1]
        targets = [t.between(sample, fractions) for t in self.problem.targets]
        return self._replace(problem=replace(self.problem, targets=targets), known=known)


def closed_samples(
    result: Closed, tolerance: float, rank: int | None, rows: Callable[[Array], Array]
) -> Mask:
    """Check which samples of a result converged and closed, shape (T,).

    Args:
        result: What Newton's method found.
        tolerance: Largest scaled residual of a closed posture.
        rank: Rank of the rows at generic postures.
        rows: Returns the rows over what may move at postures, shape (T, rows, columns).
    """
    settled = (result.step <= SMALLEST_STEP) | (result.residual <= RESIDUAL_ROUNDING)
    out: Mask = settled & (result.residual <= tolerance)
    doubtful = np.flatnonzero(out & (result.residual > RESIDUAL_ROUNDING))
    if len(doubtful) and rank:
        # Where rows lose rank, a zero step proves nothing: the target may be just out of reach.
        s = np.linalg.svd(rows(result.q[doubtful]), compute_uv=False)
        out[doubtful] = s[:, rank - 1] > CONTRADICTING_RANK * s[:, 0]
    return out


def module_task(robot: HybridRobot, module: Module, request: ModuleRequest, *, alone: bool = True) -> Task:
    """Build the problem of a module's closures, given joints and targets.

    Args:
        robot: The robot.
        module: The module.
        request: What is given in it.
        alone: Whether this must determine its posture.

    Raises:
        AssemblyError: It does not, see `check_determined`.
    """
    m = module.mechanism
    free = np.ones(m.tree.nv, dtype=bool)
    for joint in request.given:
        free[m.tree.v_slices[joint]] = False
    problem = LoopProblem(
        m.closures, m.reduction.row_scale, m.reduction.col_scale, free,
        [target for _, target in request.targets], rank_tolerance=m.rank_tolerance,
    )  # fmt: skip
    generic = _generic_rows(module, problem)
    if request.stay:
        for joint in undetermined(module, problem, generic):
            request.given.append(joint)
            free[m.tree.v_slices[joint]] = False
    if alone:
        rank = check_determined(robot, module, problem, generic)
        blocks = full_rank_blocks(generic, free, m.rank_tolerance, sure=rank == int(free.sum()))
    else:
        rank, blocks = decide_rank(generic[:, :, free], m.rank_tolerance).rank, []
    problem = replace(problem, rank=rank, blocks=blocks)
    names = [f"closure '{name}'" for name, at in module.named_rows() for _ in range(at.stop - at.start)]
    names += [name for link, target in request.targets for name in named_rows(target, link)]
    tolerance = max(robot.closure_tolerance, 1e-12)
    freedoms = _freedoms(robot, module)
    return Task(problem, request.known, request.given, tolerance, module.name, names, freedoms)


def _freedoms(robot: HybridRobot, module: Module) -> list[Freedom]:
    """Return what is told of each freedom of a module's tree after the cuts."""
    m, out = module.mechanism, [*map(Freedom, module.freedom_names(), module.freedom_units())]
    for i, (joint, source) in enumerate(zip(m.tree.joints, m.spec.tree_joint, strict=True)):
        if source is not None and joint.kind.additive:
            known, at = robot.records[module.joints[source]], m.tree.v_slices[i].start
            low, high = (known.lower, known.upper) if known.lower < known.upper else (-np.inf, np.inf)
            out[at] = out[at]._replace(at=m.tree.q_slices[i].start, lower=low, upper=high)
    return out


def _generic_rows(module: Module, problem: LoopProblem) -> Array:
    """Return the scaled rows of a module's problem at generic postures, shape (samples, rows, nv)."""
    m = module.mechanism
    return problem.matrix(m.tree.sweep(m.postures)) if problem.targets else m.reduction.scaled(m.generic_K)


def left_open(robot: HybridRobot, module: Module, request: ModuleRequest) -> int:
    """Return the number of motions, idle ones apart, that what is given in a module leaves free."""
    problem = module_task(robot, module, request, alone=False).problem
    if problem.rank == int(problem.free.sum()):
        return 0
    motion = _open_motions(problem, _generic_rows(module, problem))
    s = np.linalg.svd(_moved(module, problem, motion)[0], compute_uv=False)
    return int(np.sum(s > IDLE))


def check_determined(robot: HybridRobot, module: Module, problem: LoopProblem, generic: Array) -> int:
    """Compute the generic rank of a problem's rows over its free freedoms, and check that it suffices.

    Args:
        generic: Scaled rows at generic postures, shape (samples, rows, nv).

    Raises:
        AssemblyError: A motion that is not idle remains free; the message names what it moves.
    """
    motion = _open_motions(problem, generic)
    if motion.shape[1]:
        _check_idle(robot, module, problem, generic, motion)
    return int(problem.free.sum()) - int(motion.shape[1])


def _open_motions(problem: LoopProblem, generic: Array) -> Array:
    """Compute the motions that rows leave free at the first posture, orthonormal, shape (nv, count)."""
    free = problem.free
    rank = decide_rank(generic[:, :, free], problem.rank_tolerance).rank
    motion = np.zeros((problem.tree.nv, int(free.sum()) - rank))
    if motion.shape[1]:
        motion[free] = np.linalg.svd(generic[0][:, free], full_matrices=True)[2][rank:].T
    return motion


def undetermined(module: Module, problem: LoopProblem, generic: Array) -> list[int]:
    """Choose joints that, once they are given, leave a module no motions but idle ones.

    Motors come first, then joints from the base outwards. A joint that idle motions move is none of them.

    Args:
        generic: As in `check_determined`.

    Returns:
        Indices of the joints; none if nothing is open.
    """
    motion = _open_motions(problem, generic)
    if not motion.shape[1]:
        return []
    moved = _moved(module, problem, motion)[0]
    s, Vt = np.linalg.svd(moved, full_matrices=True)[1:]
    rank = int(np.sum(s > IDLE))
    idle, motion, out = motion @ Vt[rank:].T, motion @ Vt[:rank].T, list[int]()
    slices, driven = problem.tree.v_slices, {*module.motor_columns}
    for joint in sorted(range(len(slices)), key=lambda joint: slices[joint].start not in driven):
        own = motion[slices[joint]]
        if len(own) > own.shape[1] or np.abs(idle[slices[joint]]).max(initial=0.0) > IDLE:
            continue
        s, Vt = np.linalg.svd(own, full_matrices=True)[1:]
        if s[-1] > MOVED:
            out.append(joint)
            motion = motion @ Vt[len(own) :].T
    return out


def _moved(module: Module, problem: LoopProblem, motion: Array) -> tuple[Array, list[str]]:
    """Compute how free motions, shape (nv, count), move motors, outputs, else legs' centres of mass.

    Returns:
        Scaled rates, shape (rows, count), and the name of what each row belongs to.
    """
    m = module.mechanism
    legs = [i for i, link in enumerate(m.spec.leg_bodies) if link is not None and link.mass]
    links = [f"link '{name}'" for name in module.outputs for _ in range(6)]  # outputs come first
    links = links or [f"joint '{module.joints[m.spec.tree_joint[i] or 0]}'" for i in legs for _ in range(3)]
    rates = effects(m, m.tree.sweep(m.postures[:1]))[0, : len(links)] @ (motion * problem.col_scale[:, None])
    names = [*(f"motor '{name}'" for name in module.motors), *links]
    return np.concatenate([motion[module.motor_columns], rates]), names


def _check_idle(
    robot: HybridRobot, module: Module, problem: LoopProblem, generic: Array, motion: Array
) -> None:
    """Check that free motions, shape (nv, count), move no motor, no output, and no leg's centre of mass."""
    moved, names = _moved(module, problem, motion)
    sizes = np.abs(moved).max(axis=1)
    if sizes.max(initial=0.0) <= IDLE:
        return
    raise AssemblyError(
        _what_is_open(robot, module, motion.shape[1], names[int(np.argmax(sizes))], problem, generic),
        module=module.name,
        open_freedoms=motion.shape[1],
        undriven=module.mobility - module.driven,
    )


def _what_is_open(
    robot: HybridRobot, module: Module, count: int, worst: str, problem: LoopProblem, generic: Array
) -> str:
    """Return the sentences on freedoms that are left open, and on the positions and poses that take them.

    Args:
        count: The number of these freedoms.
        worst: What they move most.
    """
    sources = (module.mechanism.spec.tree_joint[i] for i in undetermined(module, problem, generic))
    joints = [module.joints[source] for source in sources if source is not None]
    carried = {robot.modules.index(module)}
    for k, one in enumerate(robot.modules):
        carried |= {k} if one.parent in carried else set()
    outermost = robot.modules[max(carried)].name
    if joints == list(module.joints):
        return (
            f"what is given does not determine joint '{joints[0]}'. Give its position, too, or the pose of a "
            f"link that it moves, such as '{outermost}'"
        )
    further = f", or the pose of a link further out, such as '{outermost}'" if len(carried) > 1 else ""
    return (
        f"what is given leaves {count} of {counted(module.mobility, 'freedom')} of module '{module.name}' "
        f"open; {worst} could still move. Give {f'positions of {listed(joints)}, too, or ' if joints else ''}"
        f"coordinates of its links, {module.mobility} in all{further}"
    )


def check_bounded(module: Module, problem: LoopProblem, K: Array, x: Array, wanted: Array, what: str) -> None:
    """Check that joint rates or accelerations stay bounded, which fails at singular postures.

    Args:
        K: Scaled rows over all freedoms, shape (T, rows, nv).
        x: Scaled solution, shape (T, nv).
        wanted: Scaled right-hand side of the rows, shape (T, rows).
        what: "rates" or "accelerations".

    Raises:
        SingularityError: They are unbounded; the message names module, joint, sample and condition number.
    """
    given = np.abs(x[:, ~problem.free]).max(axis=1, initial=0.0)
    asked = np.maximum(given, np.abs(wanted).max(axis=1, initial=0.0))
    missed = np.abs(np.einsum("tij,tj->ti", K, x) - wanted).max(axis=1, initial=0.0)
    fast = np.abs(x).max(axis=1, initial=0.0) > BOUNDED * asked
    suspect = np.flatnonzero(fast | (BOUNDED * missed > asked))
    if not len(suspect) or not problem.free.any():
        return
    s = np.linalg.svd(K[suspect][:, :, problem.free], compute_uv=False)
    least = s[:, (problem.rank or s.shape[1]) - 1]
    singular = np.flatnonzero(least < SINGULAR_ROWS * s[:, 0])
    if not len(singular):
        return
    t, i = int(suspect[singular[0]]), int(singular[0])
    condition = float(s[i, 0] / least[i]) if least[i] else np.inf
    lost, kind, mend = _what_is_singular(module, problem, K[t])
    joint = module.freedom_names()[int(np.argmax(np.abs(x[t])))]
    raise SingularityError(
        f"module '{module.name}': the {what} given{AT_SAMPLE} cannot be followed, those of {joint} would "
        f"have no bound ({kind}; condition number {condition:.1e}, limit {1 / SINGULAR_ROWS:.0e}). Move the "
        f"motion away from there{mend}",
        module=module.name,
        what=lost,
        condition=condition,
        sample=t,
    )


def check_agreement(
    module: Module, problem: LoopProblem, K: Array, x: Array, asked: Array, wanted: Array, what: str,
    request: ModuleRequest,
) -> None:  # fmt: skip
    """Check that given rates or accelerations agree, where more are given than there are freedoms.

    Args:
        K: Scaled rows over all freedoms, shape (T, rows, nv).
        x: Scaled motion that keeps the loops closed, shape (T, nv).
        asked: The same as given, shape (T, nv).
        wanted: Scaled right-hand side of the rows, shape (T, rows).
        what: "rates" or "accelerations".
        request: What is given.

    Raises:
        AssemblyError: They contradict one another; the message names module, joint or target, and sample.
    """
    given, loops = np.flatnonzero(~problem.free), module.mechanism.closures.rows
    of_targets = np.einsum("tij,tj->ti", K[:, loops:], x) - wanted[:, loops:]
    off = np.abs(np.concatenate([x[:, given] - asked[:, given], of_targets], axis=1))
    largest = np.abs(np.concatenate([x, asked, wanted[:, loops:]], axis=1)).max(axis=1, initial=1.0)
    bad = np.flatnonzero(off.max(axis=1, initial=0.0) > CONTRADICTION * largest)
    if not len(bad):
        return
    t, i = int(bad[0]), int(np.argmax(off[bad[0]]))
    rows = [name for link, target in request.targets for name in named_rows(target, link)]
    if i >= len(given):
        name, there = rows[i - len(given)], f"differs by {off[t, i]:.4g}"
    else:
        k = given[i]
        number, near = (y[t, k] * problem.col_scale[k] for y in (asked, x))
        name, there = module.freedom_names()[k], f"has {number:.6g}, where closed loops allow {near:.6g}"
    raise AssemblyError(
        f"module '{module.name}': the {what} given{AT_SAMPLE} contradict one another: {name} {there}, which "
        f"is {off[t, i] / largest[t]:.2g} of the largest apart (limit {CONTRADICTION:g}). Give "
        f"{module.mobility} motors or coordinates of its links only, or {what} that keep the loops closed",
        module=module.name,
        sample=t,
    )


def _what_is_singular(module: Module, problem: LoopProblem, K: Array) -> tuple[str, str, str]:
    """Determine what lost rank: "closures", "legs" or "motors", a description, and a remedy.

    Args:
        K: Scaled rows over all freedoms at one sample, shape (rows, nv).
    """
    m = module.mechanism
    s = np.linalg.svd(K[: m.closures.rows], compute_uv=False)
    if m.reduction.rank and s[m.reduction.rank - 1] < SINGULAR_ROWS * s[0]:
        return "closures", "constraint singularity: the closures lose rank", ""
    given = [not problem.free[m.tree.v_slices[joint]].all() for joint in m.spec.platforms]
    if problem.targets or any(given):
        kind = "serial singularity: a leg is stretched, folded or of no length"
        return "legs", kind, ", or give motors instead of a platform"
    kind = "parallel singularity: the motors lose a direction"
    return "motors", kind, ", or give a platform instead of motors"


def full_rank_blocks(generic: Array, free: Mask, tolerance: float, *, sure: bool = False) -> list[LegBlock]:
    """Find the connected blocks of rows and free columns; empty if one lacks full column rank.

    Args:
        generic: As in `check_determined`.
        free: The columns.
        tolerance: Relative singular value from which on rows count as independent.
        sure: Whether the free columns are known to be independent, all together: then each block's are.
    """
    cols = np.flatnonzero(free)
    touched = np.abs(generic[:, :, cols]).max(axis=0, initial=0.0) > 1e-12
    groups: Groups[int] = Groups()
    for row in touched:
        groups.join_all(np.flatnonzero(row).tolist())
    blocks = []
    for own in groups.classes(range(len(cols))):
        rows = np.flatnonzero(touched[:, own].any(axis=1))
        if not sure and decide_rank(generic[:, rows[:, None], cols[own]], tolerance).rank < len(own):
            return []
        blocks.append(LegBlock(rows, cols[own]))
    return blocks


def residuals(robot: HybridRobot, q: Array) -> Iterator[tuple[Module, Array]]:
    """Yield each module that has loops with its scaled closure residuals, shape (T, rows)."""
    for module in robot.modules:
        m = module.mechanism
        if m.spanning_closures.rows:
            qk = q[:, module.q_index]
            yield module, m.residual(qk, m.spanning.sweep(qk))


def closure_residual(robot: HybridRobot, q: Array) -> Array:
    """Compute the largest closure residual of each sample, relative to its module's length.

    Args:
        robot: The robot.
        q: Positions, shape (nq,) or (T, nq).

    Returns:
        Shape () or (T,): metres over the module's length, or radians, whichever is larger.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> float(hybridyn.closure_residual(robot, robot.home)) < 1e-12
        True
        >>> float(hybridyn.closure_residual(robot, robot.home + [0, 0.1, 0, 0])) > 0.01
        True
    """
    batch, single = as_positions(robot, q)
    worst = np.zeros(len(batch))
    for _, residual in residuals(robot, batch):
        worst = np.maximum(worst, np.abs(residual).max(axis=1))
    return worst[0] if single else worst
