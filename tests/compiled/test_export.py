"""Models as C for other programs: the files compile without a warning and give the general path's numbers."""

import ctypes
import itertools
import re
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from benchmarks.operations import operations
from hybridyn.cli import main
from hybridyn.compiled.code.plain_c import in_lanes, plain_source, prototype, work_type
from hybridyn.compiled.code.scalars import c_text
from hybridyn.compiled.equations.states import moving_states
from hybridyn.compiled.exporting import c_name, export
from hybridyn.compiled.library.building import NATIVE, find_compiler
from hybridyn.compiled.programs.c_header import comment
from hybridyn.compiled.programs.whole_robot import function_of
from hybridyn.effects import Payload, Spring, with_effects
from hybridyn.structure.building import build_robot
from tests.compiled import rods
from tests.compiled.test_control import motion
from tests.compiled.toys import inputs, toy
from tests.robots.mechanisms import OVER_FOLDS, random_mechanism
from tests.robots.robot_texts import door
from tests.support.comparing import close_to, refused, same_bits
from tests.support.files import save

#: Parts of the models that every module has.
STRICT = ["-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-Wconversion", "-O1"]


def called(function: Any, *arrays: np.ndarray) -> float:
    """Call a function in C with arrays, the last of which it fills; return its guard."""
    function.restype = ctypes.c_double
    given = [np.ascontiguousarray(x) for x in arrays]
    assert all(x is y for x, y in zip(given[-2:], arrays[-2:], strict=True))
    return float(function(*(ctypes.c_void_p(x.ctypes.data) for x in given)))


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Export the five-bar once, as "bar", and compile it."""
    folder = tmp_path_factory.mktemp("exported")
    export(hybridyn.load("five_bar"), folder, name="bar")
    # it warns of more than -O1
    assert compiler(*STRICT, "-O0", "-fPIC", "-c", "bar.c", "-o", "bar.o", cwd=folder) == ""
    return folder


@pytest.fixture
def bar(exported: Path, tmp_path: Path) -> Path:
    """Return a folder of its own with the exported five-bar in it."""
    return Path(shutil.copytree(exported, tmp_path / "bar"))


@pytest.fixture
def leaf(tmp_path: Path) -> hybridyn.HybridRobot:
    """Return a small robot with a loop."""
    return hybridyn.load(save(tmp_path, door(2), "door.urdf"))


def compiler(*words: object, program: Sequence[str] = (), cwd: Path | None = None) -> str:
    """Run the C compiler, or another program, and return what it prints."""
    command = [*(program or find_compiler()), *map(str, words)]
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True)
    assert (done.returncode == 0) == ("error" not in done.stderr)
    return done.stdout + done.stderr


def run_test(folder: Path, name: str, *more: str, models: str = "c") -> str:
    """Compile and run an exported test; gives what it prints.

    Args:
        folder: Where the files are.
        name: That of the export.
        more: Words for the compiler.
        models: Ending of the file with the models: "o", if they are compiled.
    """
    files = [folder / f"test_{name}.c", folder / f"{name}.{models}"]
    assert compiler(*STRICT, *more, "-o", folder / "test", *files, "-lm") == ""
    done = subprocess.run([folder / "test"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
    return done.stdout


def written(folder: Path, name: str, printed: str) -> str:
    """Return the C of an export; what its test printed is trusted at every state."""
    endings = {f"{name}.c", f"{name}.h", f"test_{name}.c", "Makefile", "README.md"}
    assert endings <= {path.name for path in folder.iterdir()}
    for model in ("idm", "ddm"):
        guards = [float(x) for x in re.findall(rf"{model} \d: guard (\S+),", printed)]
        assert len(guards) == 5
        assert max(guards) <= 1.0
    source = (folder / f"{name}.c").read_text()
    assert set(re.findall(r"#include (\S+)", source)) == {"<math.h>", f'"{name}.h"'}
    assert not re.search(r"\b(malloc|memcpy|printf)\b", source)
    return source


def test_exported_models_give_the_reference(bar: Path) -> None:
    source = written(bar, "bar", run_test(bar, "bar", "-O0", models="o"))
    assert not re.search(r"\bfloat q\[", source)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "options"),
    [
        ("five_bar", {}),
        ("five_bar", {"dtype": "float32"}),
        ("gough_stewart", {}),
        ("five_bar", {"base": "moving"}),
        ("five_bar", {"base": "floating"}),
    ],
    ids=str,
)
def test_exported_models_compile_and_give_the_reference(
    tmp_path: Path, robot: str, options: dict[str, Any]
) -> None:
    dtype = options.pop("dtype", "float64")
    paths = export(hybridyn.load(robot, **options), tmp_path / "made", name="machine", dtype=dtype)
    assert {*paths} == {*(tmp_path / "made").iterdir()}
    source = written(tmp_path / "made", "machine", run_test(tmp_path / "made", "machine"))
    assert bool(re.search(r"\bfloat q\[", source)) == (dtype == "float32")


def test_a_robot_without_motors_is_exported(leaf: hybridyn.HybridRobot, tmp_path: Path) -> None:
    export(build_robot(replace(leaf.description, motors=())), tmp_path / "made", name="bar")
    files = [tmp_path / "made" / name for name in ("test_bar.c", "bar.c")]
    assert "error" not in compiler("-o", tmp_path / "test", *files, "-lm")
    assert "ddm 4: guard" in compiler(program=[str(tmp_path / "test")])


def test_the_exported_test_can_fail(bar: Path) -> None:
    file = bar / "test_bar.c"
    text = file.read_text()
    start = text.index("ddm_a[5]")
    number = re.compile(r"-?\d+\.\d+").search(text, start)
    file.write_text(text[: number.start()] + "1234.5" + text[number.end() :])
    refused(lambda: run_test(bar, "bar", "-O0", models="o"), AssertionError, "largest difference")


def test_the_exported_test_fails_where_nothing_is_compared(
    leaf: hybridyn.HybridRobot, tmp_path: Path
) -> None:
    bar = tmp_path / "bar"
    export(leaf, bar, name="bar")
    file = bar / "bar.c"
    text = file.read_text()
    assert text.count("return guard;") == 6  # of five functions, and of the program "turning"
    asked = 'return atof(getenv("GUARD"));'
    file.write_text(f"#include <stdlib.h>\n{text.replace('return guard;', asked)}")
    assert compiler("-O0", "-o", "test", "test_bar.c", "bar.c", "-lm", cwd=bar) == ""
    for guard in ("2.0", "0.0"):  # never trusted; always, also where a number is not finite
        done = subprocess.run([bar / "test"], env={"GUARD": guard}, capture_output=True, text=True)
        assert done.returncode == 1
        assert "no state is trusted, or what is not finite is" in done.stdout


IN_CPP = """#include "bar.h"
int main() {
    bar_ddm_work work;
    const double q[4] = {0, 0, 0, 0}, v[4] = {0, 0, 0, 0};
    double a[4], tau[2] = {1.0, 0.0};
    const bool right = bar_ddm(q, v, tau, a, &work) <= 1.0;
    tau[0] = 1e308;
    const double over = bar_ddm(q, v, tau, a, &work);
    tau[0] *= 1e308;
    tau[0] -= tau[0];  // not a number
    const double none = bar_ddm(q, v, tau, a, &work);
    return right + 2 * (over <= 1.0) + 4 * (none <= 1.0);
}
"""


@pytest.mark.skipif(shutil.which("g++") is None, reason="there is no C++ compiler")
def test_c_plus_plus_calls_it_and_what_overflows_is_refused(bar: Path) -> None:
    (bar / "main.cpp").write_text(IN_CPP)
    cpp = ["g++", "-Wall", "-Wextra", "-Werror"]
    assert compiler("main.cpp", "bar.o", "-lm", "-o", "main", program=cpp, cwd=bar) == ""
    assert subprocess.run([bar / "main"]).returncode == 1  # the first alone is trusted


class Stepping:
    """The exported functions of a robot for control steps, built as "bar" in a folder; they raise no error.

    Attributes:
        refused: Guard of steps to which no way leads, as the header defines it.
    """

    def __init__(self, robot: hybridyn.HybridRobot, folder: Path) -> None:
        file, self.robot, self.work = folder / "bar.so", robot, np.empty(100_000)
        models = folder / ("bar.o" if (folder / "bar.o").exists() else "bar.c")
        assert compiler("-O0", "-shared", "-fPIC", "-o", file, models, "-lm") == ""
        self.bar = ctypes.CDLL(str(file))
        value = re.search(r"#define BAR_OTHER_BRANCH \(\(double\)(\S+)\)", (folder / "bar.h").read_text())
        self.refused = float(value.group(1))

    def step(self, last: np.ndarray, position: Any, rate: Any = 0.0, acceleration: Any = 0.0) -> Any:
        """Return the guard of a control step, then efforts, q, v, a."""
        robot = self.robot
        v, a = np.zeros((2, robot.nv))
        v[robot.motor_v], a[robot.motor_v] = rate, acceleration
        q, v_closed, a_closed, tau = (np.empty(n) for n in (robot.nq, robot.nv, robot.nv, len(robot.motors)))
        given = last, np.array(position), v, a
        out = q, v_closed, a_closed, tau, self.work
        return called(self.bar.bar_idm_from_motors, *given, *out), tau, q, v_closed, a_closed

    def by_newton(self, last: np.ndarray, position: Any) -> tuple[float, np.ndarray]:
        """Return guard and posture of Newton's method alone, which compares no branches."""
        q, near, (v, a) = last.copy(), last.copy(), np.zeros((2, self.robot.nv))
        near[self.robot.motor_q], guard, steps = position, np.inf, 0
        while not guard <= 1.0 and steps < 8:
            guard = called(self.bar.bar_close, near, v, a, q, v.copy(), a.copy(), self.work)
            near, steps = q.copy(), steps + 1
        return guard, q


