"""Written-out models where they could go wrong in silence: near singular postures, massless, in odd units.

All but the tests of the cache run the models by CasADi, without a compiler.
"""

import subprocess
import sys
from dataclasses import replace
from itertools import product
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.equations.expressions import symbols
from hybridyn.compiled.equations.factors import solve_definite
from hybridyn.compiled.equations.guarded_elimination import Pivots
from hybridyn.compiled.equations.motor_balance import motor_efforts
from hybridyn.compiled.equations.scales import Scale as Limits
from hybridyn.compiled.programs.whole_robot import function_of, programs
from hybridyn.description import read
from hybridyn.errors import HybridynError, install_advice
from hybridyn.structure.building import build_robot
from tests import ROOT
from tests.compiled.toys import single
from tests.hard.scaling import Scale
from tests.hard.singular_postures import PLACES, posture
from tests.oracle import Base, Oracle
from tests.robots.shipped import shipped, states_near_home
from tests.support.engines import TRUSTED
from tests.support.files import save
from tests.support.samples import slow

AGREE = 1e-10  # the claim
MARGIN = 2e-11  # of what is trusted beside singular postures: room for states that were not drawn
DISTANCES = (0.1, 0.01, 2e-3, 1e-3, 3e-4, 1e-4, 1e-5, 1e-6, 1e-8, 1e-10, 1e-12, 0.0)
States = tuple[np.ndarray, np.ndarray, np.ndarray]


def off(
    robot: hybridyn.HybridRobot,
    states: States,
    agree: float = AGREE,
    models: tuple[str, ...] = ("ddm", "idm"),
) -> tuple[list[str], int]:
    """Return trusted samples that the general path refuses or differs from, and how many are not trusted.

    Args:
        robot: The robot.
        states: q, v and efforts.
        agree: How far results may differ, relative to the largest entry.
        models: "ddm" of the efforts, and "idm" of the accelerations that follow.
    """
    wrong: list[str] = []
    doubtful = 0
    functions = {n: function_of(p) for n, p in programs(robot, models=models).items()}
    for t, (q, v, tau) in enumerate(zip(*states, strict=True)):
        third = tau
        for name in models:
            more = [np.zeros(6)] if name == "ddm" and robot.base == "moving" else []
            result, guard = functions[name](q, v, third, *more)
            doubtful += not float(guard) <= TRUSTED
            try:
                wanted = getattr(hybridyn, name)(robot, q, v, third)
            except HybridynError as error:
                if float(guard) <= TRUSTED:
                    wrong.append(f"{name} {t}: {error}")
                break
            difference = np.abs(np.array(result).ravel() - wanted).max(initial=0.0)
            if float(guard) <= TRUSTED and not difference <= agree * np.abs(wanted).max(initial=1e-300):
                wrong.append(f"{name} {t}: {difference:.1e}, guard {float(guard):.2g}")
            third = wanted
    return wrong, doubtful


def efforts(robot: hybridyn.HybridRobot, count: int) -> np.ndarray:
    return 20 * np.random.default_rng(5).normal(size=(count, len(robot.motors)))


def near(place: str, distance: float, count: int) -> tuple[hybridyn.HybridRobot, States]:
    """Return states at a singular posture."""
    description, q = posture(place, distance)
    robot, oracle, rng = build_robot(description), Oracle(description, "fixed"), np.random.default_rng(3)
    slow = min(1.0, 3 * distance**0.5) if "constraint" in place else 1.0  # as the hard cases' states
    v = np.array([slow * oracle.project_velocity(q, rng.normal(size=oracle.nv)) for _ in range(count)])
    return robot, (np.tile(q, (count, 1)), v, efforts(robot, count))


@pytest.mark.parametrize(
    ("place", "distance", "count"),
    [
        ("parallelogram constraint", 0.0, 2),
        *(slow(*case, 6) for case in product(PLACES, DISTANCES)),
    ],
)
def test_beside_singular_postures(place: str, distance: float, count: int) -> None:
    assert off(*near(place, distance, count), MARGIN)[0] == []


