"""From closure rows to motions: leg by leg as in one piece, near singular, rounded; legs of many freedoms."""

import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.dynamics.forward import forward
from hybridyn.errors import ModelError
from hybridyn.linkage.elimination import null_basis
from hybridyn.linkage.reduction import LEG_PIVOT, RANK_GAP, decide_rank
from hybridyn.spatial import Array
from hybridyn.structure.building import build_robot
from hybridyn.structure.leg_model import LegModel, LongLegs
from hybridyn.structure.mechanism import Mechanism
from tests.robots.mechanisms import KINDS, random_mechanism, random_states
from tests.robots.posing import position
from tests.robots.shipped import shipped, states_near_home
from tests.robots.sketch import rounded
from tests.support.comparing import SOLVED, close_to, refused
from tests.support.files import save
from tests.support.samples import slow, some

SAME_SPACE = 1e-10  # of two bases of one null space, each of condition up to some hundreds
CLOSED_BY = 1e-13  # rows times Psi, relative to Psi's largest entry
STARS = ("gough", "gough_eight_motors", "star_four", "sps", "rps3", "central", "delta_bars", "planar_rpr",
         "star_universal", "on_leg", "stack")  # fmt: skip


def bases(m: Mechanism, q: Array, v: Array, legs: bool) -> tuple[Array, Array, Array, Array]:
    """Return scaled rows and drift term, and the scaled basis and drift: leg by leg, or in one piece."""
    motion = m.tree.sweep(q, v)
    K, gamma = m.closures.matrix(motion), m.closures.rates(motion, v)[1]
    r = m.reduction
    if legs:
        basis = r.basis(K, gamma)
        return r.scaled(K), gamma * r.row_scale, basis.Psi / r.col_scale[:, None], basis.drift / r.col_scale
    scaled, drift = r.scaled(K), gamma * r.row_scale
    return scaled, drift, *null_basis(scaled, drift, r.rank)[:2]


def same_motions(m: Mechanism, q: Array, v: Array) -> None:
    """Assert that both bases span one space, that drifts differ by a motion, and that the rows hold."""
    K, gamma, Psi, x0 = bases(m, q, v, legs=True)
    _, _, dense, y0 = bases(m, q, v, legs=False)
    assert Psi.shape == dense.shape
    assert np.abs(K @ Psi).max(initial=0.0) < CLOSED_BY * np.abs(Psi).max(initial=1.0)
    left = np.einsum("tij,tj->ti", K, x0) + gamma
    assert np.abs(left).max(initial=0.0) <= SOLVED * max(np.abs(x0).max(), np.abs(gamma).max(initial=0.0))
    Q = np.linalg.qr(dense)[0]
    for part in (Psi, (x0 - y0)[..., None]):
        outside = part - Q @ (np.swapaxes(Q, 1, 2) @ part)
        assert np.abs(outside).max(initial=0.0) < SAME_SPACE * max(np.abs(part).max(initial=0.0), 1.0)


@pytest.mark.parametrize("kind", some(k for k in KINDS if KINDS[k].loops))
def test_legs_and_one_piece_give_the_same_motions(kind: str) -> None:
    description = random_mechanism(5, kind=kind)
    robot = build_robot(description)
    q, v, _ = random_states(description, "fixed", 5, 2)
    for state in forward(robot, q, v, None):
        same_motions(state.mechanism, state.q, state.v)


@pytest.mark.parametrize("kind", STARS)
def test_stars_are_eliminated_leg_by_leg(kind: str) -> None:
    """Otherwise the comparison above says nothing."""
    robot = build_robot(random_mechanism(5, kind=kind))
    assert any(len(m.mechanism.reduction._groups) for m in robot.modules)


# -------------------------------------------------------------------- near singular legs


@pytest.mark.parametrize("stretch", [1e-1, 1e-3, 1e-5, 1e-8, 1e-12, 0.0])
def test_a_leg_near_its_own_singularity_is_eliminated_with_the_rest(stretch: float) -> None:
    """A UPS leg whose second axis comes to lie along its slide: a turn about the first moves nothing.

    The module is not singular there, only the leg's own rows; motions stay right to rounding.
    """
    robot = build_robot(shipped("gough_stewart"))
    m = robot.modules[0].mechanism
    q, v, _ = states_near_home(robot.description, "fixed", 3, 1)
    state = forward(robot, q, v, None)[0]
    K = state.K.copy()
    leg = m.reduction._groups[0][0]
    # Make the first leg's rows depend on its first joint as they do on a stretched leg: almost not at all.
    K[:, leg.rows[:, None], leg.cols[0]] *= stretch
    r = m.reduction
    scaled = r.scaled(K)
    basis = r.basis(K, np.zeros(K.shape[:2]))
    Psi = basis.Psi / r.col_scale[:, None]
    assert np.isfinite(Psi).all()
    assert np.abs(scaled @ Psi).max() < CLOSED_BY * np.abs(Psi).max()
    assert np.linalg.svd(Psi[0], compute_uv=False)[-1] > 1e-3  # still six independent motions
    if stretch <= LEG_PIVOT:
        assert np.abs(Psi).max() < 1e3  # complete pivoting takes the leg's turn itself as a coordinate