@pytest.mark.slow
@pytest.mark.parametrize("name", ["five_bar", "delta", "gough_stewart", "lx4"])
def test_control_steps_have_the_numbers_of_the_library(name: str, tmp_path: Path) -> None:
    robot = hybridyn.load(name)
    export(robot, tmp_path, name="bar")
    stepping, compiled = Stepping(robot, tmp_path), hybridyn.compile(robot)
    last = mine = None
    for tick in zip(*motion(robot, 12), strict=True):
        right = compiled.idm_from_motors(*tick, last=last)
        guard, *found = stepping.step(robot.home if mine is None else mine, *tick)
        assert guard <= 1.0
        close_to(tuple(found), right, 1e-10, 1.0)  # the loops' rates are closed to 1e-11
        last, mine = right[1], found[1]


#: A posture of the five-bar, and its motors a tick later: Newton's method alone jumps to another assembly, in
#: steps as short as a walk demands. Only the turning of the rows tells.
JUMPING = [3.370, -3.504, -2.749, 1.647], [3.196, -3.361]
#: Motors at an assembly to which no continuous motion leads straight from home.
APART = [-2.5, 2.5]


def test_control_steps_stay_on_their_branch_or_are_refused(bar: Path) -> None:
    robot = hybridyn.load("five_bar")
    stepping = Stepping(robot, bar)
    near = np.array(JUMPING[0])
    last, *_ = hybridyn.assemble(robot, motors=near[robot.motor_q], guess=near)
    right, *_ = hybridyn.assemble(robot, motors=np.array(JUMPING[1]), guess=last)
    alone, jumped = stepping.by_newton(last, JUMPING[1])
    assert alone <= 1.0
    assert np.abs(np.sin((jumped - right) / 2)).max() > 0.5
    guard, _, q, *_ = stepping.step(last, JUMPING[1])
    assert guard <= 1.0
    close_to((q,), (right,), 1e-10)
    far = partial(hybridyn.assemble, robot, motors=np.array(APART), guess=robot.home)
    refused(far, hybridyn.AssemblyError, "it would jump to another assembly branch")
    assert stepping.by_newton(robot.home, APART)[0] <= 1.0
    for goal in (APART, [1e9, 0.0], [0.0, -1e300]):  # the last two are wild
        assert stepping.step(robot.home, goal)[0] == stepping.refused
    for goal in ([np.nan, 0.0], [0.0, np.inf]):
        assert np.isnan(stepping.step(robot.home, goal)[0])


