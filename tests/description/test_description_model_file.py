"""model_toml.py: home, motors, rotors and friction from model.toml, found where the repository keeps it."""

import math
from pathlib import Path

import pytest

from hybridyn.description import Description, read
from hybridyn.description.side_cars.toml_file import line_of
from tests.description.reading import refused
from tests.robot_texts import FOUR_BAR, robot, save

MODEL = """motors = ["drive"]

[home]
drive = 0.5
elbow = [0.6, 0.8]

[joints.drive]
rotor_inertia = 3e-5
gear_ratio = 100

[joints]
elbow = { damping = 0.25, friction = 0.5 }
"""

FLOATING = '<link name="x"/><joint name="f" type="floating"><parent link="rocker"/><child link="x"/></joint>'


def beside(folder: Path, model: str | bytes, text: str = FOUR_BAR) -> Path:
    """Write the four-bar with a model file beside it; gives the robot's file."""
    save(folder, model, "four_bar.model.toml")
    return save(folder, text)


def load(folder: Path, model: str, text: str = FOUR_BAR) -> Description:
    return read(beside(folder, model, text))


def test_everything_that_it_may_say(tmp_path: Path) -> None:
    description = load(tmp_path, MODEL)
    drive, elbow, _ = description.joints
    assert description.home == {"drive": (0.5,), "elbow": (0.6, 0.8)}
    assert (drive.rotor_inertia, drive.gear_ratio, drive.damping) == (3e-5, 100, 0.1)
    assert (elbow.damping, elbow.friction) == (0.25, 0.5)
    assert (description.motors, description.motors_from) == (("drive",), "model.toml")


def test_it_is_found_where_the_repository_keeps_it(tmp_path: Path) -> None:
    path = save(tmp_path, FOUR_BAR, "urdf/four_bar.urdf")
    assert read(path).home == {}
    save(tmp_path, "[home]\ndrive = 1", "models/four_bar/model.toml")
    assert read(path).home == {"drive": (1.0,)}
    save(tmp_path, "[home]\ndrive = 2", "urdf/four_bar.model.toml")
    assert read(path).home == {"drive": (2.0,)}
    xacro = save(tmp_path, FOUR_BAR, "urdf/four_bar.urdf.xacro")
    assert read(xacro).home == {"drive": (2.0,)}


def test_unit_parts_are_brought_to_length_one(tmp_path: Path) -> None:
    home = load(tmp_path, "[home]\nelbow = [0.70711, 0.70711]").home["elbow"]
    assert math.hypot(*home) == pytest.approx(1, abs=1e-15)
    free = load(tmp_path, "[home]\nf = [1, 2, 3, 0, 0, 0.70711, 0.70711]", robot(FLOATING)).home["f"]
    assert free[:3] == (1, 2, 3)
    assert math.hypot(*free[3:]) == pytest.approx(1, abs=1e-15)


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ("drive = 0.5", "drv = 0.5", 4, "did you mean 'drive'"),
        ("drive = 0.5", "drive = nan", 4, "finite number"),
        ("drive = 0.5", "drive = inf", 4, "finite number"),
        ("drive = 0.5", "drive = true", 4, "valid number"),
        ("drive = 0.5", 'drive = "0.5"', 4, "valid number"),
        ("drive = 0.5", "drive = [0.5, 1]", 4, "2 numbers for a revolute joint, which has 1"),
        ("[0.6, 0.8]", "[0.6, 0.9]", 5, "have length 1.0"),
        ("[0.6, 0.8]", "[]", 5, "0 numbers for a continuous joint, which has 1 or 2"),
        ("rotor_inertia", "rotor_inerta", 8, "did you mean 'rotor_inertia'"),
        ("3e-5", "-3e-5", 8, "greater than or equal to 0"),
        ("100", "0", 7, "moves nothing"),
        ("friction = 0.5", "friction = -0.5", 12, "greater than or equal to 0"),
        ("[joints.drive]", "[joints.drve]", 7, "did you mean 'drive'"),
        ("[home]", "[hom]", 3, "did you mean 'home'"),
        ('["drive"]', '["driv"]', 1, "did you mean 'drive'"),
        ('["drive"]', '"drive"', 1, "valid list"),
        ("drive = 0.5", "drive = ", 4, "not readable as TOML"),
        ("drive = 0.5", "drive = 1\ndrive = 2", 5, "not readable as TOML"),
        ("[joints]", "[effects]\na = 1\n[joints]", 12, "unknown key 'a'"),
    ],
)
def test_mistakes_name_file_and_line(tmp_path: Path, old: str, new: str, line: int, message: str) -> None:
    error = refused(beside(tmp_path, MODEL.replace(old, new)), message)
    assert (error.line, error.file) == (line, str(tmp_path / "four_bar.model.toml"))


