"""Closures of other packages between frames of links, against bars and cranks; and what is refused."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.errors import ModelError
from tests.extending.packages import files, install
from tests.support.comparing import close_to, refused
from tests.support.engines import engine_of
from tests.support.extras import needs
from tests.support.files import save
from tests.support.samples import slow

needs("compiled")
EXACT = 1e-12
THERE_AND_BACK = 1e-9  # ddm(idm(a)) = a loses the condition of A_t
TRUNCATED = 1e-10  # RK4 integrates other coordinates: 1e-11 here, 4e-10 with steps twice as long
#: Of the bar and the crank that stand in for a residual, relative to the links.
LIGHT = 1e-14


def link(name: str, mass: float, centre: str) -> str:
    size = 0.02 * mass
    return (
        f'<link name="{name}"><inertial><origin xyz="{centre}"/><mass value="{mass}"/><inertia ixx="{size}" '
        f'iyy="{1.5 * size}" izz="{size}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )


def joint(
    name: str, kind: str, ends: tuple[str, str], xyz: str, rpy: str = "0 0 0", axis: str = "0 1 0"
) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{ends[0]}"/><child link="{ends[1]}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>'
        '<limit lower="-3" upper="3" effort="9" velocity="9"/></joint>'
    )


def load(folder: Path, name: str, text: str, model: str) -> hybridyn.HybridRobot:
    save(folder, model, f"{name}.model.toml")
    return hybridyn.load(
        save(folder, f'<robot name="{name}"><link name="base"/>{text}</robot>', f"{name}.urdf")
    )


#: Two arms that turn about skew axes; the second carries a tool, turned about z by a right angle.
ARMS = (
    link("first", 1.0, "0 0.02 0.1")
    + link("second", 1.2, "0.01 0 0.15")
    + link("tool", 0.3, "0 0 0")
    + joint("drive", "revolute", ("base", "first"), "0 0 0")
    + joint("rocker", "revolute", ("base", "second"), "0.5 0.05 -0.1", axis="0.6 0.8 0")
    + joint("hold", "fixed", ("second", "tool"), "0 0.05 0.3", "0 0 1.5707963267948966")
)
#: From the tip of the first arm to the tool's point, at zero.
WAY = np.array([0.48, 0.14, 0.0])
LENGTH = 0.5
ROD = files()["swing.model.toml"].text
#: The same rod as a link between two balls.
BAR = (
    link("bar", LIGHT, f"{LENGTH / 2} 0 0")
    + joint("ball", "spherical", ("first", "bar"), "0 0 0.2",
            f"0 {-np.arctan2(WAY[2], np.hypot(*WAY[:2]))} {np.arctan2(WAY[1], WAY[0])}")
    + f'<loop name="end" type="spherical"><predecessor link="bar"><origin xyz="{LENGTH} 0 0"/></predecessor>'
    + '<successor link="tool"><origin xyz="0.04 0.02 0"/></successor></loop>'
)  # fmt: skip


def motion_of(robot: hybridyn.HybridRobot, motion: Any, follower: str) -> list[np.ndarray]:
    """Return a joint's position, rate and acceleration, and the motor's effort."""
    q, v, a = hybridyn.assemble(robot, motors=motion)
    number = robot.joint_index[follower]
    at, rate = robot.q_slices[number].start, robot.v_slices[number].start
    return [q[:, at], v[:, rate], a[:, rate], hybridyn.idm(robot, q, v, a)[:, 0]]


@pytest.mark.parametrize("engines", [("general", "written"), slow(("compiled",))], ids=",".join)
def test_a_constant_length_is_a_rod_between_two_balls(
    engines: Sequence[str], workshop: Path, tmp_path: Path
) -> None:
    rod = load(tmp_path, "rod", ARMS, ROD)
    bar = load(tmp_path, "bar", ARMS + BAR, 'motors = ["drive"]')
    assert rod.mobility == 1
    motion = {"drive": tuple(np.random.default_rng(2).uniform(-0.3, 0.3, (3, 5)))}
    wanted = motion_of(bar, motion, "rocker")
    found = motion_of(rod, motion, "rocker")
    for one, other in zip(found, wanted, strict=True):
        close_to(one, other, EXACT)
    q, v, a = hybridyn.assemble(rod, motors=motion)
    for used in (engine_of(engine, rod) for engine in engines):
        tau = used.idm(q, v, a)
        close_to(tau[:, 0], wanted[-1], EXACT)
        close_to(used.ddm(q, v, tau), a, THERE_AND_BACK)


CIRCLE = """def circle(x, centre: float, radius: float, point: float):
    (R, p), = x
    tip = p + R[:, 2] * point
    return (tip[0] - centre) ** 2 + tip[2] ** 2 - radius ** 2