@pytest.mark.slow
@pytest.mark.parametrize("digits", [6, 9])
def test_control_steps_take_quaternions_with_the_digits_of_a_file(digits: int, tmp_path: Path) -> None:
    robot = build_robot(rods.crank())
    export(robot, tmp_path, name="bar")
    last = robot.home.round(digits)
    guard, _, q, *_ = Stepping(robot, tmp_path).step(last, robot.home[robot.motor_q])
    assert guard <= 1.0
    close_to((q,), (robot.home,), 2.0 * 10.0**-digits)


@pytest.mark.slow
def test_control_steps_over_a_fold_are_refused_as_by_the_general_path(tmp_path: Path) -> None:
    """Without the turning of the rows, the second way ends at another assembly, with a guard of 0.0006."""
    robot = build_robot(random_mechanism(3, kind="loop_universal"))
    export(robot, tmp_path, name="bar")
    stepping = Stepping(robot, tmp_path)
    right, *_ = hybridyn.assemble(robot, motors=np.array(OVER_FOLDS[0]), guess=robot.home)
    guard, _, q, *_ = stepping.step(robot.home, OVER_FOLDS[0])
    assert guard <= 1.0
    close_to((q,), (right,), 1e-10)
    far = partial(hybridyn.assemble, robot, motors=np.array(OVER_FOLDS[1]), guess=robot.home)
    refused(far, hybridyn.AssemblyError, "it would jump to another assembly branch")
    assert stepping.step(robot.home, OVER_FOLDS[1])[0] == stepping.refused


