"""Loop closing: from motor positions or poses of links to the complete posture and its derivatives.

The modules are solved in order from the base. The given motors and poses of a module and its closures form a
Newton problem on its tree after the cuts. The positions of cut wrists follow from the bodies they connect.
Poses through several modules couple these (`chain`).
"""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..errors import HybridynError, TrajectoryError
from ..linkage.elimination import least_squares
from ..linkage.loop_problem import LoopProblem
from ..linkage.motion import Motion
from ..spatial import Array
from ..structure.module import Module
from ..structure.robot import HybridRobot
from ..threads import one_thread
from .chain.coupling import chains_of
from .follow import follow
from .module_request import ModuleRequest, joined, module_request, on_own_bases, place_bodies
from .redundancy import LEAST
from .requests import (
    Requests,
    asked_requests,
    first_guess,
    home_requests,
    in_root,
)
from .spanning import settled, spanning_states
from .task import check_agreement, check_bounded, module_task

#: Samples of equal modules that are assembled at once: more take memory and save no time.
MOST_TOGETHER = 2000


@one_thread()
def assemble(
    robot: HybridRobot,
    *,
    motors: Mapping[str, object] | ArrayLike | None = None,
    platforms: Mapping[str, object] | None = None,
    guess: Array | None = None,
    nearest: bool = False,
    hold: Iterable[str] = (),
    weights: Mapping[str, float] | None = None,
    redundancy: str = LEAST,
) -> tuple[Array, Array, Array]:
    """Compute a posture that closes all loops from motor positions, poses of links, or a mixture.

    Args:
        robot: The robot.
        motors: Joint name to (position, rate, acceleration), each a number or shape (T,), [m or rad, and
            per second]; rates and accelerations are zero by default. Joints that gears
            (`<mimic>`, `<coupling>`) determine from them follow. Or positions in the order of
            `robot.motors`, shape (motors,) or (T, motors), or a tuple of positions, rates and accelerations.
            Or a table with named columns (a DataFrame), `<motor>/position` or just the motor's name; its
            column `time` is not read.
        platforms: "link" (relative to the root link), "link@other" (relative to another link) or "link@world"
            (in the world, where a moving or floating base has its pose) to (pose, twist, acceleration). The
            pose is x, y, z, qx, qy, qz, qw, shape (7,) or (T, 7), a matrix, shape (4, 4) or (T, 4, 4), or a
            `pin.SE3`. The twist, shape (T, 6), holds the velocity of the link's origin and its angular
            velocity relative to the other link, in the other link's axes. The acceleration holds their time
            derivatives (classical). For a partial pose (the paper's v_r), each is a mapping from some of x,
            y, z, roll, pitch, yaw to numbers or shapes (T,); an orientation may also be qx, qy, qz, qw or
            rx, ry, rz (axis times angle), with rates wx, wy, wz. The direction of one of the link's axes is,
            for its z axis, zx, zy, zz, a vector of any length. `distance` is that of the link's origin from
            the other's, or from the point cx, cy, cz of the other link. For a moving or floating base, the
            root link's name stands for the pose of the base in the world (at rest by default). A pose may go
            through several modules; where it leaves freedoms of motors, `redundancy` takes them.
        guess: Initial posture, shape (nq,). If it closes the loops to 1e-3 module lengths, all that is given
            moves straight from there to the first sample, on the guess's assembly branch. From another one,
            and from the home posture, which is the default, the first sample is on that branch if the branch
            reaches it. A trajectory is followed from its first sample without leaving the branch.
        nearest: Whether rates and accelerations may contradict one another, as measured ones do, or those of
            a spline through positions.
        hold: Joints that stay where the guess has them: as if `motors` gave these positions.
        weights: Motor to a factor that multiplies its motion over its range, where motors move least: one
            above 1 spares the motor. With "middle of ranges", it multiplies its way from there.
        redundancy: The rule that takes freedoms of motors which poses leave: "least motion" from row to row;
            or "middle of ranges": of the postures that meet the poses, the one in which the motors are
            nearest to the middle of their ranges, each way divided by half the range, by the sum of squares.
            This posture depends on the poses alone, and on the least one that the guess leads to; its rates
            and accelerations are its derivatives. All motors that may move need a range then. Or "away from
            singular", in the same way: the one with the largest product of all singular values of the maps
            from the joints to the poses and to the motors (of free motions that are orthonormal in rad and
            module lengths), over the exponential of the sum of squares of the same ways: a motor at a limit
            divides it by e, one without a range never.

    Returns:
        q, v, a on the spanning tree, shapes (nq,), (nv,), (nv,), or (T, ...) if any input has T samples.
        Motions that move no motor and no output get least-norm rates. Where more is given than there are
        freedoms, rates and accelerations are the nearest ones that keep the loops closed.

    Raises:
        AssemblyError: A target is out of reach, a step would leave the branch, the posture is
            underdetermined, or the least posture of a rule ends; or rates contradict one another by more than
            0.01 of the sample's largest (at least 1 rad/s or module length per second), or accelerations,
            unless all are zero.
        SingularityError: The joints cannot follow the motion, for example of a platform with a stretched leg.
        TrajectoryError: A name is unknown, a shape is wrong, a number is not finite, or there is no sample.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> q, v, a = hybridyn.assemble(robot, motors={"m1_left_drive": 0.1, "m1_right_drive": 0.2})
        >>> float(hybridyn.closure_residual(robot, q)) < 1e-12
        True
        >>> q, v, a = hybridyn.assemble(robot, platforms={"m1_tool": {"x": 0.05, "z": -0.5}})
        >>> q[robot.motor_q].round(3)
        array([ 0.049, -0.322])
    """
    requests = asked_requests(robot, motors, platforms, guess, nearest, hold, weights, redundancy)
    if not requests.samples:
        raise TrajectoryError("motors and platforms have no samples; give at least one")
    q, v, a = assemble_requests(robot, requests, first_guess(robot, guess))
    return (q[0], v[0], a[0]) if requests.single else (q, v, a)


