"""Steps along straight tool paths of random stacks end on the branch of a fine motion, or are refused."""

from dataclasses import replace
from itertools import islice, pairwise
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn import AssemblyError, SingularityError
from tests.assembly.aims import BENT, Aim, Array, quadratic, random_aims, straight
from tests.assembly.fitted import ANGLES, differenced
from tests.assembly.test_angles import arm
from tests.assembly.test_stacks import ALIKE, DIFFERENCED, REACHED
from tests.robots.as_written import WRITTEN
from tests.support.comparing import refused
from tests.support.samples import slow

#: Steps of a path, and the times of one, drawn by their logarithm: motions of some hundredths to one [s].
STEPS, LEAST, LONGEST = 5, 0.02, 1.0
#: A fine motion has so many parts a step, and where these are bent, parts shorter by up to the second number.
PARTS, FINEST = 16, 4096
#: Postures [m, rad] that are near are one, in a search of short steps.
NEAR, SHORT, MOST = 1e-4, 0.05, 400
#: Paths of a stack, and stacks of a case: all slow ones are 2,000 paths, 10,000 steps.
PATHS, STACKS = 20, 4
#: Part of the steps that may be refused though a fine motion goes there: Newton's method does not reach the
#: end of these long ones at once, and no more than `walk.COARSEST` parts are tried then.
REFUSED = 0.05


def fine_motion(aim: Aim, x: Array, start: float, stop: float) -> Array | None:
    """Follow an aim from a posture in parts that are hardly bent; None where it ends before."""
    fitted, ease, rank = aim.standing.fitted, aim.standing.ease, aim.rank
    t, longest = start, (stop - start) / PARTS
    part = longest
    while stop - t > 1e-12:
        part = min(part, stop - t)
        ahead = fitted.rates(x, aim.wanted, t, ease, rank) * part
        guess = pin.integrate(fitted.model, x, ahead)
        found = fitted.close(guess, aim.wanted, t + part, ease, rank)
        bent = np.inf if found is None else np.abs(fitted.apart(guess, found)).max()
        if found is not None and bent <= BENT * np.abs(ahead).max() + 1e-9:
            x, t, part = found, t + part, min(2 * part, longest)
        elif part < longest * PARTS / FINEST:
            return None
        else:
            part /= 4
    return x


def assembled(aim: Aim, times: Array) -> list[Array]:
    """Return what `assemble` finds at times, as the judge has it, up to the first one that it refuses."""
    s = aim.standing
    while len(times):
        try:
            q, _, _ = hybridyn.assemble(s.robot, guess=s.given(aim.x), **aim.asked(times))
        except (AssemblyError, SingularityError) as error:
            times = times[: error.sample or 0]
        else:
            return [s.taken(one) for one in q]
    return []


def joined(aim: Aim, t: float, x: Array, y: Array) -> bool:
    """Return whether short motions along which what is prescribed stays lead from a posture to another."""
    fitted, ease = aim.standing.fitted, aim.standing.ease
    for _ in range(MOST):
        N, way = fitted.motions(x, ease, aim.wanted, t), fitted.apart(x, y)
        step = N @ (N.T @ (way / ease**2))  # the part of the way that is free
        size = np.abs(step).max()
        if np.abs(way).max() < NEAR:
            return True
        if size < NEAR / 10:
            return False
        guess = pin.integrate(fitted.model, x, step * min(1.0, SHORT / size))
        found = fitted.close(guess, aim.wanted, t, ease, aim.rank)
        if found is None or np.abs(fitted.apart(guess, found)).max() > BENT * SHORT:
            return False
        x = found
    return False


def judged(aim: Aim, times: Array) -> tuple[int, int]:
    """Compare the steps of a path; return how many the fine motion makes, and how many of these are refused.

    Where targets leave freedoms, the motion by the rule depends on its steps: ends that are not alike must be
    joined by motions along which what is prescribed stays.
    """
    found, x = assembled(aim, times), aim.x
    for k, (start, stop) in enumerate(pairwise([0.0, *times])):
        there = fine_motion(aim, x, start, stop)
        if there is None:
            assert aim.left or len(found) <= k, k
            return k, 0
        if len(found) <= k:
            return k + 1, 1
        x, off = there, aim.standing.fitted.apart(there, found[k])
        if aim.left:
            whole = aim.standing.fitted.apart(aim.x, there) / aim.standing.ease
            alike = np.abs(off / aim.standing.ease).max() < ALIKE * np.abs(whole).max()
            assert alike or joined(aim, stop, found[k], there), k
        else:
            assert np.abs(off).max() < REACHED, k
    return len(times), 0


