"""Messages that name the file, the form or the package they speak of."""

import pickle
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.errors import (
    AT_SAMPLE,
    HybridynError,
    ModelError,
    SingularityError,
    TrajectoryError,
    install_advice,
)
from hybridyn.streams.efforts import samples_counted_from
from tests.command_line import call
from tests.comparing import refused
from tests.extras import needs
from tests.robot_texts import FOUR_BAR, read_text

NO_ROOM = """
import resource, sys
import hybridyn
from hybridyn.cli import main
hybridyn.load("five_bar")
resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.parametrize(
    ("command", "file"),
    [
        ("idm", "efforts.csv"), ("idm", "efforts.parquet"), ("idm", "share.svg"),
        pytest.param("convert", "five_bar.h", marks=pytest.mark.slow),
        pytest.param("cost", "points.csv", marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_a_disk_without_room_names_the_file(command: str, file: str, tmp_path: Path) -> None:
    """Files of 2,000 bytes at most stand for a full disk.

    -B and the load before the limit: truncated bytecode of the package would break later imports.
    """
    if file.endswith("parquet"):
        needs("io")
    option = "--plot" if file.endswith("svg") else "-o"
    target = "." if command == "convert" else file
    own = {"convert": ["--c"], "--plot": ["--by-effect"]}
    own_words = own.get(command, own.get(option, []))
    words = [sys.executable, "-B", "-c", NO_ROOM, command, "five_bar", *own_words, option, target]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 1
    (line,) = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
    assert file in line
    assert "File too large" in line
    assert "bug" not in line
    assert [*tmp_path.iterdir()] == []


def test_a_full_device_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    said = call(capsys, "idm", "five_bar", "-o", "/dev/full", "-q", status=1)
    assert said.err == "error: /dev/full: No space left on device\n"


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (
            '<sdf version="1.7"><model name="a"><link name="b"></model></sdf>',
            "this is SDF (Gazebo)",
        ),
        ('<!-- <robot> --><mujoco model="a"><worldbody></mujoco>', "this is MJCF (MuJoCo)"),
        (FOUR_BAR.replace("</robot>", ""), ""),
    ],
)
def test_text_that_is_no_xml_still_says_what_it_is(text: str, told: str, tmp_path: Path) -> None:
    caught = refused(lambda: read_text(tmp_path, text), ModelError, "not well-formed XML")
    assert told in str(caught)
    assert told or ";" not in str(caught)  # of URDF there is nothing more to say


def test_the_extra_that_installs_a_package_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("hybridyn.description.urdf.xacro.share_dirs", list)
    refused(lambda: hybridyn.load("stewart_ur5"), ModelError, f", or {re.escape(install_advice('robots'))}")
    call(capsys, "info", "stewart_ur5", status=1, says="name the folder that holds it with --package-dir, or")


@pytest.mark.parametrize("wrong", ["fast", 10**400], ids=["a word", "too large"])
def test_what_is_no_number_is_named(wrong: Any) -> None:
    robot = hybridyn.load("five_bar")
    motor, link = robot.motors[0], "m1_tool"
    v = np.zeros(robot.nv)
    calls: dict[str, Callable[[], object]] = {
        "q is": lambda: hybridyn.idm(robot, np.array([wrong] * robot.nq, dtype=object), v, v),
        "time is": lambda: hybridyn.idm(robot, robot.home, v, v, time=wrong),
        f"wrench on '{link}' is": lambda: hybridyn.idm(
            robot, robot.home, v, v, wrenches={link: np.array([wrong] * 6)}
        ),
        f"joint '{motor}' is": lambda: hybridyn.assemble(robot, motors={motor: (0.0, wrong)}),
        f"the pose of '{link}' is": lambda: hybridyn.assemble(robot, platforms={link: ([wrong] * 7,)}),
        f"coordinate 'x' of '{link}' is": lambda: hybridyn.assemble(robot, platforms={link: {"x": wrong}}),
        "guess is": lambda: hybridyn.assemble(robot, guess=np.array([wrong] * robot.nq)),
    }
    for name, run in calls.items():
        refused(run, TrajectoryError, f"{name} not an array of numbers")
    refused(
        lambda: hybridyn.assemble(robot, platforms={link: {"x": np.zeros((2, 2))}}),
        TrajectoryError,
        f"coordinate 'x' of '{link}' needs finite numbers of shape",
    )


def test_the_sentence_of_an_error_is_composed_of_its_data() -> None:
    def says(error: HybridynError) -> str:
        return str(pickle.loads(pickle.dumps(error)))  # as a pool of processes hands it on

    error = SingularityError(f"module 'a{{b}}': its legs lose rank{AT_SAMPLE} (limit 1)", sample=3)
    assert says(error) == "module 'a{b}': its legs lose rank at sample 3 (limit 1)"
    with pytest.raises(SingularityError) as caught, samples_counted_from(100):
        raise error
    assert caught.value.sample == 103
    assert says(error) == "module 'a{b}': its legs lose rank at sample 103 (limit 1)"
    error.advice += ", or more"
    error.within("t.csv, row 104", row_named=True)
    error.within("scene.toml:7")
    assert error.message == "module 'a{b}': its legs lose rank (limit 1), or more"
    assert says(error) == f"scene.toml:7: t.csv, row 104: {error.message}"
