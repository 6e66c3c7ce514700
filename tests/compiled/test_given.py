"""The exported control step from poses: its C gives the general path's motion and efforts, or refuses."""

import ctypes
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import hybridyn
from hybridyn import HybridRobot, ModelError
from hybridyn.assembly.assemble import assemble_requests
from hybridyn.assembly.requests import gather_requests
from hybridyn.compiled.exporting import export
from hybridyn.compiled.programs.given_control import given_motion
from hybridyn.compiled.programs.walking import OTHER_BRANCH
from hybridyn.spatial import Array
from tests.assembly.test_angles import arm
from tests.compiled.test_chains import load, some_of, swing
from tests.compiled.test_export import STRICT, compiler, run_test
from tests.compiled.test_pointing import named
from tests.robots.posing import of_joints, of_link
from tests.support.comparing import close_to, refused
from tests.support.samples import slow

SAME = 1e-9  # of the largest entry: rounding, through the condition of loops and targets anywhere
STEPS, MANY = 30, 10_000
TOGETHER = 15  # steps from one posture of a swing on
SMALLEST, LARGEST = -4.0, -0.3  # sizes of steps, logarithms [robot's size or rad]
#: What the C function fills.
Filled = tuple[Array, Array, Array, Array]


@dataclass
class Stepper:
    """A control step in C."""

    robot: HybridRobot
    function: Any

    def __post_init__(self) -> None:
        self.function.restype, self.function.argtypes = ctypes.c_double, [ctypes.c_void_p] * 9

    def __call__(self, *given: Array) -> tuple[float, Filled]:
        """Return the guard, and q, v, a and efforts: from the last posture, what is given, and its rates."""
        r = self.robot
        out = np.empty(r.nq), np.empty(r.nv), np.empty(r.nv), np.empty(len(r.motors))
        arrays = [np.ascontiguousarray(x, dtype=float) for x in given]
        work = np.empty(1_000_000)
        return float(self.function(*(x.ctypes.data for x in (*arrays, *out, work)))), out


def stepper(robot: HybridRobot, folder: Path, *given: str) -> Stepper:
    """Export a robot's control step, build it, and load it."""
    export(robot, folder / "made", name="m", given=given)
    words = "-O0", "-shared", "-fPIC", "-o", folder / "m.so", folder / "made" / "m.c", "-lm"
    assert compiler(*STRICT, *words) == ""
    return Stepper(robot, ctypes.CDLL(str(folder / "m.so")).m_idm_from_given)