def test_two_small_pivots_are_handed_over() -> None:
    """A leg and the platform, each a part of 2e-3 from singular: together as much as 3.6e-11 was measured."""
    wrong, doubtful = off(*near("lx4 leg and parallel", 2e-3, 1), MARGIN, ("ddm",))
    assert wrong == []
    assert doubtful == 1


def light_wrist(folder: Path, mass: float, more: str = "") -> hybridyn.HybridRobot:
    """Return an arm with a roll-pitch-roll wrist whose inner links have next to no mass, axes askew."""
    links, joints = "", ""
    for i, m in enumerate((1.0, 2.0, mass, mass, 1.5)):
        links += (
            f'<link name="l{i}"><inertial><origin xyz="0.03 0.01 0.05"/><mass value="{m}"/>'
            f'<inertia ixx="{m * 0.01}" iyy="{m * 0.012}" izz="{m * 0.008}" '
            'ixy="0" ixz="0" iyz="0"/></inertial></link>'
        )
    for i, (axis, z) in enumerate((("0 1 0", 0.1), ("1 2 3", 0.3), ("2 -1 0", 0.0), ("1 2 3", 0.0))):
        joints += (
            f'<joint name="j{i}" type="revolute"><parent link="l{i}"/><child link="l{i + 1}"/>'
            f'<origin xyz="0 0 {z}" rpy="{3 * z} {z} 0"/><axis xyz="{axis}"/>'
            '<limit lower="-3" upper="3" effort="10" velocity="5"/></joint>'
        )
    text = f'<robot name="wrist">{links}{joints}{more}</robot>'
    return hybridyn.load(save(folder, text, "wrist.urdf"))


@pytest.mark.parametrize("mass", [0.0, 1e-9])
def test_a_light_wrist_near_gimbal_lock(tmp_path: Path, mass: float) -> None:
    """The inertia about the first axis is a difference that vanishes: its last digits are rounding."""
    robot = light_wrist(tmp_path, mass)
    rng = np.random.default_rng(1)
    q = np.array([[0.3, 0.4, d, 0.7] for d in (0.1, 1e-2, 1e-3, 1e-5, 1e-8, 0.0)])
    v, tau = rng.normal(size=q.shape), rng.normal(size=q.shape)
    wrong, doubtful = off(robot, (q, v, tau), MARGIN, ("ddm",))
    assert wrong == []
    assert doubtful == 4


GEAR = """<link name="wheel"/><joint name="gear" type="revolute"><parent link="l4"/><child link="wheel"/>
<axis xyz="0 0 1"/><mimic joint="j0" multiplier="2"/>
<limit lower="-9" upper="9" effort="9" velocity="9"/></joint>"""


def test_a_light_wrist_in_one_module_near_gimbal_lock(tmp_path: Path) -> None:
    """A gear makes the wrist one module: each axis has inertia, their combination has none."""
    robot = light_wrist(tmp_path, 0.0, GEAR)
    assert len(robot.modules) == 1
    rng = np.random.default_rng(1)
    q = np.array([[0.3, 0.4, d, 0.7, 0.6] for d in (0.1, 1e-2, 1e-3, 1e-5, 1e-8)])
    v, tau = rng.normal(size=q.shape), rng.normal(size=(len(q), len(robot.motors)))
    v[:, 4] = 2 * v[:, 0]
    wrong, doubtful = off(robot, (q, v, tau), MARGIN, ("ddm",))
    assert wrong == []
    assert doubtful == 3


def test_a_floating_base_without_inertia_is_not_trusted() -> None:
    description = read(ROOT / "urdf" / "benchmarks" / "heavy_top.urdf.xacro")
    robot = build_robot(description, base="floating")
    q, v, _ = states_near_home(description, "floating", 3, 3)
    function = function_of(programs(robot, models=("ddm",))["ddm"])
    for x, x_dot in zip(q, v, strict=True):
        assert not float(function(x, x_dot, np.ones(len(robot.motors)))[1]) <= TRUSTED


def test_a_robot_without_mass_is_not_trusted() -> None:
    description = shipped("five_bar")
    empty = replace(
        description, links=tuple(replace(x, mass=0.0, inertia=0 * x.inertia) for x in description.links)
    )
    robot = build_robot(empty)
    q, v, _ = states_near_home(description, "fixed", 3, 1)
    function = function_of(programs(robot, models=("ddm",))["ddm"])
    assert not float(function(q[0], v[0], np.ones(2))[1]) <= TRUSTED