@pytest.mark.parametrize(("away", "within"), [(0.45, True), (0.49, False)])
def test_what_carries_a_chain_swings_on_its_arc(tmp_path: Path, away: float, within: bool) -> None:
    """Two given joints carry two of 0.5 m, whose end stays; from a chord it would be within reach always."""
    robot, middle = arm(tmp_path, "zzzzz"), np.array([0.75, 2.0])
    turns = np.array([[0.0, 2.0], [1.5, 2.0]])
    end = -away * np.array([np.cos(1.75), np.sin(1.75)])
    far = [abs(end @ [1, 1j] - 0.5 * np.exp(1j * np.cumsum(turn)).sum()) for turn in (*turns, middle)]
    assert max(far[:2]) < 1.0
    assert (far[2] < 1.0) == within

    def step(turn: Array, guess: Array) -> Array:
        motors = {"j0": turn[0], "j1": turn[1], "j4": 0.0}
        pose = {"x": end[0], "y": end[1]}
        return hybridyn.assemble(robot, motors=motors, platforms={"l4": (pose,)}, guess=guess)[0]

    start = step(turns[0], np.array([0.0, 2.0, 1.9, 0.6, 0.0]))
    if within:
        assert np.sign(step(turns[1], start)[3]) == np.sign(start[3])
    else:
        refused(lambda: step(turns[1], start), AssemblyError, "no continuous motion")


def test_straight_angles_have_the_rates_of_a_steady_turn() -> None:
    """Against differences, and a constant angular velocity."""
    names, value, rate = (
        ("yaw", "x", "pitch", "roll"),
        np.array([0.4, 0.1, 0.8, -0.5]),
        np.arange(1.0, 5.0) / 5,
    )
    course, t, h = straight(names, value, rate), 0.3, 1e-2
    near = {k: course(t + k * h) for k in (-3, -2, -1, 1, 2, 3)}
    for level in (0, 1):
        slope = differenced({k: levels[level] for k, levels in near.items()}, h)
        assert np.abs(slope - course(t)[level + 1]).max() < DIFFERENCED * np.abs(slope).max()
    R, S, U = (pin.rpy.rpyToMatrix(course(k)[0][[3, 2, 0]]) for k in (0.0, t, 2 * t))
    assert np.abs(S @ R.T - U @ S.T).max() < REACHED


@pytest.mark.slow  # of one arm by default: tests/assembly/test_half_turns.py
def test_a_step_of_three_angles_is_a_turn_about_a_fixed_axis() -> None:
    """The judge follows the same way; where all three change steadily, a fold ends the motion before."""
    aim, stop = next(islice(random_aims((47,), 20, still=True), 4, None)), 0.8
    names, (value, rate, _) = aim.target.names, aim.target.course(0.0)
    steady = replace(aim, target=replace(aim.target, course=quadratic(value, rate.copy(), np.zeros(4))))
    turns = [names.index(name) for name in ANGLES]
    first, last = value[turns], steady.target.course(stop)[0][turns]
    spin = pin.log3(pin.rpy.rpyToMatrix(last) @ pin.rpy.rpyToMatrix(first).T) / stop
    rate[turns] = pin.rpy.computeRpyJacobianInverse(first, pin.LOCAL_WORLD_ALIGNED) @ spin
    turned = replace(aim, target=replace(aim.target, course=straight(names, value, rate)))
    (found,), there = assembled(steady, np.array([stop])), fine_motion(turned, aim.x, 0.0, stop)
    assert there is not None
    assert np.abs(aim.standing.fitted.apart(there, found)).max() < REACHED
    assert fine_motion(steady, aim.x, 0.0, stop) is None


@pytest.mark.parametrize(
    ("names", "paths"),
    [
        ((1,), 1),
        *(slow(tuple(range(seed, seed + STACKS)), PATHS) for seed in range(0, 100, STACKS)),
        *(slow((name,), PATHS) for name in WRITTEN),
    ],
)
def test_no_step_ends_on_another_branch(names: tuple[int | str, ...], paths: int) -> None:
    made = refused = 0
    for number, aim in enumerate(random_aims(names, paths, still=True)):
        lengths = np.random.default_rng(number).uniform(np.log(LEAST), np.log(LONGEST), STEPS)
        steps, out = judged(aim, np.cumsum(np.exp(lengths)))
        made, refused = made + steps, refused + out
    assert made > 0.5 * STEPS * paths * len(names)
    assert refused <= REFUSED * made
