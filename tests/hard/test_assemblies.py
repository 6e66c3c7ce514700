"""All postures: Dietmaier's forty, each proved; what counts as one; robots whose postures are known."""

import mpmath
import numpy as np
import pytest

import hybridyn
from hybridyn.studies.assemblies import SAME_ASSEMBLY, Assemblies
from tests import ROOT
from tests.hard import dietmaier
from tests.hard.claims import EPS, Claim
from tests.robots.posing import of_link, position
from tests.support.command_line import call
from tests.support.comparing import refused
from tests.support.samples import slow

DIGITS = 50
ZERO = 1e-30  # left-hand sides of Dietmaier's equations after refinement in DIGITS digits
PROOF = 0.5  # Kantorovich: J^-1's bound times the second derivatives times the last step, below this
CLOSED = 1e-13  # closure residual, of the module's size: the suite's general claim for one module
FORWARD = 100.0  # eps times the condition number: the suite's general claim


def at_home(robot: hybridyn.HybridRobot) -> dict[str, object]:
    return {motor: float(position(robot, motor, robot.home)) for motor in robot.motors}


def sought(robot: hybridyn.HybridRobot, starts: int, seed: int) -> Assemblies:
    """Look for Dietmaier's postures."""
    return hybridyn.assemblies(robot, motors=dietmaier.motors(), starts=starts, seed=seed)


# -------------------------------------------------------------------- Dietmaier


@pytest.mark.parametrize(
    ("foot", "seed", "starts"),
    [("S", 2, 300), slow("S", 0, 1000), slow("S", 1, 1000), slow("U", 0, 3000), slow("S", 11, 50_000)],
)
def test_dietmaier_all_forty(claim: Claim, foot: str, seed: int, starts: int) -> None:
    """All 40 postures of the published platform (Dietmaier 1998), closed to rounding: from 1,000 starts.

    300 of a chosen seed reach them, too; the way from a home near a posture is short. A 6-SPS leaves six
    spins open, a 6-UPS has 64 variants of every posture: neither counts as more. From 50,000 starts: 40
    still, every one found often.
    """
    robot = dietmaier.robot(foot, at_pose=starts == 300)
    first = (foot, seed, starts) == ("S", 0, 1000)
    found = dietmaier.forty() if first else sought(robot, starts, seed)
    case = f"Dietmaier 6-{foot}PS, {starts:,} starts, seed {seed}"
    claim(case, "postures missing of 40", abs(dietmaier.REAL - len(found.q)), 0)
    claim(case, "closure residual", hybridyn.closure_residual(robot, found.q).max(), CLOSED)
    if starts == 50_000:
        claim(case, "estimated chance of another posture", found.unseen, 0)
    assert found.counts.sum() <= starts
    slides = np.array([position(robot, motor, found.q) for motor in robot.motors]).T
    assert (slides == dietmaier.LENGTHS).all()  # motors stay where they were given, to the last bit


@pytest.mark.parametrize("every", [8, slow(1)])
def test_dietmaier_each_posture_is_real_and_another(every: int, claim: Claim) -> None:
    """Refined in 50 digits on other equations: zero to 1e-30, and proved zeros by Kantorovich's theorem.

    The theorem's number is also the distance: proved balls are far smaller than what lies between postures,
    so the 40 are real and distinct. Forward error at most 100 eps times the equations' condition number.
    """
    found = dietmaier.forty()
    zeros, forward, radius = [], 0.0, mpmath.mpf(0)
    for pose in dietmaier.poses(found.q)[::every]:
        u, open_by = dietmaier.refined(pose, DIGITS)
        claim("Dietmaier, refined in 50 digits", "left-hand sides of the equations", open_by, ZERO)
        proof, ball = dietmaier.proof(u, DIGITS)
        claim("Dietmaier, refined in 50 digits", "Kantorovich's number", proof, PROOF)
        radius = max(radius, ball)
        near = np.array([float(x) for x in u])
        condition = np.linalg.cond(dietmaier.jacobian(near, dietmaier.LENGTHS))
        error = np.abs(dietmaier.pose_of(near) - pose).max()
        forward = max(forward, float(error / (EPS * condition)))
        zeros.append(near)
    claim("Dietmaier, 40 postures", "forward error over eps times condition", forward, FORWARD)
    away = [min(np.abs(a - s * b).max() for s in (1, -1)) for a in zeros for b in zeros if a is not b]
    claim("Dietmaier, 40 postures", "proved radius over half the least distance", 2 * radius / min(away), 1.0)