def test_fast_math_is_refused_when_it_is_compiled(exported: Path) -> None:
    said = compiler("-std=c99", "-ffast-math", "-fsyntax-only", exported / "bar.c")
    assert re.search("error.*build without -ffast-math", said)


@pytest.mark.parametrize("flags", ["-fassociative-math -fno-trapping-math", ""])
def test_reordered_sums_and_lost_signs_are_refused_when_it_is_compiled(flags: str, tmp_path: Path) -> None:
    """Sines reordered by GCC were wrong by percents, and guards of 0.0004 let the efforts through."""
    tmp_path.joinpath("head.c").write_text(c_text("plain.h"))
    if "__clang__" in compiler("-dM", "-E", "-xc", "/dev/null"):
        pytest.skip("Clang does not tell the source")
    said = compiler(*flags.split(), "-fno-signed-zeros", "-c", "head.c", "-o", "head.o", cwd=tmp_path)
    assert re.search("error.*build without -fassociative-math", said)


def test_models_of_two_robots_go_into_one_program(
    leaf: hybridyn.HybridRobot, bar: Path, tmp_path: Path
) -> None:
    export(leaf, tmp_path, name="leaf")
    both = tmp_path / "leaf.c", bar / "bar.o"
    assert compiler("-fPIC", "-shared", "-o", tmp_path / "both.so", *both, "-lm") == ""


def test_no_other_file_is_written_over(leaf: hybridyn.HybridRobot, tmp_path: Path) -> None:
    robot, mine = leaf, tmp_path / "mine"
    mine.mkdir()
    (mine / "README.md").write_text("# My controller\n")
    refused(
        lambda: export(robot, mine, name="bar"),
        hybridyn.ModelError,
        r"README\.md' exists and was not written by hybridyn",
    )
    assert [path.name for path in mine.iterdir()] == ["README.md"]
    (mine / "README.md").unlink()
    for _ in range(2):
        export(robot, mine, name="bar")


def test_names_cannot_end_a_comment() -> None:
    text = comment(["leg*/ int x; /*", "a//*b", "new\nline", "* /"])
    assert text.count("*/") == text.count("/*") == 1
    assert "\nline" not in text


