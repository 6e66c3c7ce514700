"""What both models and `assemble` answer at singular postures, beyond their errors: words, batches, bases.

The claims stand in each test; postures and errors are those of `test_singular_postures.py`.
"""

from functools import partial

import numpy as np
import pytest

from hybridyn import SingularityError, assemble, ddm, idm
from hybridyn.structure.building import build_robot
from tests.hard.claims import Claim
from tests.hard.extended_judge import Judge
from tests.hard.singular_postures import posture
from tests.hard.test_singular_postures import FORWARD, LOST_MOTORS, case
from tests.judges.judging import ORACLE
from tests.oracle import Base, Oracle
from tests.robots.posing import of_link
from tests.support.comparing import refused

# ------------------------------------------------------------------ no digit left


@pytest.mark.parametrize("place", ["five_bar constraint", "rps3 constraint"])
@pytest.mark.parametrize("answer", ["raise", "least-norm"])
def test_no_digit_is_left(place: str, answer: str) -> None:
    """A motion across a constraint singularity at full speed: accelerations of 1e12, closure forces of 1e24.

    The efforts are less than the rounding of what they are the sum of: 1e-16 of 1e24. That is said, whatever
    the caller asked for motors that lose a direction.
    """
    description, q = posture(place, 1e-12)
    judge = Judge(description, q)
    robot, tau = build_robot(description), np.ones(len(description.motors))
    a = judge.accelerations(tau).astype(float)
    refused(
        lambda: idm(robot, q, judge.v, a, on_singular=answer),
        SingularityError,
        "its efforts have no correct digit at sample 0",
        what="closures",
    )


@pytest.mark.parametrize("distance", [1e-7, 1e-11])
def test_a_robot_at_rest_keeps_its_digits(distance: float, claim: Claim) -> None:
    """Lying flat, weight across the plane: efforts are zero, and rounding next to the weight is no loss."""
    description, q = posture("five_bar constraint", distance)
    robot = build_robot(description, gravity=(0.0, 9.81, 0.0))
    still = np.zeros(robot.nv)
    tau = idm(robot, q, still, still)
    claim(f"five_bar flat, {distance:.0e}, weight across", "effort [N m]", np.abs(tau).max(), 1e-12)


# ------------------------------------------------------------------ assembly at serial singularities

OUTPUTS = {
    "five_bar": ("m1_tool", "xz"),
    "delta": ("m1_platform", "xyz"),
    "gough_stewart": ("m1_platform", ""),
}


@pytest.mark.parametrize(
    "place",
    [
        "five_bar serial",
        "gough_stewart serial",
        pytest.param("delta serial", marks=pytest.mark.slow),
        pytest.param("gough_stewart leg", marks=pytest.mark.slow),
    ],
)
def test_a_platform_motion_cannot_be_followed_where_a_leg_is_singular(place: str) -> None:
    """At the singularity `assemble` says so; the posture at rest is fine, and so are motors in its place."""
    description, q = posture(place, 0.0)
    robot = build_robot(description)
    link, axes = OUTPUTS[place.split()[0]]
    still = np.zeros((1, robot.nv))
    pose = of_link(robot, q[None], still, still, link, robot.description.root)[0][0]
    rate = np.array([0.3, 0.0, -0.2, 0.0, 0.0, 0.0])
    given: tuple[object, object] = (pose, rate)
    if axes:
        given = tuple({x: float(part["xyz".index(x)]) for x in axes} for part in (pose, rate))
    caught = refused(
        lambda: assemble(robot, platforms={link: given}, guess=q),
        SingularityError,
        r"the rates given at sample 0 cannot be followed.*serial",
        what="legs",
    )
    assert (caught.condition or 0.0) > 1 / LOST_MOTORS
    at_rest = assemble(robot, platforms={link: given[:1]}, guess=q)
    assert np.isfinite(np.concatenate(at_rest)).all()
    assert not at_rest[1].any()