"""
#: A cart along x, on which a bar turns about y.
CART = (
    link("cart", 2.0, "0 0 0")
    + link("arm", 1.0, "0 0.01 0.1")
    + joint("slide", "prismatic", ("base", "cart"), "0 0 0", "0 0 0", "1 0 0")
    + joint("hinge", "continuous", ("cart", "arm"), "0 0 0", "0 0.4 0")
)
TIP = 0.4 * np.array([np.sin(0.5), np.cos(0.5)])  # of the arm at zero, in x and z
RADIUS = float(np.hypot(TIP[0] - 0.3, TIP[1]))
CRANK = (
    link("crank", LIGHT, f"0 0 {RADIUS / 2}")
    + joint("pin", "revolute", ("base", "crank"), "0.3 0 0", f"0 {np.arctan2(TIP[0] - 0.3, TIP[1])} 0")
    + f'<loop name="end" type="revolute"><predecessor link="crank"><origin xyz="0 0 {RADIUS}"/></predecessor>'
    + '<successor link="arm"><origin xyz="0 0 0.4"/></successor><axis xyz="0 1 0"/></loop>'
)


HOME = 'motors = ["slide"]\n[home]\nhinge = 0.1'


def on_circle(packages: Path, folder: Path, text: str = CIRCLE) -> hybridyn.HybridRobot:
    """Load the cart whose bar's tip is on a circle, in the axes of the base."""
    install(packages, "odd", {"closures": {"circle": "odd:circle"}}, {"odd.py": text})
    return load(folder, "circle", CART, f"""{HOME}
        [residuals.tip]
        closure = "circle"
        frames = ["base", "arm"]
        numbers = {{ centre = 0.3, radius = {RADIUS!r}, point = 0.4 }}
        """)  # fmt: skip


def test_a_point_on_a_circle_is_a_crank(packages: Path, tmp_path: Path) -> None:
    robot, crank = on_circle(packages, tmp_path), load(tmp_path, "crank", CART + CRANK, HOME)
    motion = {"slide": tuple(np.random.default_rng(3).uniform(-0.1, 0.1, (3, 5)))}
    found = [motion_of(one, motion, "slide") for one in (robot, crank)]
    close_to(*found, EXACT)
    swings = []
    for one in (robot, crank):
        q, v, _ = hybridyn.assemble(one, motors={"slide": (0.05, 0.3, 0.0)})
        swing = hybridyn.simulate(one, q, v, (0.0, 0.1), method="rk4", step=0.005)
        swings.append(swing.q[:, one.q_slices[one.joint_index["slide"]].start])
    close_to(*swings, TRUNCATED)


@pytest.mark.parametrize("ending", ["urdf", "xml", "sdf"])
def test_frames_are_written_and_read_back(ending: str, packages: Path, tmp_path: Path) -> None:
    """The hinge's home is not zero: in other files it counts from there."""
    if ending == "xml":
        needs("mjcf")
    robot = on_circle(packages, tmp_path)
    hybridyn.convert(robot, tmp_path / f"again.{ending}")
    motion = {"slide": tuple(np.random.default_rng(3).uniform(-0.1, 0.1, (3, 5)))}
    again = hybridyn.load(tmp_path / f"again.{ending}")
    close_to(motion_of(again, motion, "slide"), motion_of(robot, motion, "slide"), EXACT)


def test_frames_whose_joints_are_parameters_are_refused(workshop: Path, tmp_path: Path) -> None:
    """Other parameters are not."""
    robot, words = load(tmp_path, "rod", ARMS, ROD), "moves a frame of closure 'coupler'"
    refused(lambda: robot.with_parameters({"rotation:hold": np.full(3, 0.1)}), ModelError, words)
    refused(lambda: hybridyn.compile(robot, parameters=["position:rocker"]), ModelError, words)
    assert robot.with_parameters({"mass:tool": 1.0}).mobility == 1


MISTAKES = {
    "no link": ('"tool"', '"tol"', r"\[residuals\] 'coupler': 'tol' is no link.*'tool'"),
    "one link": (', "tool"', "", "names no joints and no two links"),
    "rigid": ('"first"', '"second"', "'tie' of the package 'workshop' has frames that no joint moves"),
    "three": ('"first"', '"base", "first"', "fails: ValueError: too many values"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_wrong_frames_are_refused(name: str, workshop: Path, tmp_path: Path) -> None:
    old, new, words = MISTAKES[name]
    refused(lambda: load(tmp_path, "rod", ARMS, ROD.replace(old, new)), ModelError, words)


@pytest.mark.parametrize("part", ["R[1, 1] - 1.0", "np.exp(2 * p[0]) * np.exp(-2 * p[0])"])
def test_a_residual_that_sees_no_frame_is_refused(part: str, packages: Path, tmp_path: Path) -> None:
    """Of the hinge nothing but its angle moves; slopes of a product of one are zero in numbers alone."""
    text = (
        "import numpy as np\n"
        f"def circle(x, centre: float, radius: float, point: float):\n    (R, p), = x\n    return {part}\n"
    )
    refused(
        lambda: on_circle(packages, tmp_path, text), ModelError, "does not depend on the frames base, arm"
    )


def test_a_ball_between_frames_is_refused(workshop: Path, tmp_path: Path) -> None:
    text = link("first", 1.0, "0 0 0") + joint("drive", "spherical", ("base", "first"), "0 0 0")
    model = ROD.replace('motors = ["drive"]', "").replace('"first", "tool"', '"base", "first"')
    refused(lambda: load(tmp_path, "rod", text, model), ModelError, "'drive' between them is spherical")
