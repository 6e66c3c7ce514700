"""Formats of other packages: read, written, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.conversion.convert import WRITERS
from hybridyn.description.added_formats import ENDINGS
from hybridyn.errors import ModelError
from tests.extending.packages import install
from tests.support.command_line import call
from tests.support.comparing import refused
from tests.support.files import save

ARM = "upper 0.0 2.0 0.3\nlower 0.5 1.0 0.2\n"


def test_a_file_is_read_and_written(
    workshop: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The torque of a double pendulum's weight by hand; what is written is read as the same."""
    file = save(tmp_path, ARM, "arm.chain")
    save(tmp_path, "[joints.lower_hinge]\ndamping = 0.4\n", "arm.chain.model.toml")
    robot = hybridyn.load(file)
    first, second = 0.2, 0.5
    lower = 9.81 * 0.2 * np.sin(first + second)
    wanted = [9.81 * (2.0 * 0.3 + 0.5) * np.sin(first) + lower, lower]
    np.testing.assert_allclose(hybridyn.gravity(robot, np.array([first, second])), wanted, rtol=1e-14)
    assert robot.records["lower_hinge"].damping == 0.4
    call(capsys, "convert", file, "-o", tmp_path / "again.chain")
    assert save(tmp_path, ARM, "r").read_text() in (tmp_path / "again.chain").read_text()
    call(capsys, "convert", file, "-o", tmp_path / "again.chain")  # its own file is replaced
    assert call(capsys, "info", tmp_path / "again.chain", "--fail-on", "error")
    call(capsys, "convert", "five_bar", "-o", tmp_path / "x.chan", status=1, says="known: .urdf")
    call(capsys, "convert", file, "-o", file, status=1, says="is the robot's own file")


def test_own_endings_ask_no_package(tmp_path: Path) -> None:
    assert {ending.removeprefix(".") for ending in WRITERS} <= {*ENDINGS}


def test_a_file_takes_no_arguments_and_has_one_model(workshop: Path, tmp_path: Path) -> None:
    file = save(tmp_path, ARM, "arm.chain")
    refused(
        lambda: hybridyn.load(file, xacro_args={"a": 1}), ModelError, r"arm.chain: is not a xacro.*\('a'\)"
    )
    refused(lambda: hybridyn.load(f"{file}#b"), ModelError, "arm.chain: only an SDF.*remove '#b'")


ODD = """
from hybridyn.description import RobotFormat
ODD = RobotFormat(lambda content, file: READ)
"""
MISTAKES = {
    "another class": ("odd", "odd:RobotFormat", "0", "make it a hybridyn.description.RobotFormat"),
    "fails": ("odd", "odd:ODD", "1 / 0", "r.odd: the robot format 'odd' of the package 'odd' fails: ZeroDi"),
    "no robot": ("odd", "odd:ODD", "None", "returns NoneType in place of a RobotFile"),
    "own": ("urdf", "odd:ODD", "0", "'urdf' of the package 'odd' has a name of hybridyn's own"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_format_that_cannot_be_used_is_one_sentence(name: str, packages: Path, tmp_path: Path) -> None:
    ending, value, result, words = MISTAKES[name]
    install(packages, "odd", {"formats": {ending: value}}, {"odd.py": ODD.replace("READ", result)})
    refused(lambda: hybridyn.load(save(tmp_path, ARM, "r.odd")), ModelError, words)


def test_a_format_without_writer_is_refused(packages: Path, tmp_path: Path) -> None:
    install(packages, "odd", {"formats": {"odd": "odd:ODD"}}, {"odd.py": ODD.replace("READ", "0")})
    refused(
        lambda: hybridyn.convert("five_bar", tmp_path / "r.odd"), ModelError, "no writer: it is only read"
    )
