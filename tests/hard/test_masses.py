"""Masses that lie twelve digits apart, none at all, and inertias at the border of what mass can have.

Claims (the issue's): backward error at most 1e-13 per module; forward error at most 100 eps times the
condition number of what is solved, which `extended_judge` and, for arms, the Jacobian's singular values give.
On a floating base the condition number is taken as 1, the least there is; but where the base is as light as
the legs and the module has fewer than six freedoms, what the base feels has the masses' ratio as condition.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import mpmath
import numpy as np
import pytest

from hybridyn import SingularityError, ddm, idm
from hybridyn.description import Description
from hybridyn.description.records import Joint, Link
from hybridyn.structure.building import build_robot
from tests.hard.claims import BACKWARD, EPS, FORWARD, Claim, apart
from tests.hard.extended_judge import Judge
from tests.judges.remarks import findings
from tests.oracle import Base, Extended, Oracle
from tests.robots.shipped import shipped, states_near_home
from tests.support.comparing import refused

LIGHTER = 1e-25  # inertia tolerance of the reference: square roots of masses, fifty digits
LIGHT, HEAVY = "legs of 1e-12 of their mass", "legs of 1e12 times their mass"
CASES: dict[str, Callable[[str], float]] = {
    "legs without mass": lambda name: float(is_end(name)),
    LIGHT: lambda name: 1.0 if is_end(name) else 1e-12,
    HEAVY: lambda name: 1.0 if is_end(name) else 1e12,
    "platform lighter than its legs by 1e9": lambda name: 1e-9 if "platform" in name else 1.0,
}


def is_end(name: str) -> bool:
    """Say whether a link is a base or a platform."""
    return "platform" in name or name.endswith("base")


def light_base(name: str, ratio: float) -> float:
    """Return the factor of a link's mass where base and legs are light."""
    return 1.0 if "platform" in name else ratio


def massed(description: Description, factor: Callable[[str], float]) -> Description:
    """Return a robot whose links have a multiple of their mass and inertia."""
    links = [
        replace(link, mass=factor(link.name) * link.mass, inertia=factor(link.name) * link.inertia)
        for link in description.links
    ]
    return replace(description, links=tuple(links))


def efforts(description: Description) -> np.ndarray:
    """Draw efforts, shape (motors,)."""
    return 20 * np.random.default_rng(5).normal(size=len(description.motors))


def judged(description: Description, q: np.ndarray, case: str, claim: Claim, speed: float = 1.0) -> None:
    """Claim the errors of both models at a posture, at so many radians a second."""
    judge, robot = Judge(description, q, speed=speed), build_robot(description)
    tau = efforts(description)
    a = ddm(robot, q, judge.v, tau)
    errors = {"ddm": judge.of_ddm(tau, a), "idm": judge.of_idm(a, idm(robot, q, judge.v, a))}
    for model, error in errors.items():
        claim(case, f"backward error of {model}", error.backward, BACKWARD * len(robot.modules))
        claim(case, f"forward error of {model} over the condition number", error.units * EPS, FORWARD)


# -------------------------------------------------------------------- legs and platforms


ROBOTS = {"rps3": [], "delta": [pytest.mark.slow], "gough_stewart": [pytest.mark.slow]}


@pytest.mark.parametrize(
    ("name", "masses"),
    [pytest.param(name, case, marks=marks) for name, marks in ROBOTS.items() for case in CASES],
)
def test_masses_twelve_digits_apart(name: str, masses: str, claim: Claim) -> None:
    """Light legs cost nothing, inertias are summed as squares; heavy ones nothing, pivots are chosen."""
    description = massed(shipped(name), CASES[masses])
    judged(description, states_near_home(description, "fixed", 9, 1)[0][0], f"{name}, {masses}", claim)