@pytest.mark.parametrize("model", [b"\xff", b"a = " + b"[" * 5000, b"a = " + b"9" * 5000, b"\0"])
def test_texts_that_are_no_toml(tmp_path: Path, model: bytes) -> None:
    refused(beside(tmp_path, model), "")


def test_fixed_joints_have_no_position(tmp_path: Path) -> None:
    fixed = '<link name="x"/><joint name="f" type="fixed"><parent link="rocker"/><child link="x"/></joint>'
    refused(beside(tmp_path, "[home]\nf = 0", robot(fixed)), "the joint is fixed")


def test_lines_of_keys() -> None:
    assert line_of(MODEL, ("motors",)) == 1
    assert line_of(MODEL, ("home", "elbow", "1")) == 5
    assert line_of(MODEL, ("joints", "drive", "gear_ratio")) == 9
    assert line_of(MODEL, ("joints", "elbow", "friction")) == 12
    assert line_of('["a b"]\n"c d".e = 1', ("a b", "c d", "e")) == 2
    assert line_of(MODEL, ("nothing",)) is None


EFFECTS = """
[effects.spring]
stiffness = { elbow = 40.0 }
[effects.coulomb_friction]
width = 0.02
"""


def test_effects_of_the_robot(tmp_path: Path) -> None:
    description = load(tmp_path, EFFECTS)
    assert description.effects == (
        ("coulomb_friction", {"width": 0.02}),
        ("spring", {"stiffness": {"elbow": 40.0}}),
    )


def test_a_coupling(tmp_path: Path) -> None:
    text = "[couplings.gear]\nterms = { drive = 2.0, elbow = -1.0 }\noffset = 0.5"
    (coupling,) = load(tmp_path, text).couplings
    assert (coupling.name, coupling.terms, coupling.offset) == (
        "gear",
        (("drive", 2.0), ("elbow", -1.0)),
        0.5,
    )
    assert coupling.line == 1


COUPLING = "[couplings.gear]\nterms = {{ {} }}"


@pytest.mark.parametrize(
    ("text", "line", "messages"),
    [
        ("[effects.sprig]\nstiffness = { elbow = 1 }", 1, ["unknown key 'sprig' (did you mean 'spring'?)"]),
        ("[effects.spring]\nstifness = { elbow = 1 }", 2, ["'stifness' (did you mean 'stiffness'?)"]),
        ("[effects.spring]\nstiffness = { elbo = 1.0 }", 2, ["'elbo' (did you mean 'elbow'?)"]),
        ("[effects.damper]\ncoefficient = { elbow = -1.0 }", 2, ["greater than or equal to 0"]),
        ("[effects.ground_contact]\nstiffness = 1.0\npoints = { rockr = [[0, 0, 0]] }", 3, ["no such link"]),
        ("[effects.payload]\nmass = 1.0", 1, ["unknown key 'payload'"]),
        (COUPLING.format("drve = 1.0"), None, ["'drve' is no movable joint ", "did you mean 'drive'"]),
        (COUPLING.format("drive = 0.0"), None, ["with a coeff"]),
        (COUPLING.format(""), None, ["terms"]),
    ],
)  # fmt: skip
def test_wrong_effects_and_couplings_name_their_line(
    tmp_path: Path, text: str, line: int | None, messages: list[str]
) -> None:
    error = refused(beside(tmp_path, text), *messages)
    assert line is None or error.line == line