def test_singular_samples_do_not_change_their_neighbours() -> None:
    robot = build_robot(shipped("gough_stewart"))
    r = robot.modules[0].mechanism.reduction
    q, v, _ = states_near_home(robot.description, "fixed", 3, 5)
    K = forward(robot, q, v, None)[0].K.copy()
    before = r.basis(K, np.zeros(K.shape[:2])).Psi
    leg = r._groups[0][0]
    K[2, leg.rows[:, None], leg.cols[0]] = 0.0
    after = r.basis(K, np.zeros(K.shape[:2])).Psi
    others = [0, 1, 3, 4]
    close_to(after[others], before[others], 1e-14)


# -------------------------------------------------------------------- rounded geometry


@pytest.mark.parametrize("digits", [5, slow(6), 9])
@pytest.mark.parametrize("kind", ["four_bar", "five_bar", "six_bar", "planar_rpr", "delta_bars"])
def test_rounded_loops_keep_their_mobility(kind: str, digits: int) -> None:
    """Five or six digits make the redundant rows of planar loops independent; rank is read from the gap."""
    robot = build_robot(rounded(random_mechanism(5, kind=kind), digits))
    (module,) = robot.modules
    report = module.mechanism.reduction.report
    assert module.mobility == KINDS[kind].mobility
    assert report.rank < report.rows
    assert 0 < report.dropped < 10.0 ** (1 - digits)
    exact = build_robot(random_mechanism(5, kind=kind))
    start = {m: (position(exact, m, exact.home), 0.3, -0.2) for m in exact.motors}
    wanted = hybridyn.idm(exact, *hybridyn.assemble(exact, motors=start))
    efforts = hybridyn.idm(robot, *hybridyn.assemble(robot, motors=start))
    # Efforts feel the rounding, times the conditioning of the loop, and no more.
    assert np.abs(efforts - wanted).max() < 10.0 ** (3 - digits) * np.abs(wanted).max()


@pytest.mark.parametrize(
    ("seed", "kind", "digits"), [(5, "four_bar", 3), (5, "planar_rpr", 3), (4, "five_bar", 4)]
)
def test_doubtful_rank_is_asked_for(seed: int, kind: str, digits: int) -> None:
    """Coarse rounding comes near what counts, or counts and locks the loop; the user's word settles it."""
    coarse = rounded(random_mechanism(seed, kind=kind), digits)
    build = partial(build_robot, coarse, closure_tolerance=1e-2)
    assert refused(build, ModelError, r"rank of its closures is in doubt.*rank_tolerance").element
    assert build(rank_tolerance=1e-2).mobility == KINDS[kind].mobility
    assert build(rank_tolerance=1e-6).mobility == 0


def spectrum(values: list[float]) -> Array:
    return np.tile(np.diag(values), (3, 1, 1))


def test_rank_is_decided_by_the_gap() -> None:
    clear = decide_rank(spectrum([1, 0.3, 0.2, 1e-7]), 1e-4)
    assert (clear.rank, clear.clear) == (3, True)
    assert clear.kept == pytest.approx(0.2)
    assert clear.dropped == pytest.approx(1e-7)
    assert not decide_rank(spectrum([1, 2e-4, 0.9e-4]), 1e-4).clear
    hidden = decide_rank(spectrum([1, 0.3, 2e-4, 1.5e-4]), 1e-4)
    assert (hidden.rank, hidden.clear) == (4, True)
    assert hidden.doubted == pytest.approx((0.3, 2e-4))
    assert clear.doubted is None
    at_the_gap = decide_rank(spectrum([1, 5e-3, 5e-3 / RANK_GAP * 0.99]), 1e-3)
    assert at_the_gap.clear
    assert decide_rank(np.zeros((2, 3, 4)), 1e-4).rank == 0
    assert decide_rank(np.zeros((2, 0, 4)), 1e-4).clear
    # One singular posture among the generic ones does not lower the rank.
    K = spectrum([1.0, 0.5, 0.4])
    K[1, 2, 2] = 0.0
    assert decide_rank(K, 1e-4).rank == 3


