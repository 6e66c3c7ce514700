"""Steps along straight tool paths of random stacks end on the branch of a fine motion, or are refused."""

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn import AssemblyError, SingularityError
from tests.assembly.aims import BENT, Aim, Array, random_aims
from tests.assembly.test_stacks import ALIKE, REACHED
from tests.robots.as_written import WRITTEN
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
#: end of these long ones at once, and no more than `follow.COARSEST` parts are tried then.
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


@pytest.mark.parametrize(
    ("names", "paths"),
    [
        ((1,), 3),
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