class Task:
    """What is given of a robot: coordinates of a link, a whole pose where there are none, and motors."""

    def __init__(self, robot: HybridRobot, link: str, names: str = "", motors: int = 0) -> None:
        self.robot, self.link, self.names = robot, link, names
        self.motors = robot.motors[:motors]

    @property
    def columns(self) -> list[str]:
        """What is given, as `export` takes it."""
        own = [f"{self.link}/pose/{name}" for name in self.names.split()] or [f"{self.link}/pose"]
        return [*(f"{name}/position" for name in self.motors), *own]

    def at(self, q: Array) -> Array:
        """Return what a posture has of it."""
        still = np.zeros((1, self.robot.nv))
        levels = of_link(self.robot, q[None], still, still, self.link, self.robot.description.root)
        joints = of_joints(self.robot, q[None], still, still, self.motors)
        own = [x for name in self.motors for x in joints[name][0]]
        if not self.names:
            return np.array([*own, *levels[0][0]])
        return np.array([*own, *(x[0] for x in some_of(levels, self.names)[0].values())])

    def next(self, rng: np.random.Generator, q: Array) -> tuple[Array, Array, Array]:
        """Return a random step from a posture, with rates and accelerations."""
        here, size = self.at(q), 10.0 ** rng.uniform(SMALLEST, LARGEST)
        n = len(here) - (not self.names)
        move, rates, changes = size * rng.normal(size=n), rng.normal(size=n), rng.normal(size=n)
        if self.names:
            return here + move, rates, changes
        turn = hybridyn.spatial.quaternion_from_vector(move[None, -3:])[0]
        x, y = here[-4:], turn
        product = [
            y[3] * x[:3] + x[3] * y[:3] + np.cross(y[:3], x[:3]),
            [y[3] * x[3] - y[:3] @ x[:3]],
        ]
        return np.concatenate([here[:-4] + move[:-3], *product]), rates, changes

    def judge(self, q: Array, levels: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        """Return the motion by the general path, in one step from a posture."""
        k = len(self.motors)
        motors = {name: tuple(x[i] for x in levels) for i, name in enumerate(self.motors)}
        pose: object = tuple(x[k:] for x in levels)
        if self.names:
            pose = tuple(dict(zip(self.names.split(), x[k:], strict=True)) for x in levels)
        requests = gather_requests(self.robot, motors, {self.link: pose})._replace(strict=True)
        found = assemble_requests(self.robot, requests, q)
        return found[0][0], found[1][0], found[2][0]


def walk(step: Stepper, task: Task, count: int, judged: int = 1) -> None:
    """Compare random steps with the general path; those that C refuses are too long, or cannot be done.

    Args:
        judged: Of this many steps, the general path judges one; the others must reach what is given.
    """
    robot, rng, taken, last = step.robot, np.random.default_rng(0), 0, np.zeros(0)
    starts = swing(robot, 0.01, count // TOGETHER + 1)[0]
    for k in range(count):
        last = starts[k // TOGETHER] if k % TOGETHER == 0 else last
        levels = task.next(rng, last)
        guard, found = step(last, *levels)
        if not guard <= 1.0:
            assert guard > 1.0
            continue
        taken += 1
        here, wanted = task.at(found[0]), levels[0].copy()
        if not task.names and here[-4:] @ wanted[-4:] < 0.0:
            wanted[-4:] *= -1.0
        close_to(here, wanted, SAME, 1.0)
        if taken % judged == 0:
            right = task.judge(last, levels)
            for x, y in zip(found, (*right, hybridyn.idm(robot, *right, passive="given")), strict=True):
                close_to(x, y, SAME, 1.0)
        last = found[0]
    assert count / 3 < taken < count


@pytest.fixture(scope="module")
def five_bar(tmp_path_factory: pytest.TempPathFactory) -> Stepper:
    """Return the step of the five-bar from two coordinates of its tool."""
    given = "m1_tool/pose/x", "m1_tool/pose/z"
    return stepper(hybridyn.load("five_bar"), tmp_path_factory.mktemp("five_bar"), *given)


CASES = [
    ("five_bar", "m1_tool", "x z", 0),
    ("arm yyy", "l2", "x z", 0),
    slow("arm yyyy", "l3", "x z pitch", 0),
    slow("excavator", "teeth", "x z pitch", 0),
    slow("stewart_ur5", "wrist_3_link", "", 0),
    slow("stewart_ur5", "wrist_3_link", "x y z", 3),
]


@pytest.mark.parametrize(("name", "link", "names", "motors"), CASES)
def test_steps_are_those_of_the_general_path(
    name: str, link: str, names: str, motors: int, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    """From sizes where Newton's method needs two steps to those beyond reach."""
    built = request.getfixturevalue(name) if name == "five_bar" else None
    robot = built.robot if built else load(name, tmp_path)
    task = Task(robot, link, names, motors)
    walk(built or stepper(robot, tmp_path, *task.columns), task, STEPS, judged=3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "link", "names"), [("arm zyxyzyx", "l6", ""), ("excavator", "teeth", "x z")]
)
def test_many_steps_are_those_of_the_general_path(name: str, link: str, names: str, tmp_path: Path) -> None:
    robot = load(name, tmp_path)
    task = Task(robot, link, names)
    walk(stepper(robot, tmp_path, *task.columns), task, MANY, judged=25)


class Pointing(NamedTuple):
    """An arm's export, and what is given: where an axis points, a distance from a point, and lone numbers."""

    robot: HybridRobot
    lone: list[str]
    link: str
    given: list[str]
    folder: Path


ZYY: tuple[str, list[str], str] = "zyy", [], "l2"
#: Of a longer arm a lone angle and a joint, too.
ZYYZY = "zyyzy", ["j4/position", "l1/pose/yaw"], "l3"


@pytest.fixture(scope="module")
def pointing(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Pointing:
    """Export an arm, and compile its models."""
    axes, lone, link = request.param
    folder = tmp_path_factory.mktemp("pointing")
    robot = arm(folder, axes)
    given = [*lone, *(f"{link}/pose/{x}" for x in ("distance", "cx", "cy", "cz", "xx", "xy", "xz"))]
    export(robot, folder / "made", name="m", given=given)
    models = folder / "made" / "m"
    assert compiler(*STRICT, "-O0", "-fPIC", "-c", f"{models}.c", "-o", f"{models}.o") == ""
    return Pointing(robot, lone, link, given, folder / "made")


@pytest.mark.parametrize("pointing", [ZYY, slow(ZYYZY)], indirect=True, ids=["zyy", "zyyzy"])
def test_the_header_lists_what_is_given_and_the_exported_test_runs(pointing: Pointing) -> None:
    link, text = pointing.link, (pointing.folder / "m.h").read_text()
    places = [x.replace("/pose", "@root/pose") for x in pointing.lone]
    places += [f"{link}@root/pose/{x}" for x in ("xx", "xy", "xz", "distance")]
    assert "   given\n" + "".join(f"     {i}  {x}\n" for i, x in enumerate(places)) in text
    assert text.count(f"{link}@root/velocity/cz") == 1
    assert run_test(pointing.folder, "m", "-O0", models="o").count("idm_from_given") == 5


@pytest.mark.parametrize("pointing", [ZYY], indirect=True, ids=["zyy"])
def test_steps_follow_directions_and_points_that_move(pointing: Pointing) -> None:
    """As the general path does, from the posture before."""
    robot, folder = pointing.robot, pointing.folder
    assert compiler("-shared", "-o", folder / "m.so", folder / "m.o", "-lm") == ""
    step = Stepper(robot, ctypes.CDLL(str(folder / "m.so")).m_idm_from_given)
    motion, states = given_motion(robot, pointing.given), swing(robot, 0.05, 8)
    levels = named(robot, states, pointing.link, "xx distance")
    for k in range(1, 8):
        at = tuple({name: x[k : k + 1] for name, x in one.items()} for one in levels)
        requests, last = gather_requests(robot, None, {pointing.link: at}), states[0][k - 1]
        guard, found = step(last, *(x[0] for x in motion.numbers(requests)))
        right = [x[0] for x in assemble_requests(robot, requests, last)]
        assert guard <= 1.0
        for x, y in zip(found, (*right, hybridyn.idm(robot, *right)), strict=True):
            close_to(x, y, SAME)


def test_what_is_no_number_or_open_or_of_another_length_is_refused(five_bar: Stepper) -> None:
    """NaN says the first; the guard is above 1 for the others."""
    step, robot = five_bar, five_bar.robot
    task = Task(robot, "m1_tool", "x z")
    here, still = task.at(robot.home), np.zeros(2)
    assert step(robot.home, here, still, still)[0] <= 1.0
    for i in range(4):
        given = [robot.home.copy(), here.copy(), still.copy(), still.copy()]
        given[i][0] = np.nan
        assert np.isnan(step(*given)[0]), i
    opened = robot.home + 1e-9 * np.arange(robot.nq)
    assert 1.0 < step(opened, here, still, still)[0] < OTHER_BRANCH
    assert step(robot.home, here + 10.0, still, still)[0] == OTHER_BRANCH


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (["m1_tool/pose"], "exported C does not close these loops"),
        (["m1_tool/pose/x", "m1_tool/pose/x"], "'m1_tool/pose/x' is given twice"),
        (["m1_tool/pose", "m1_tool/pose"], "'m1_tool/pose' is given twice"),
        (["m1_tool"], "'m1_tool' is given twice, or is none of LINK/pose"),
        (["m1_left_drive/position", "m1_right_drive/position"], "no pose is given"),
        (["m1_tol/pose/x", "m1_tol/pose/z"], "did you mean 'm1_tool'"),
        (["m1_tool/pose/x", "m1_tool/pose/high"], "unknown coordinate 'high'"),
    ],
)  # fmt: skip
def test_what_cannot_be_given_is_refused(given: list[str], words: str) -> None:
    robot = hybridyn.load("five_bar")
    refused(lambda: given_motion(robot, given), ModelError, words)


def test_a_step_from_poses_needs_a_fixed_base_and_double_precision(tmp_path: Path) -> None:
    given, robot = ["m1_tool/pose/x", "m1_tool/pose/z"], hybridyn.load("five_bar")
    with pytest.raises(ModelError, match="needs double precision, and has no parameters"):
        export(robot, tmp_path, given=given, dtype="float32")
    with pytest.raises(ModelError, match="needs a fixed base, not a floating one"):
        given_motion(hybridyn.load("five_bar", base="floating"), given)