def test_the_same_seed_gives_the_same_bits() -> None:
    """And the order does not depend on the seed: what is nearest to home comes first."""
    robot = hybridyn.load("five_bar")
    first, second, other = (
        hybridyn.assemblies(robot, motors=at_home(robot), starts=100, seed=seed) for seed in (0, 0, 7)
    )
    assert (first.q == second.q).all()
    assert (first.counts == second.counts).all()
    assert np.abs(first.q - other.q).max() < SAME_ASSEMBLY
    assert (first.counts != other.counts).any()


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bits_of_forty_postures() -> None:
    robot = dietmaier.robot()
    first, second = (sought(robot, 400, 0) for _ in range(2))
    assert (first.q == second.q).all()
    assert (first.counts == second.counts).all()
    poses = [dietmaier.poses(sought(robot, 1500, seed).q) for seed in (7, 8)]
    assert len(poses[0]) == len(poses[1]) == dietmaier.REAL
    apart = np.abs(poses[0][:, None] - poses[1][None]).max(axis=2)
    assert (apart.min(axis=1) < SAME_ASSEMBLY).all()


# -------------------------------------------------------------------- postures that are counted by hand

COUNTED = {
    "five_bar": 2,  # the tip above or below the line of the elbows
    "rps3": 16,  # 16 postures at most of a 3-RPS (Parenti-Castelli and Innocenti 1990), all real here
    "tanev": 32,  # 16 and 2 of its two modules, which multiply
}


@pytest.mark.parametrize("name", [slow(name) if name == "tanev" else name for name in COUNTED])
def test_known_numbers_of_postures(claim: Claim, name: str) -> None:
    """As many as the literature counts, home first."""
    robot = hybridyn.load(name)
    found = hybridyn.assemblies(robot, motors=at_home(robot), starts=300)
    claim(f"{name} at home", "postures missing", abs(COUNTED[name] - len(found.q)), 0)
    claim(f"{name} at home", "closure residual", found.residual.max(), CLOSED)
    home = hybridyn.assemble(robot, motors=at_home(robot))[0]
    assert np.abs(found.q[0] - home).max() < SAME_ASSEMBLY


def home_pose(robot: hybridyn.HybridRobot) -> dict[str, object]:
    zero, platform = np.zeros((1, robot.nv)), robot.modules[0].outputs[0]
    return {platform: of_link(robot, robot.home[None], zero, zero, platform, robot.description.root)[0][0]}


@pytest.mark.slow
def test_a_platform_pose_leaves_the_legs_their_ways() -> None:
    """Each UPS leg reaches its point with its slide out or, beyond its limits, backwards through the foot.

    The two ways in which a universal joint points a straight leg are one.
    """
    robot = hybridyn.load("gough_stewart")
    found = hybridyn.assemblies(robot, platforms=home_pose(robot), starts=3000)
    assert len(found.q) == 2**6
    assert found.within_limits.sum() == found.within_limits[0] == 1


def test_a_platform_pose_leaves_elbows_in_or_out() -> None:
    delta = hybridyn.load("delta")
    found = hybridyn.assemblies(delta, platforms=home_pose(delta), starts=200)
    arms = np.array([position(delta, motor, found.q) for motor in delta.motors]).T
    assert len(np.unique(np.round(arms, 6), axis=0)) == 2**3


@pytest.mark.slow
def test_too_many_stacked_postures_are_refused() -> None:
    lx4 = hybridyn.load("lx4")
    refused(
        lambda: hybridyn.assemblies(lx4, motors=at_home(lx4), starts=400),
        hybridyn.AssemblyError,
        r"at least .* postures .*limit 10000.*Give the poses of some platforms",
    )


@pytest.mark.slow
def test_what_is_out_of_reach_has_no_posture() -> None:
    lengths = dietmaier.LENGTHS * np.array([1, 9, 1, 1, 1, 1])
    refused(
        lambda: hybridyn.assemblies(dietmaier.robot(), motors=dietmaier.motors(lengths), starts=5),
        hybridyn.AssemblyError,
        "do not close at sample 0",
    )


def test_wrong_arguments_are_named() -> None:
    robot = dietmaier.robot()
    refused(
        lambda: hybridyn.assemblies(robot, motors=dietmaier.motors(np.tile(dietmaier.LENGTHS, (2, 1)))),
        hybridyn.TrajectoryError,
        "one sample",
    )
    refused(
        lambda: hybridyn.assemblies(robot, motors=dietmaier.motors(), starts=0),
        hybridyn.TrajectoryError,
        "starts must be at least 1, not 0",
    )
    refused(lambda: hybridyn.assemblies(robot), hybridyn.AssemblyError, "leaves 12 of 12 freedoms")


def test_the_command_line_lists_postures(capsys: pytest.CaptureFixture[str]) -> None:
    out = call(capsys, "home", ROOT / "urdf/five_bar.urdf.xacro", "--all", "--starts", "200").out
    assert "2 postures with the motors there" in out