def test_limits_are_not_exported(tmp_path: Path) -> None:
    refused(
        lambda: export(hybridyn.load("five_bar"), tmp_path / "made", ["default", "limits"]),
        hybridyn.ModelError,
        "'limits' is not part of exported C: clip the efforts",
    )
    assert not (tmp_path / "made").exists()


@pytest.mark.skipif(shutil.which("make") is None, reason="there is no make")
def test_make_runs_the_test(leaf: hybridyn.HybridRobot, tmp_path: Path) -> None:
    export(leaf, tmp_path / "made")
    done = subprocess.run(["make", "-C", str(tmp_path / "made")], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert "largest difference from the reference" in done.stdout


def test_every_kind_of_program_compiles_with_the_same_bits_in_lanes(tmp_path: Path) -> None:
    for seed, copies in ((1, 1), (2, 6)):
        program = toy(seed, copies)
        assert in_lanes([program]) == (copies == 6)
        name = f"toy_{program.name}"
        head, rest = plain_source([program], "toy").replace('#include "toy.h"', "").split("\n", 1)
        work = work_type(program, "toy", lanes=copies == 6)
        file = tmp_path / f"toy{seed}.c"
        file.write_text("\n".join([head, work, f"{prototype(program, 'toy')};", rest]))
        given = [x[0] for x in inputs(program, 1)]
        results = [[np.array(x).ravel() for x in function_of(program)(*given)]]
        for n, more in enumerate([[], ["-DHYBRIDYN_SCALAR"]] if copies == 6 else [[]]):
            made = tmp_path / f"toy{seed}{n}.so"
            flags = [*STRICT, "-O0", *NATIVE, *more, "-shared", "-fPIC"]  # one number at a time, or lanes
            assert compiler(*flags, file, "-o", made, "-lm") == ""
            out = [np.zeros(size) for _, size in program.outputs]
            guard = called(getattr(ctypes.CDLL(str(made)), name), *given, *out, np.zeros(1000))
            results.append([*out, np.array([guard])])
        assert all(np.isfinite(x).all() for x in results[1])
        if copies == 6:
            same_bits(tuple(results[1]), tuple(results[2]))
        for x, known in zip(results[1], results[0], strict=True):
            np.testing.assert_allclose(x, known, rtol=1e-9)  # without fused products


def test_names_are_names_in_c(tmp_path: Path) -> None:
    assert c_name("LX-4 (new)") == "lx_4__new_"
    assert c_name("4bar") == "robot_4bar"
    refused(
        lambda: export(hybridyn.load("five_bar"), tmp_path, name="a b"),
        hybridyn.ModelError,
        "'a b' is not a C identifier",
    )


def test_operations_are_counted_by_part_and_copies() -> None:
    program = toy(4, 6)
    counts, three = operations(program), operations(toy(4, 3))
    assert set(counts) == {"legs", "module"}
    assert counts["legs"]["trig"] == 2 * three["legs"]["trig"]
    assert counts["module"]["mul"] == three["module"]["mul"]


def test_the_command_line_exports(
    leaf: hybridyn.HybridRobot, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["convert", str(tmp_path / "door.urdf"), "--c"]
    assert main([*words, "-o", str(tmp_path / "made")]) == 0
    out, err = capsys.readouterr()
    assert out == ""
    assert "README.md" in err
    single = tmp_path / "single"
    assert main([*words, "-o", str(single), "--float32"]) == 0
    assert "float numbers[" in (single / "door.h").read_text()
    assert re.search(r"\bfloat q\[", written(single, "door", run_test(single, "door", "-O0")))
    assert main(words) == 2
    assert "'-o'" in capsys.readouterr().err


def test_a_root_link_may_be_called_world(tmp_path: Path) -> None:
    """A free base stands on the world, which has no link; a link of that name is one like any other."""
    urdf = (
        '<robot name="r"><link name="world"/><link name="bar"><inertial><mass value="1"/>'
        '<origin xyz="0.1 0 0"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>'
        '<joint name="turn" type="revolute"><parent link="world"/><child link="bar"/></joint></robot>'
    )
    robot = hybridyn.load(save(tmp_path, urdf, "r.urdf"))
    _, v, _ = moving_states(robot, 2)
    assert v.all()
    assert export(robot, tmp_path / "c", name="bar")


@pytest.mark.slow
def test_exported_functions_take_parameters(tmp_path: Path) -> None:
    """The C at another design, called through ctypes, gives the numbers of that robot."""
    robot, names = hybridyn.load("five_bar"), ["mass:m1_tool", "position:m1_left_elbow"]
    command = [
        "convert",
        "five_bar",
        "--c",
        "-o",
        str(tmp_path),
        "--name",
        "bar",
        "--parameters",
        ",".join(names),
    ]
    assert main([*command]) == 0
    header = (tmp_path / "bar.h").read_text()
    assert "0  mass of 'm1_tool' (0.4)" in header
    assert "bar_close(" in header
    printed = run_test(tmp_path, "bar")
    assert "idm 0: guard" in printed
    assert "close 0: guard" in printed
    assert compiler("-shared", "-fPIC", "-o", tmp_path / "bar.so", tmp_path / "bar.c", "-lm") == ""
    bar = ctypes.CDLL(str(tmp_path / "bar.so"))
    other = robot.with_parameters({names[0]: 0.7, names[1]: (0.27, 0.0, 0.0)})
    q, v, tau = moving_states(other, 3)
    a = hybridyn.ddm(other, q, v, tau)
    found, work, design = np.empty(2), np.empty(10_000), np.array([0.7, 0.27, 0.0, 0.0])
    wanted = hybridyn.idm(other, q, v, a)
    for t in range(3):
        assert called(bar.bar_idm, q[t], v[t], a[t], design, found, work) <= 1.0
        np.testing.assert_allclose(found, wanted[t], rtol=1e-11)
    states = tuple(np.empty(size) for size in (robot.nq, robot.nv, robot.nv))
    assert called(bar.bar_close, q[0], v[0], a[0], design, *states, work) <= 1.0
    close_to(states, (q[0], v[0], a[0]), 1e-9)
    last = hybridyn.assemble(other, motors=q[0, robot.motor_q] + 1e-3, guess=q[0])[0]

    def step(last: np.ndarray, position: Any, v: np.ndarray) -> bool:
        """Make a control step, and tell whether it may be trusted."""
        position = np.array(position)
        guard = called(bar.bar_idm_from_motors, last, position, v, a[0], design, *states, found, work)
        return guard <= 1.0

    assert step(last, q[0, robot.motor_q], v[0])
    close_to((*states, found), (q[0], v[0], a[0], wanted[0]), 1e-9)
    assert not step(q[0] * np.nan, q[0, robot.motor_q], v[0])
    assert not step(q[0], q[0, robot.motor_q], v[0] * np.inf)
    refused = 0
    for angles in itertools.product((-2.5, -1.5, 1.5, 2.5), repeat=2):  # some are out of reach
        trusted = step(q[0], angles, v[0])
        refused += not trusted
        assert not trusted or hybridyn.closure_residual(other, states[0][None]).max() <= 1e-12
    assert 0 < refused < 16


@pytest.mark.slow
def test_exported_springs_and_payloads_are_parameters(tmp_path: Path) -> None:
    joint, link = "m1_left_elbow", "m1_tool"
    robot = with_effects(hybridyn.load("five_bar"), [Payload(link, 0.5, (0.1, 0.0, 0.0))])
    names = [f"spring_rest:{joint}", f"payload_mass:{link}"]
    effects = ["default", Spring({joint: 3.0}, {joint: 0.2})]
    export(robot, tmp_path, effects, name="bar", parameters=names)
    header = (tmp_path / "bar.h").read_text()
    assert f"0  rest of '{joint}' (0.2)" in header
    assert f"1  payload's mass of '{link}' (0.5)" in header
    assert "close 4: guard" in run_test(tmp_path, "bar")