CHOSEN = [kind for i, kind in enumerate(KINDS) if i % 5 == 0]
SAME = 1e-13  # of the largest entry
MOST = 400  # MB of a whole process for 200 joints in one loop; Pinocchio's data alone took a thousand


@pytest.mark.parametrize("kind", CHOSEN)
def test_both_models_of_the_legs_agree(kind: str) -> None:
    """On a moving base that turns, every kind of joint."""
    description = random_mechanism(3, kind=kind)
    q, v, a = random_states(description, "moving", 3, 2)
    for state in forward(build_robot(description, base="moving"), q, v, a):
        m = state.mechanism
        ours, theirs = (Legs(m.tree, list(m.spec.leg_bodies)) for Legs in (LongLegs, LegModel))
        at = state.V, state.V_dot, state.q, state.v, state.a
        found, told = ([*legs.rnea(*at), legs.crba(state.q)] for legs in (ours, theirs))
        for mine, wanted in zip(found, told, strict=True):
            assert np.abs(mine - wanted).max(initial=0.0) <= SAME * np.abs(wanted).max(initial=0.0)


def polygon(folder: Path, sides: int) -> Path:
    """Write a regular polygon of links, hinged at every corner, its first link on the ground."""
    side, turn = 1.0 / sides, 2 * np.pi / sides
    mass = (
        f'<inertial><origin xyz="{side / 2} 0 0"/><mass value="0.1"/>'
        '<inertia ixx="1e-5" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="1e-4"/></inertial>'
    )
    at = f'<origin xyz="{side} 0 0" rpy="0 0 {turn!r}"/>'
    text = [f'<link name="l{i}">{mass}</link>' for i in range(sides)]
    text += [
        f'<joint name="j{i}" type="revolute">{at}<parent link="l{i - 1}"/><child link="l{i}"/>'
        '<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>'
        for i in range(1, sides)
    ]
    text.append(
        f'<loop name="last" type="revolute"><predecessor link="l{sides - 1}">{at}</predecessor>'
        '<successor link="l0"/><axis xyz="0 0 1"/></loop>'
    )
    return save(folder, f'<robot name="polygon">{"".join(text)}</robot>', "polygon.urdf")


WEIGH = """
import sys, numpy as np, hybridyn
robot = hybridyn.load(sys.argv[1], motors=[f"j{i}" for i in range(1, 200)])
rest = np.zeros(robot.nv)
tau = hybridyn.idm(robot, robot.home, rest, rest)
assert np.abs(hybridyn.ddm(robot, robot.home, rest, tau)).max() < 1e-9
assert robot.mobility == 197
status = open("/proc/self/status").read()  # ru_maxrss would count the parent's memory too
print(int(status.split("VmHWM:")[1].split()[0]) / 1024)
"""


@pytest.mark.slow  # by default: the legs of the long loop below
def test_a_loop_of_two_hundred_joints_takes_little_memory(tmp_path: Path) -> None:
    if not Path("/proc/self/status").exists():
        pytest.skip("this system does not tell a process's largest memory")
    done = subprocess.run(
        [sys.executable, "-c", WEIGH, str(polygon(tmp_path, 200))], capture_output=True, text=True, check=True
    )
    assert float(done.stdout) < MOST


def test_a_long_loop_moves_as_its_energy_says(tmp_path: Path) -> None:
    """Under no load but its weight: the rate of its energy is the power of its motors."""
    robot = hybridyn.load(polygon(tmp_path, 140), motors=["j1"], gravity=(0.0, -9.81, 0.0))
    m = robot.modules[0].mechanism
    assert isinstance(m.legs, LongLegs)
    rng, q = np.random.default_rng(0), m.postures[0]
    Psi = m.basis(m.closures.matrix(m.tree.sweep(q[None]))).Psi[0]
    v, tau = Psi @ rng.normal(size=robot.mobility), np.array([0.3])
    a, h = hybridyn.ddm(robot, q, v, tau), 1e-6
    steps = np.array([[1.0], [-1.0]])
    along = hybridyn.energy(robot, q + steps * h * v + h * h / 2 * a, v + steps * h * a).total
    power = tau[0] * v[robot.joint_index["j1"]]
    assert (along[0] - along[1]) / (2 * h) == pytest.approx(power, rel=1e-6, abs=1e-6)
