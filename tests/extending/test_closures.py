"""Closures of other packages, against closed forms and usual closures; and what is refused."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.errors import AssemblyError, ModelError
from tests.extending.packages import files, install
from tests.support.comparing import close_to, refused
from tests.support.engines import engine_of
from tests.support.extras import needs
from tests.support.files import save

needs("compiled")
EXACT = 1e-12
THERE_AND_BACK = 1e-9  # ddm(idm(a)) = a loses the condition of A_t

INERTIAL = (
    '<inertial><origin xyz="{}"/><mass value="{}"/>'
    '<inertia ixx="0.1" iyy="{}" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
)
PRESS = f"""<robot name="press"><link name="base"/>
<link name="wheel">{INERTIAL.format("0 0 0", 2.0, 0.3)}</link>
<link name="head">{INERTIAL.format("0 0 0", 1.5, 0.2)}</link>
<joint name="shaft" type="revolute"><parent link="base"/><child link="wheel"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="9" velocity="9"/></joint>
<joint name="plunger" type="prismatic"><parent link="base"/><child link="head"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="9" velocity="9"/></joint></robot>"""


def press(folder: Path, more: str = "") -> hybridyn.HybridRobot:
    """Load a robot with the cam of the page."""
    save(folder, more or files()["press.model.toml"].text, "press.model.toml")
    return hybridyn.load(save(folder, PRESS, "press.urdf"))


@pytest.mark.parametrize("engine", ["general", "written", "compiled"])
def test_a_cam_moves_as_its_closed_form(engine: str, workshop: Path, tmp_path: Path) -> None:
    """Tau = J angle_ddot + m (z_ddot + g) dz/dangle, with z = lift (1 - cos angle)."""
    robot = press(tmp_path)
    assert robot.mobility == 1
    angle, rate, speed = (np.random.default_rng(1).uniform(-1.2, 1.2, 6) for _ in range(3))
    q, v, a = hybridyn.assemble(robot, motors={"shaft": (angle, rate, speed)})
    number = robot.joint_index["plunger"]
    c, s = 0.02 * np.cos(angle), 0.02 * np.sin(angle)
    close_to(q[:, robot.q_slices[number].start], 0.02 - c, EXACT)
    bend = c * rate**2 + s * speed
    close_to(a[:, robot.v_slices[number].start], bend, EXACT)
    used = engine_of(engine, robot)
    wanted = 0.3 * speed + 1.5 * (bend + 9.81) * s
    tau = used.idm(q, v, a)
    close_to(tau[:, 0], wanted, EXACT)
    close_to(used.ddm(q, v, tau), a, THERE_AND_BACK)
    if engine == "compiled":
        for one, other in zip(used.assemble(motors={"shaft": (angle, rate, speed)}), (q, v, a), strict=True):
            close_to(one, other, EXACT)


def arms(folder: Path, name: str, loop: str, model: str) -> hybridyn.HybridRobot:
    """Load two arms of lengths 0.2 and 0.3, at a distance of 0.5; `loop`: what joins their tips."""
    text = f"""<robot name="{name}"><link name="base"/>
    <link name="first">{INERTIAL.format("0 0 0.1", 1.0, 0.02)}</link>
    <link name="second">{INERTIAL.format("0 0 0.15", 1.2, 0.03)}</link>
    <joint name="drive" type="revolute"><parent link="base"/><child link="first"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="9" velocity="9"/></joint>
    <joint name="rocker" type="revolute"><parent link="base"/><child link="second"/><axis xyz="0 1 0"/>
    <origin xyz="0.5 0 0"/><limit lower="-3" upper="3" effort="9" velocity="9"/></joint>{loop}</robot>"""
    save(folder, f'motors = ["drive"]\n{model}', f"{name}.model.toml")
    return hybridyn.load(save(folder, text, f"{name}.urdf"))


LIGHT = 1e-9
COUPLER = f"""<link name="bar"><inertial><mass value="{LIGHT}"/><origin xyz="0.25 0 0"/>
<inertia ixx="{LIGHT}" iyy="{LIGHT}" izz="{LIGHT}" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="pin" type="revolute"><parent link="first"/><child link="bar"/><axis xyz="0 1 0"/>
<origin xyz="0 0 0.2"/><limit lower="-3" upper="3" effort="9" velocity="9"/></joint>
<loop name="end" type="revolute"><predecessor link="bar"><origin xyz="0.5 0 0"/></predecessor>
<successor link="second"><origin xyz="0 0 0.3"/></successor><axis xyz="0 1 0"/></loop>"""
ROD = """[residuals.bar]
closure = "rod"
joints = ["drive", "rocker"]
numbers = { length = 0.5, distance = 0.5, arm = 0.2, follower = 0.3 }
"""


def test_a_constant_length_is_a_bar(workshop: Path, tmp_path: Path) -> None:
    """A four-bar whose coupler weighs next to nothing: the same motion, the same effort."""
    bar, rod = arms(tmp_path, "bar", COUPLER, ""), arms(tmp_path, "rod", "", ROD)
    assert rod.mobility == bar.mobility == 1
    motion = {"drive": tuple(np.random.default_rng(2).uniform(-0.3, 0.3, (3, 5)))}
    found = []
    for robot in (bar, rod):
        q, v, a = hybridyn.assemble(robot, motors=motion)
        number = robot.joint_index["rocker"]
        found.append((q[:, robot.q_slices[number].start], a[:, robot.v_slices[number].start],
                      hybridyn.idm(robot, q, v, a)[:, 0]))  # fmt: skip
    for one, other in zip(*found, strict=True):
        close_to(one, other, 1e-7)  # the bar's weight


def test_what_is_written_is_read_back(workshop: Path, tmp_path: Path) -> None:
    robot = press(tmp_path, files()["press.model.toml"].text + "zeros = { shaft = 0.3 }\n")
    at = {"shaft": (0.4, 1.0, 0.5)}
    for ending in ("urdf", "xml", "sdf"):
        if ending == "xml":
            needs("mjcf")
        hybridyn.convert(robot, tmp_path / f"again.{ending}")
        again = hybridyn.load(tmp_path / f"again.{ending}")
        for one, other in zip(
            hybridyn.assemble(robot, motors=at), hybridyn.assemble(again, motors=at), strict=True
        ):
            close_to(one, other, EXACT)


def test_a_joint_is_named_twice_and_numbers_are_lists(packages: Path, tmp_path: Path) -> None:
    """A parabola, z = c0 x + c1 x^2 with its square as a product; robots of other masses are built anew."""
    text = (
        "from collections.abc import Sequence\n"
        "def odd(x, c: Sequence[float]): return x[2] - c[0] * x[0] - c[1] * x[0] * x[1]"
    )
    install(packages, "odd", {"closures": {"odd": "odd:odd"}}, {"odd.py": text})
    names = "joints = ['shaft', 'shaft', 'plunger']\nnumbers = { c = [0.1, 0.2] }\n"
    robot = press(tmp_path, f"motors = ['shaft']\n[residuals.lift]\nclosure = 'odd'\n{names}")
    heavier = robot.with_parameters({"mass:head": 2.5})
    angle, rate, speed = np.random.default_rng(3).uniform(-1.2, 1.2, (3, 4))
    q, v, a = hybridyn.assemble(robot, motors={"shaft": (angle, rate, speed)})
    slope = 0.1 + 0.4 * angle
    place, velocity = robot.q_slices[number := robot.joint_index["plunger"]], robot.v_slices[number]
    close_to(q[:, place.start], 0.1 * angle + 0.2 * angle**2, EXACT)
    close_to(v[:, velocity.start], slope * rate, EXACT)
    bend = 0.4 * rate**2 + slope * speed
    close_to(a[:, velocity.start], bend, EXACT)
    for engine, built, mass in (("written", robot, 1.5), ("general", heavier, 2.5)):
        found = engine_of(engine, built).idm(q, v, a)[:, 0]
        close_to(found, 0.3 * speed + mass * (bend + 9.81) * slope, EXACT)


RESIDUALS = {
    "two numbers": "[x[0], x[1]]",
    "no joint": "x[0]",
    "kink": "abs(x[0] - x[1])",
    "condition": "x[0] if x[0] > x[1] else x[1]",
    "fails": "1 / 0",
    "nothing": "None",
    "text": "'a'",
    "math": "x[0] + x[1] + __import__('math').cos(x[0])",
    "whole": "x[0] - x[1] * k",
}
ODD = "def odd(x, k: float = 1.0): return RESULT"
MISTAKES = {
    "two numbers": ("", "the closure 'odd' of the package 'odd' returns 2 numbers: a residual is one"),
    "no joint": ("", "does not depend on joint 'plunger'"),
    "kink": ("", r"is not smooth \(fabs\)"),
    "condition": ("", "fails: RuntimeError"),
    "fails": ("", "fails: ZeroDivisionError"),
    "nothing": ("", "the closure 'odd' of the package 'odd' returns None: a residual is one number"),
    "text": ("", "the closure 'odd' of the package 'odd' returns a: a residual is one number"),
    "math": ("", "'odd' is not a number on symbols: take NumPy's functions, not math's"),
    "whole": ("numbers = { K = 1 }", "press.model.toml:4: 'residuals.lift.numbers.K': unknown key 'K'"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_closure_that_cannot_be_used_is_one_sentence(name: str, packages: Path, tmp_path: Path) -> None:
    more, words = MISTAKES[name]
    install(
        packages, "odd", {"closures": {"odd": "odd:odd"}}, {"odd.py": ODD.replace("RESULT", RESIDUALS[name])}
    )
    text = f"[residuals.lift]\nclosure = 'odd'\njoints = ['shaft', 'plunger']\n{more}\n"
    refused(lambda: press(tmp_path, text), ModelError, words)


def test_a_loop_that_is_never_closed_is_one_sentence(packages: Path, tmp_path: Path) -> None:
    """None of its tried postures is left, and the residual takes no samples."""
    code = {"odd.py": "def odd(x): return x[0] ** 2 + x[1] ** 2 + 1.0"}
    install(packages, "odd", {"closures": {"odd": "odd:odd"}}, code)
    text = "[residuals.lift]\nclosure = 'odd'\njoints = ['shaft', 'plunger']\n"
    refused(lambda: press(tmp_path, text), AssemblyError, "no posture closes its loops")


FILES = {
    "unknown closure": ("'cam'", "'cm'", "model.toml:3: 'residuals.lift': there is no closure 'cm'.*'cam'"),
    "unknown joint": ("'shaft', ", "'shft', ", r"\[residuals\] 'lift': 'shft' is no movable joint.*'shaft'"),
    "zero of another": (
        "'plunger']",
        "'shaft']\nzeros = { plunger = 1 }",
        "'lift': 'zeros' names 'plunger', which is none of",
    ),
    "too few": ("'shaft', ", "", "fails: ValueError: not enough values"),
    "no number": ("lift = 0.02", "", "'lift' is missing"),
}


@pytest.mark.parametrize("name", FILES)
def test_wrong_words_of_a_residual_are_refused(name: str, workshop: Path, tmp_path: Path) -> None:
    old, new, words = FILES[name]
    text = files()["press.model.toml"].text.replace('"', "'").replace(old, new)
    refused(lambda: press(tmp_path, text), ModelError, words)