def test_nothing_over_nothing_is_not_trusted() -> None:
    """An inertia, and a map of redundant motors, that are zero at one posture: 0 / 0 must not be left out."""
    column, (a,) = symbols("a", 1)
    A, one = np.array([[a]], dtype=object), np.array([[1.0]], dtype=object)
    trust = ca.Function("trust", [column], [solve_definite(A, one, 1e-9)[1]])
    assert float(trust(0.0)) == 0.0
    assert float(trust(1.0)) > TRUSTED
    B = np.array([[a, 2 * a]], dtype=object)
    terms = (ca.SX(1.0), np.ones(1), Limits(1.0, 1e-11))
    guard = ca.Function(
        "guard", [column], [motor_efforts(B, one[0], terms, np.ones(2), Pivots((), (), (1.0, 2.0)))[1]]
    )
    assert float(guard(0.0)) > TRUSTED
    assert float(guard(1e-13)) > TRUSTED, "of one motion, the smallest pivot is the largest"
    assert float(guard(1.0)) <= TRUSTED


@pytest.mark.parametrize(("length", "mass"), [(2.0**-20, 1.0), (2.0**20, 2.0**-20)])
@pytest.mark.parametrize(("name", "base"), [("five_bar", "floating"), ("rps3", "fixed")])
def test_guards_know_no_units(name: str, base: Base, length: float, mass: float) -> None:
    description = shipped(name)
    scale = Scale(length, mass)
    robot = scale.robot(description, base)
    q, v, _ = states_near_home(description, base, 3, 1)
    states = (q * scale.of_q(robot), v * scale.of_v(robot), efforts(robot, 1) * scale.of_tau(robot))
    assert off(robot, states) == ([], 0)


def test_what_is_not_finite_is_handed_over() -> None:
    """With floats, rates of 1e20 square to infinity; the general path still has an answer."""
    robot = build_robot(shipped("five_bar"))
    model = hybridyn.compile(robot, dtype="float32")
    q, v, _ = states_near_home(shipped("five_bar"), "fixed", 3, 2)
    q, v, tau = (x.astype(np.float32) for x in (q, v * 1e20, efforts(robot, 2)))
    assert np.isnan(single(model.library, "ddm", q[0], v[0], tau[0])[1])
    assert np.isnan(model.library.batch("ddm", q, v, tau)[1]).all()


@pytest.mark.slow
def test_motions_without_motors_do_not_hand_floats_over() -> None:
    robot = build_robot(shipped("five_bar"), base="floating")
    model = hybridyn.compile(robot, dtype="float32")
    q, v, _ = states_near_home(shipped("five_bar"), "floating", 3, 3)
    a = hybridyn.ddm(robot, q, v, efforts(robot, 3))
    np.testing.assert_allclose(model.idm(q, v, a), efforts(robot, 3), rtol=1e-2, atol=1e-2)
    assert model.recomputed == 0


def test_without_casadi(tmp_path: Path) -> None:
    """In a process that cannot import it: what to install, for models and for their derivatives."""
    code = (
        "import sys; sys.modules['casadi'] = None\n"
        "import hybridyn\nfrom hybridyn.description.shipped import shipped_robots\n"
        "robot = hybridyn.load(str(shipped_robots()['five_bar'].file), gravity=(0, 0, -1.625))\n"
        "for what in (lambda: hybridyn.compile(robot), lambda: hybridyn.ddm_jacobian):\n"
        "    try: what()\n"
        "    except hybridyn.CompileError as error: print(error)\n"
        "try: import hybridyn.compiled.exporting\n"
        "except hybridyn.CompileError as error: print(error)\n"
        "from hybridyn.cli import main\n"
        "print(main(['convert', 'five_bar', '--c', '-o', 'made']))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path
    )
    assert done.stdout.count("pip install casadi") == 3
    assert done.stdout.splitlines()[3:] == ["1"]
    assert done.stderr.count(f"error: compiling a model needs CasADi: {install_advice('compiled')}") == 1
    assert len(done.stderr.splitlines()) == 1
    assert not [*tmp_path.iterdir()]
