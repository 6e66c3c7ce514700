"""Passing a constraint singularity: a four-bar flat in its change point, a folded parallelogram, and others.

Where closures lose rank the direct model stops, and so does the inverse one unless it is told to go on
(`test_singular_postures.py` has the way there). Told so, it gives the efforts of the branch that the motion
is on. Claims, for smooth motions through the singularity in closed form:

- its efforts there are the limit of those before and after. The limit is taken in fifty digits from both
  sides, at 2.5e-4 and 5e-4, by Richardson's extrapolation: an error of the fourth order, 4e-15 times a fourth
  derivative of up to 1e3. The core knows the branch from differences of fourth order at 1e-3: 1e-12 times
  such derivatives. Hence 1e-10 of the largest effort on the way;
- at rest nothing tells a branch: they are the least-squares, least-norm efforts for all motions that are
  possible there, as the oracle has them with the lost row dropped: 1e-12 of the largest;
- rates that are on no branch are refused.
"""

from typing import Any

import numpy as np
import pytest

from hybridyn import SingularityError, ddm, idm
from hybridyn.description import Description
from hybridyn.structure.building import build_robot
from tests.hard.claims import Claim
from tests.hard.closed_forms import vector, wrap
from tests.hard.extended_judge import Judge, mp
from tests.hard.singular_postures import PLACES, posture
from tests.oracle import Oracle
from tests.support.comparing import refused

WAYS = ["four_bar constraint", "parallelogram constraint", "five_bar constraint", "rps3 constraint"]
LIMIT = 1e-10
ROUNDING = 1e-12
NEAR = 2.5e-4
State = tuple[np.ndarray, np.ndarray, np.ndarray]


def moving(place: str, d: float) -> tuple[Description, State]:
    """Return q, v, a of the motion d(t) = t at d, derivatives by differences in fifty digits."""
    h = mp.mpf(10) ** -12
    description, here = PLACES[place](mp.mpf(d))
    before, after = (PLACES[place](mp.mpf(d) + x)[1] for x in (-h, h))
    names = list(Oracle(description).coordinates)
    steps = [(wrap(after[x] - here[x]), wrap(here[x] - before[x])) for x in names]
    v = np.array([float((right + left) / (2 * h)) for right, left in steps])
    a = np.array([float((right - left) / (h * h)) for right, left in steps])
    return description, (vector(description, here), v, a)


def exact_efforts(place: str, d: float) -> Any:
    """Return the efforts of that motion at d, in fifty digits."""
    description, (q, v, a) = moving(place, d)
    return Judge(description, q, v).efforts(a).astype(float)


@pytest.mark.parametrize("place", WAYS)
def test_efforts_in_passing_are_the_limit(place: str, claim: Claim) -> None:
    description, state = moving(place, 0.0)
    robot = build_robot(description)
    refused(lambda: idm(robot, *state), SingularityError, "its closures lose rank at sample 0")
    refused(
        lambda: ddm(robot, *state[:2], np.zeros(len(robot.motors))),
        SingularityError,
        "its closures lose rank at sample 0",
    )
    near = [exact_efforts(place, d) for d in (-NEAR, NEAR, -2 * NEAR, 2 * NEAR)]
    limit = (4 * (near[0] + near[1]) - (near[2] + near[3])) / 6
    tau = idm(robot, *state, on_singular="least-norm")
    wrong = np.abs(tau - limit).max() / np.abs(near).max()
    claim(f"{place}, passing", "least-norm idm against its limit", wrong, LIMIT)


@pytest.mark.parametrize("place", WAYS[:3])
def test_efforts_at_rest_hold_all_possible_motions(place: str, claim: Claim) -> None:
    """For hinges alone, whose scaled coordinates are the oracle's: then least squares mean the same."""
    description, (q, v, _) = moving(place, 0.0)
    rest = 0 * v
    expected = Oracle(description).idm(q, rest, rest)
    tau = idm(build_robot(description), q, rest, rest, on_singular="least-norm")
    wrong = np.abs(tau - expected).max() / np.abs(expected).max()
    claim(f"{place}, at rest", "least-norm idm against the oracle", wrong, ROUNDING)


@pytest.mark.parametrize("place", ["five_bar constraint", "rps3 constraint"])
def test_rates_on_no_branch(place: str) -> None:
    """Rates that the rows allow for an instant, at accelerations that no constraint can bear."""
    description, q = posture(place, 0.0)
    judge = Judge(description, q)
    a = judge.accelerations(np.zeros(len(description.motors))).astype(float)
    refused(
        lambda: idm(build_robot(description), q, judge.v, a, on_singular="least-norm"),
        SingularityError,
        "on none of the branches",
        what="closures",
    )


@pytest.mark.parametrize("place", [place for place in PLACES if "constraint" in place])
def test_closure_wrenches_at_lost_rank(place: str, claim: Claim) -> None:
    """What the lost row would carry is not determined: wrenches are least-norm, and not all unique.

    Claim: none is larger than the robot's weight, or its moment about the length of a module. Divided by what
    is left of the row, 1e-16, they would be 1e14 times as large.
    """
    description, q = posture(place, 0.0)
    robot = build_robot(description)
    rest = np.zeros(robot.nv)
    _, reactions = idm(robot, q, rest, rest, on_singular="least-norm", reactions=True)
    largest = max(np.abs(wrench).max() for wrench in reactions.closures.values())
    weight = 9.81 * sum(link.mass for link in description.links)
    length = max(module.mechanism.length for module in robot.modules)
    claim(f"{place}, at rest", "closure wrench over weight", largest / (weight * max(length, 1.0)), 1.0)
    assert not all(reactions.unique.values())