@one_thread()
def assemble_home(robot: HybridRobot) -> Array:
    """Compute the posture, shape (nq,), that closes all loops with the motors at home.

    Joints that neither the motors nor the closures determine stay at home.

    Raises:
        AssemblyError: As in `assemble`.
    """
    out: Array = assemble_requests(robot, home_requests(robot), robot.home)[0][0]
    return out


def assemble_requests(robot: HybridRobot, requests: Requests, guess: Array) -> tuple[Array, Array, Array]:
    """Compute the postures of `assemble` from checked requests.

    Args:
        requests: Requests for T samples.
        guess: Initial posture, shape (nq,).

    Returns:
        q, v, a on the spanning tree, shapes (T, nq), (T, nv), (T, nv).
    """
    T = requests.samples
    q, v, a = np.tile(guess, (T, 1)), np.zeros((T, robot.nv)), np.zeros((T, robot.nv))
    place_base(robot, requests, q, v, a)
    requests = in_root(robot, requests, guess)
    alone, chains = chains_of(robot, requests)
    coupled = {k for chain in chains for k in chain.modules}
    numbers = [k for k in range(1 if robot.base == "floating" else 0, len(robot.modules)) if k not in coupled]
    assemble_by = _kind_by_kind if on_own_bases(alone, robot) else _one_by_one
    assemble_by(robot, alone, numbers, q, v, a)
    for chain in chains:
        from .chain.solve import assemble_chain  # which few requests need

        assemble_chain(robot, requests, chain, guess, q, v, a)
    return q, v, a


