"""Assemble a chain: modules whose posture follows from poses of links through several of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...errors import AssemblyError
from ...linkage.motion import Motion
from ...linkage.reduction import decide_rank
from ...linkage.targets import named_rows
from ...logs import inform
from ...spatial import Array, rotation_from_quaternion
from ...structure.module import Module
from ...structure.robot import HybridRobot
from ..follow import first_postures, follow
from ..free_motions import IDLE, effects
from ..module_request import ModuleRequest
from ..pose_targets import partial_targets, whole_target
from ..poses import PoseRequest
from ..redundancy import LEAST, LeftToRule
from ..requests import Requests
from ..spanning import settled, spanning_states
from ..task import Task, module_task
from .bodies import Carried, CarriedFrame, ChainMotion
from .coupling import CoupledModules, own_requests
from .least import ease_of
from .lowest import LowestTask
from .places import ChainPlaces
from .problem import ChainProblem, Relative, Split
from .rates import ChainRates
from .second import second_task
from .task import ChainTask

#: Generic postures at which the rank of targets between links is decided, and the gap that decides it.
GENERIC, TOLERANCE = 8, 1e-7
_STILL = np.eye(3), np.zeros(3)


def assemble_chain(
    robot: HybridRobot, requests: Requests, chain: CoupledModules, guess: Array, q: Array, v: Array, a: Array
) -> None:
    """Compute the postures of a chain's modules at all samples; write them into q, v, a of the robot.

    Args:
        robot: The robot.
        requests: All requests.
        chain: The modules and the poses that couple them.
        guess: Initial posture of the whole robot, shape (nq,).
        q: Positions, shape (T, nq): those of other modules are known; the first row holds the guess.
        v: Rates, shape (T, nv).
        a: Accelerations, shape (T, nv).

    Raises:
        HybridynError: As in `assemble`.
    """
    modules = [robot.modules[k] for k in chain.modules]
    own = own_requests(robot, requests, chain)
    task = chain_task(robot, chain, own, (q, v, a))
    task = replace(task, start=_at_guess(robot, chain, task.problem, guess))
    start = cut_positions(robot, chain.modules, guess[None])
    if task.redundant:
        names = tuple(part.module for part in task.parts)
        inform(str(LeftToRule(task.left, names, requests.redundancy)), log="hybridyn.assembly")
        if requests.redundancy != LEAST:
            task, start = _lowest(robot, chain, requests, task, guess)
    x, task = follow(task, start, strict=requests.strict)
    at, to = task.problem.tree.q_of, task.problem.tree.v_of
    x = np.concatenate([settled(m.mechanism, x[:, i]) for m, i in zip(modules, at, strict=True)], axis=1)
    placed = task.problem.tree.sweep(x)
    split = task.problem.split(task.problem.matrix(placed, np.arange(len(x))))
    levels = x, *ChainRates(task, modules, own, x, placed, split).both()
    motion = task.problem.tree.sweep(*levels, at=placed)
    for module, i, j, moved in zip(modules, at, to, motion.parts, strict=True):
        states = levels[0][:, i], levels[1][:, j], levels[2][:, j]
        found = spanning_states(module, states, moved, q[0, module.q_index])
        q[:, module.q_index], v[:, module.v_index], a[:, module.v_index] = found


def _lowest(
    robot: HybridRobot, chain: CoupledModules, requests: Requests, task: ChainTask, guess: Array
) -> tuple[LowestTask, Array]:
    """Return the task of a second rule, and its first posture, shape (1, nq), from a guess (nq,)."""
    first, start = np.zeros(1, dtype=int), cut_positions(robot, chain.modules, guess[None])
    plain = task.headed(start, first)
    q = first_postures(plain, start, first, requests.strict)
    lowest = lowest_task(robot, chain.modules, requests, plain.headed(q, first), guess)
    q, found = lowest.lowered(q, first)
    if not found[0]:
        raise lowest.lost(0, "from the guess")
    return lowest, q


def lowest_task(
    robot: HybridRobot, numbers: Sequence[int], requests: Requests, task: ChainTask, guess: Array
) -> LowestTask:
    """Return the task in which a second rule takes what is left of a chain's; `guess` is a posture, (nq,).

    Raises:
        AssemblyError: As in `second_task`.
    """
    modules, problem = [robot.modules[k] for k in numbers], task.problem
    generic = generic_motion(problem, robot, numbers, guess[None])
    value = second_task(requests.redundancy, robot, modules, problem, generic, requests.weights)
    freedoms = np.split(np.arange(problem.tree.nv), [at.start for at in problem.tree.v_of[1:]])
    motors = np.concatenate([at[module.motor_columns] for module, at in zip(modules, freedoms, strict=True)])
    motors = motors[problem.free[motors]]
    return LowestTask(problem, task.parts, task.left, None, value, motors, requests.redundancy)


def cut_positions(robot: HybridRobot, modules: Sequence[int], q: Array) -> Array:
    """Return positions of the trees of modules, one after the other, shape (T, their nq), from q (T, nq)."""
    own = [robot.modules[k] for k in modules]
    return np.concatenate([m.mechanism.cut.positions(q[:, m.q_index]) for m in own], axis=1)


def chain_task(
    robot: HybridRobot,
    chain: CoupledModules,
    own: Sequence[ModuleRequest],
    states: tuple[Array, Array, Array],
) -> ChainTask:
    """Build the task of a chain, and decide how many of its targets are independent.

    Args:
        robot: The robot.
        chain: The modules and the poses that couple them.
        own: What is given in each module alone.
        states: Positions, rates and accelerations of the robot at all samples; those of the chain's modules
            are not read, but for the first posture.

    Raises:
        AssemblyError: Its modules cannot move what is prescribed at all.
    """
    numbers = chain.modules
    problem, parts = chain_problem(robot, chain, own, states)
    motion = generic_motion(problem, robot, numbers, states[0][:1])
    split = problem.split(problem.matrix(motion))
    rank = decide_rank(split.reach, TOLERANCE).rank
    if not rank:
        raise _immovable(robot, chain, problem, split.reach.shape[2])
    left = _left([robot.modules[k] for k in numbers], motion, split, rank)
    return ChainTask(replace(problem, rank=rank), parts, left)


def _left(modules: Sequence[Module], motion: ChainMotion, split: Split, rank: int) -> int:
    """Return how many motions targets of a rank leave free at generic postures, idle ones apart."""
    first, at, moved = np.zeros(1, dtype=int), 0, []
    free = np.linalg.svd(split.reach[0], full_matrices=True)[2][rank:].T
    for module, own, N in zip(modules, motion.take(first).parts, split.bases, strict=True):
        x = N[0] @ free[at : at + N.shape[2]]
        at += N.shape[2]
        units = module.mechanism.reduction.col_scale[:, None]
        moved += [x[module.motor_columns], effects(module.mechanism, own)[0] @ (x * units)]
    return int(np.sum(np.linalg.svd(np.concatenate(moved), compute_uv=False) > IDLE))


def _immovable(
    robot: HybridRobot, chain: CoupledModules, problem: ChainProblem, motions: int
) -> AssemblyError:
    """Build the error for poses that no free motion of a chain changes, of which there are so many."""
    links = ", ".join(f"'{pose.link}' relative to '{pose.reference}'" for pose in chain.poses)
    names = "', '".join(robot.modules[k].name for k in chain.modules)
    if motions:
        rows = ", ".join(dict.fromkeys(name for one in problem.relatives for name in one.names))
        why = f"no motion that is left, of '{names}', changes it ({rows})"
    else:
        why = "so are all motions between them"
    return AssemblyError(
        f"the pose of {links} is given, and {why}; leave {'it' if motions else 'one'} out",
        module=robot.modules[chain.modules[-1]].name,
    )


def chain_problem(
    robot: HybridRobot,
    chain: CoupledModules,
    own: Sequence[ModuleRequest],
    states: tuple[Array, Array, Array],
) -> tuple[ChainProblem, tuple[Task, ...]]:
    """Build the problem of a chain, and the tasks of its modules alone; arguments as for `chain_task`."""
    numbers = chain.modules
    known = ChainPlaces(robot, chain, *states)
    parts = tuple(
        module_task(robot, robot.modules[k], request, alone=False)
        for k, request in zip(numbers, own, strict=True)
    )
    carried, relatives = _standing(robot, chain, known)
    ease = tuple(
        ease_of(robot, robot.modules[k], request.weights) for k, request in zip(numbers, own, strict=True)
    )
    return ChainProblem(tuple(part.problem for part in parts), carried, relatives, ease), parts


def _standing(
    robot: HybridRobot, chain: CoupledModules, known: ChainPlaces
) -> tuple[Carried, tuple[Relative, ...]]:
    """Return what carries the modules of a chain, and the targets of its poses."""
    length = max(robot.modules[k].mechanism.length for k in chain.modules)
    relatives = tuple(one for pose in chain.poses for one in _relatives(known, pose, length))
    return Carried(tuple(known.base(k) for k in chain.modules)), relatives


def _at_guess(robot: HybridRobot, chain: CoupledModules, problem: ChainProblem, guess: Array) -> ChainProblem:
    """Return the problem of a chain where all other modules, and the base, are at a guess, shape (nq,)."""
    poses = chain.poses
    if robot.base != "fixed":
        base = Motion.at_rest(1, rotation_from_quaternion(guess[3:7]), guess[:3])
        poses = tuple(pose if pose.frame is None else pose._replace(frame=base) for pose in poses)
    chain = chain._replace(poses=poses)
    known = ChainPlaces(robot, chain, guess[None], *np.zeros((2, 1, robot.nv)))
    carried, relatives = _standing(robot, chain, known)
    return replace(problem, carried=carried, relatives=relatives)


def generic_motion(
    problem: ChainProblem, robot: HybridRobot, numbers: Sequence[int], q: Array
) -> ChainMotion:
    """Compute the motion of a chain at generic postures.

    Args:
        problem: Rows and free freedoms.
        robot: The robot.
        numbers: Its modules.
        q: A posture about which modules without loops are turned, shape (1, nq).
    """
    rng, postures, modules = np.random.default_rng(0), [], [robot.modules[k] for k in numbers]
    guess = cut_positions(robot, numbers, q)
    for module, tree, at in zip(modules, problem.tree.trees, problem.tree.q_of, strict=True):
        found = module.mechanism.postures
        if module.mechanism.closures.rows:
            postures.append(found[rng.integers(len(found), size=GENERIC)])
        else:
            turns = rng.uniform(-1.0, 1.0, (GENERIC, tree.nv)) * module.mechanism.reduction.col_scale
            postures.append(tree.integrate(np.tile(guess[:, at], (GENERIC, 1)), turns))
    return problem.tree.sweep(np.concatenate(postures, axis=1))


def _relatives(known: ChainPlaces, pose: PoseRequest, length: float) -> list[Relative]:
    """Return the targets of a pose between two links."""
    link, other = known.place(pose.link), known.place(pose.other)
    if pose.frame is not None:
        other = CarriedFrame(-1, 0, (Motion.at_rest(len(known.q)),))
    targets = partial_targets(pose, 1, _STILL, _STILL, length)
    if pose.motion is not None:
        targets.insert(0, whole_target(1, pose.motion, length))
    return [Relative(link, other, target, named_rows(target, pose.link)) for target in targets]