@pytest.mark.parametrize(
    ("place", "lost", "words"),
    [
        ("five_bar parallel", "motors", "parallel singularity: the motors lose a direction"),
        ("four_bar constraint", "closures", "constraint singularity: the closures lose rank"),
    ],
)
def test_motors_that_lose_a_direction_do_not_tell_a_motion(place: str, lost: str, words: str) -> None:
    """At a parallel or a constraint singularity `assemble` from motors' rates fails in the same words."""
    description, q = posture(place, 0.0)
    robot = build_robot(description)
    motors = {motor: (q[i], 1.0, 0.0) for motor, i in zip(robot.motors, robot.motor_v, strict=True)}
    refused(
        lambda: assemble(robot, motors=motors, guess=q),
        SingularityError,
        f"cannot be followed.*{words}",
        what=lost,
    )


# ------------------------------------------------------------------ one singular sample among others


@pytest.mark.parametrize(
    "place", ["five_bar parallel", "rps3 parallel", "rps3 serial", "five_bar constraint"]
)
def test_a_singular_sample_leaves_its_neighbours_alone(place: str) -> None:
    """The sample is named, and the others have the same bits as without it."""
    description = posture(place, 0.0)[0]
    robot = build_robot(description)
    q = np.array([posture(place, d)[1] for d in (0.1, 0.0, 0.05)])
    rest, tau = np.zeros((3, robot.nv)), np.ones((3, len(robot.motors)))
    refused(lambda: idm(robot, q, rest, rest), SingularityError, "at sample 1", sample=1)
    whole = idm(robot, q, rest, rest, on_singular="least-norm")
    assert np.isfinite(whole).all()
    assert np.array_equal(whole[[0, 2]], idm(robot, q[[0, 2]], rest[:2], rest[:2]))
    if "constraint" in place:
        refused(lambda: ddm(robot, q, rest, tau), SingularityError, "at sample 1")
    else:
        whole = ddm(robot, q, rest, tau)
        assert np.array_equal(whole[[0, 2]], ddm(robot, q[[0, 2]], rest[:2], tau[:2]))


# ------------------------------------------------------------------ motors' accelerations alone


@pytest.mark.parametrize("distance", [1e-2, 1e-9, 1e-12, 0.0])
@pytest.mark.parametrize("place", ["five_bar parallel", "rps3 parallel", "five_bar serial"])
def test_accelerations_of_the_motors_alone(place: str, distance: float, claim: Claim) -> None:
    """With passive="solved" the motors' map is solved twice: for the motion, and for the efforts.

    Its condition number counts squared, and that is refused from 1e10 on, whatever is asked for motors that
    lose a direction: without all accelerations the motion there is not known.
    """
    this = case(place, distance, 0)
    judge = this.judge
    a = judge.accelerations(this.tau).astype(float)

    def solve(answer: str) -> np.ndarray:
        return idm(this.robot, judge.q, judge.v, a, passive="solved", on_singular=answer)

    if this.reciprocal > 1e-4:
        errors = judge.of_idm(a, solve("raise"), this.tau)
        bound = FORWARD * errors.condition / this.reciprocal
        claim(this.name, "forward error of idm, passive solved", errors.forward, bound)
        return
    for answer in ("raise", "least-norm"):
        words = "accelerations alone do not determine the motion"
        caught = refused(partial(solve, answer), SingularityError, words, what="motors")
        assert (caught.condition or 0.0) > 1e10


@pytest.mark.parametrize("base", ["moving", "floating"])
@pytest.mark.parametrize("place", ["gough_stewart parallel", "rps3 serial", "delta serial"])
def test_on_other_bases(place: str, base: Base, claim: Claim) -> None:
    """Exactly at the singularity ddm is the oracle's in doubles on a moving or a free base, too (1e-10)."""
    description, q = posture(place, 0.0)
    robot, oracle = build_robot(description, base=base), Oracle(description, base)
    q = np.concatenate([[0.1, 0.2, 0.3, 0.1, 0.2, 0.3, np.sqrt(0.86)], q])
    v = oracle.project_velocity(q, np.random.default_rng(0).normal(size=oracle.nv))
    tau = np.full(len(robot.motors), 5.0)
    a, exact = ddm(robot, q, v, tau), oracle.ddm(q, v, tau)
    wrong = np.abs(a - exact).max() / np.abs(exact).max()
    claim(f"{place}, base {base}", "ddm against the oracle in doubles", wrong, ORACLE)