def _kind_by_kind(
    robot: HybridRobot, requests: Requests, numbers: Sequence[int], q: Array, v: Array, a: Array
) -> None:
    """Assemble modules that need no other one, equal ones together."""
    kinds: dict[object, list[tuple[Module, ModuleRequest]]] = {}
    for k in numbers:
        request = module_request(requests, robot, k, {})
        alone = k if request.targets else -1
        kind = (robot.modules[k].mechanism, tuple(request.given), alone)
        kinds.setdefault(kind, []).append((robot.modules[k], request))
    together = max(1, MOST_TOGETHER // len(q))
    for equal in kinds.values():
        for i in range(0, len(equal), together):
            _assemble_equal(robot, equal[i : i + together], q, v, a)


def _one_by_one(
    robot: HybridRobot, requests: Requests, numbers: Sequence[int], q: Array, v: Array, a: Array
) -> None:
    """Assemble modules in order from the base, each from the motions of the bodies before it.

    Modules that are not among them stay as they are: no pose is relative to a body that they move.
    """
    bodies = {0: Motion.at_rest(len(q))}
    for k, module in list(enumerate(robot.modules))[1 if robot.base == "floating" else 0 :]:
        if k in numbers:
            assemble_modules(robot, [(module, module_request(requests, robot, k, bodies))], q, v, a)
        motion = module.mechanism.spanning.sweep(
            q[:, module.q_index], v[:, module.v_index], a[:, module.v_index]
        )
        place_bodies(robot, module, motion, bodies)


def place_base(robot: HybridRobot, requests: Requests, q: Array, v: Array, a: Array) -> None:
    """Write the pose of a moving or floating base into q, v, a, with Pinocchio's local velocities."""
    if robot.base == "fixed" or requests.base is None or requests.base_quaternion is None:
        return
    pose = requests.base
    q[:, :3], q[:, 3:7] = pose.p, requests.base_quaternion
    v[:, :6], a[:, :6] = pose.twist(), pose.acceleration()


def _assemble_equal(
    robot: HybridRobot, parts: Sequence[tuple[Module, ModuleRequest]], q: Array, v: Array, a: Array
) -> None:
    """Assemble equal modules together or, if one of them needs more than plain steps, one after the other."""
    try:
        assemble_modules(robot, parts, q, v, a)
    except HybridynError:
        if len(parts) == 1:
            raise
        for part in parts:
            assemble_modules(robot, [part], q, v, a)


def assemble_modules(
    robot: HybridRobot,
    parts: Sequence[tuple[Module, ModuleRequest]],
    q: Array,
    v: Array,
    a: Array,
) -> None:
    """Assemble one module or equal ones at all samples; write the result into q, v, a of the robot."""
    module, request = parts[0][0], joined(request for _, request in parts)
    m = module.mechanism
    q_index, v_index = (np.array([getattr(part, at) for part, _ in parts]) for at in ("q_index", "v_index"))
    task = module_task(robot, module, request)
    guess = q[0, q_index]
    x, task = follow(task, m.cut.positions(guess), strict=request.strict)
    x = settled(m, x)
    placed = m.tree.sweep(x)
    x_dot, x_ddot = _rates_and_accelerations(module, task.problem, request, x, placed)
    motion = m.tree.sweep(x, x_dot, x_ddot, placed)
    qk, vk, ak = spanning_states(module, (x, x_dot, x_ddot), motion, guess, trajectories=len(parts))
    for robots, own, index in ((q, qk, q_index), (v, vk, v_index), (a, ak, v_index)):
        robots[:, index] = own.reshape(len(parts), len(q), -1).swapaxes(0, 1)


def _rates_and_accelerations(
    module: Module, problem: LoopProblem, request: ModuleRequest, x: Array, placed: Motion
) -> tuple[Array, Array]:
    """Solve the same rows for rates and accelerations of the tree after the cuts, `placed` at positions x."""
    m, samples = module.mechanism, np.arange(len(x))
    K = problem.matrix(placed, samples)
    wanted = [np.zeros((len(x), m.closures.rows))]
    wanted += [t.rates(placed, samples)[0] / t.units for t in problem.targets]
    given = request.known_v, request.known_a
    x_dot = _solve(module, problem, K, given[0], np.concatenate(wanted, axis=1), "rates", request)
    motion = m.tree.sweep(x, x_dot, at=placed)
    drift = m.closures.rates(motion, x_dot)[1] * m.reduction.row_scale
    wanted = [-drift] + [t.rates(motion, samples)[1] / t.units for t in problem.targets]
    right = np.concatenate(wanted, axis=1)
    return x_dot, _solve(module, problem, K, given[1], right, "accelerations", request)


def _solve(
    module: Module, problem: LoopProblem, K: Array, known: Array, wanted: Array, what: str,
    request: ModuleRequest,
) -> Array:  # fmt: skip
    """Solve the rows for the free freedoms; then correct all freedoms if closures are still violated."""
    m = module.mechanism
    asked = known / problem.col_scale
    x = asked + problem.solve(K, wanted - np.einsum("tij,tj->ti", K, asked))
    check_bounded(module, problem, K, x, wanted, what)
    rows = m.closures.rows
    miss = wanted[:, :rows] - np.einsum("tij,tj->ti", K[:, :rows], x)
    scale = np.abs(x).max(axis=1, initial=0.0) + np.abs(wanted).max(axis=1, initial=0.0)
    bent = np.flatnonzero(np.abs(miss).max(axis=1, initial=0.0) > 1e-12 * scale)
    if len(bent):
        x[bent] += least_squares(K[bent][:, :rows], miss[bent], rank=m.reduction.rank)
    if (len(bent) or problem.targets) and what not in request.nearest:
        check_agreement(module, problem, K, x, asked, wanted, what, request)
    return x * problem.col_scale