def exactly(description: Description, base: Base) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return a state that is closed in fifty digits, efforts, and the accelerations that they make."""
    with mpmath.workdps(50):
        exact = Oracle(description, base, arithmetic=Extended(mpmath.mp), inertia_tolerance=LIGHTER)
        (start,), (rate,), _ = states_near_home(shipped(description.name), base, 9, 1)
        q, tau = exact.close(start), efforts(description)
        v = exact.project_velocity(q, rate)
        return q.astype(float), v.astype(float), tau, exact.ddm(q, v, tau).astype(float)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("masses", "factor", "bound"),
    [
        *((name, CASES[name], FORWARD) for name in (LIGHT, HEAVY)),
        *(
            (f"base and legs of {ratio:.0e} of their mass", partial(light_base, ratio=ratio), 4 * EPS / ratio)
            for ratio in (1e-3, 1e-6, 1e-9, 1e-12)
        ),
    ],
)
def test_masses_twelve_digits_apart_on_a_floating_base(
    masses: str, factor: Callable[[str], float], bound: float, claim: Claim
) -> None:
    """A base of its own weight: as on the ground. One as light as its legs: condition 1 / ratio.

    Three directions of such a base feel the platform, three only itself and the legs. This is the known limit
    of the recursion: it holds the base's apparent inertia as one 6 x 6 matrix.
    """
    description = massed(shipped("rps3"), factor)
    q, v, tau, expected = exactly(description, "floating")
    error = apart(ddm(build_robot(description, base="floating"), q, v, tau), expected)
    claim(f"floating rps3, {masses}", "forward error of ddm", error, bound)


# -------------------------------------------------------------------- bodies without inertia in a row


def arm(angles: int, tip: float = 2.0) -> Description:
    """Return a planar arm of links 0.5 m long without mass or inertia, a point of mass at its end."""
    none = np.zeros((3, 3))
    links = [Link("base", 0.0, np.zeros(3), none)]
    joints = []
    for i in range(angles):
        M = np.eye(4)
        M[0, 3] = 0.5 if i else 0.0
        end = i == angles - 1
        links.append(Link(f"link{i}", tip if end else 0.0, np.array([0.5 if end else 0.0, 0, 0]), none))
        joints.append(Joint(f"joint{i}", "revolute", links[-2].name, links[-1].name, M, np.eye(3)[2]))
    motors = tuple(joint.name for joint in joints)
    return Description("arm", tuple(links), tuple(joints), motors=motors)


def test_two_links_without_inertia_carry_a_point(claim: Claim) -> None:
    """M = J^T m J, of condition cond(J)^2; J loses rank where the arm is stretched."""
    description, v, tau = arm(2), np.array([1.0, -2.0]), np.array([3.0, 0.5])
    robot = build_robot(description)
    with mpmath.workdps(50):
        exact = Oracle(description, arithmetic=Extended(mpmath.mp), inertia_tolerance=LIGHTER)
        for bend in (1.0, 1e-2, 1e-4, 1e-6, 1e-7):
            q = np.array([0.4, bend])
            inner, outer = (0.5 * np.array([-np.sin(x), np.cos(x)]) for x in (q[0], q[0] + q[1]))
            condition = np.linalg.cond(np.array([inner + outer, outer])) ** 2
            error = apart(ddm(robot, q, v, tau), exact.ddm(q, v, tau).astype(float))
            case = f"two massless links, bent by {bend:.0e} rad (condition {condition:.0e})"
            claim(case, "forward error of ddm", error, FORWARD * condition)


def test_a_row_of_links_without_inertia_that_nothing_resists_is_named() -> None:
    """A stretched arm, and three links for two directions: a force along such a motion has no answer.

    What is left of the inertia there is rounding, 1e-17 kg m^2, and would give 1e17 rad/s^2 without a word.
    """
    refused(
        lambda: ddm(build_robot(arm(2)), np.array([0.4, 0.0]), np.zeros(2), np.array([3.0, 0.5])),
        SingularityError,
        r"the motion of joint 'joint[01]' has no inertia",
    )
    refused(
        lambda: ddm(build_robot(arm(3)), np.array([0.4, 0.5, -0.3]), np.zeros(3), np.array([3.0, 0.5, 1.0])),
        SingularityError,
        r"the motion of joint 'joint[012]' has no inertia",
    )


def test_efforts_of_a_row_of_links_without_inertia(claim: Claim) -> None:
    """The inverse model asks no inertia of anyone: three links, tau = J^T m (J a + J_dot v - g)."""
    description, robot = arm(3), build_robot(arm(3))
    q, v, a = np.array([0.4, 0.5, -0.3]), np.array([1.0, -2.0, 0.5]), np.array([2.0, 1.0, -4.0])
    with mpmath.workdps(50):
        expected = Oracle(description, arithmetic=Extended(mpmath.mp)).idm(q, v, a).astype(float)
    claim("three massless links", "forward error of idm", apart(idm(robot, q, v, a), expected), FORWARD)


# -------------------------------------------------------------------- the border of the triangle inequality


def thinned(description: Description, turn: bool) -> Description:
    """Make platforms of plates (Ixx + Iyy = Izz) and all else of rods (Izz = 0); rounded, where turned."""
    R = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0] if turn else np.eye(3)
    links = []
    for link in description.links:
        moments = (0.3, 0.5, 0.8) if is_end(link.name) else (0.2, 0.2, 0.0)
        size = 0.1 * link.mass
        links.append(replace(link, inertia=size * (R @ np.diag(moments) @ R.T)))
    return replace(description, links=tuple(links))


@pytest.mark.parametrize("turn", [False, True])
def test_inertias_at_the_border_of_the_triangle_inequality(turn: bool, claim: Claim) -> None:
    """Thin plates and rods, in their own axes and, rounded to either side of the border, in others."""
    description = thinned(shipped("rps3"), turn)
    assert not any("no inertia" in text for text in findings(build_robot(description)))
    axes = "other axes" if turn else "their own axes"
    q = states_near_home(description, "fixed", 9, 1)[0][0]
    judged(description, q, f"rps3 of thin plates and rods, in {axes}", claim)
