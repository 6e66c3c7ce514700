"""model_toml.py: home, motors, rotors and friction from model.toml, found where the repository keeps it."""

import math
from pathlib import Path

import pytest

from hybridyn.description import read
from hybridyn.description.side_cars.toml_file import line_of
from tests.description.reading import Texts, holds, refused, save_all
from tests.robots.robot_texts import FOUR_BAR, LOOP, robot

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

FIXED = '<link name="x"/><joint name="x_joint" type="fixed"><parent link="rocker"/><child link="x"/></joint>'
FLOATING = '<link name="x"/><joint name="f" type="floating"><parent link="rocker"/><child link="x"/></joint>'


def beside(model: str | bytes, text: str = FOUR_BAR) -> Texts:
    """Return the files of the four-bar with a model file beside it."""
    return {"four_bar.urdf": text, "four_bar.model.toml": model}


UNIT = pytest.approx((math.sqrt(0.5),) * 2, rel=0, abs=1e-15)
DRIVE = "[home]\ndrive = {}"
FOUND = {
    "urdf/four_bar.urdf": FOUR_BAR,
    "models/four_bar/model.toml": DRIVE.format(1),
    "urdf/four_bar.model.toml": DRIVE.format(2),
}
EFFECTS = """
[effects.spring]
stiffness = { elbow = 40.0 }
[effects.coulomb_friction]
width = 0.02
"""
GEAR = "[couplings.gear]\nterms = { drive = 2.0, elbow = -1.0 }\noffset = 0.5"
#: `elbow` follows `drive`, and `swing` follows `elbow`.
FOLLOWERS = FOUR_BAR.replace(
    'name="elbow" type="continuous">',
    'name="elbow" type="continuous"><mimic joint="drive" multiplier="-2" offset="0.3"/>',
).replace(
    'name="swing" type="continuous">',
    'name="swing" type="continuous"><mimic joint="elbow" multiplier="-0.5"/>',
)
#: The files of a robot, and what is read.
READ: dict[str, tuple[Texts, dict[str, object]]] = {
    "everything that it may say": (beside(MODEL), {
        "home": {"drive": (0.5,), "elbow": (0.6, 0.8)}, "motors": ("drive",), "motors_from": "model.toml",
        "joints": {"drive": {"rotor_inertia": 3e-5, "gear_ratio": 100, "damping": 0.1},
                   "elbow": {"damping": 0.25, "friction": 0.5}},
    }),
    "no model file": (FOUR_BAR, {"home": {}}),
    "where the repository keeps it": (dict([*FOUND.items()][:2]), {"home": {"drive": (1.0,)}}),
    "beside the robot": (FOUND, {"home": {"drive": (2.0,)}}),
    "beside a xacro file": (
        {"urdf/four_bar.urdf.xacro": FOUR_BAR} | FOUND, {"home": {"drive": (2.0,)}},
    ),
    "a continuous joint is brought to length one": (
        beside("[home]\nelbow = [0.70711, 0.70711]"), {"home": {"elbow": UNIT}},
    ),
    "a quaternion is brought to length one": (
        beside("[home]\nf = [1, 2, 3, 0, 0, 0.70711, 0.70711]", robot(FLOATING)),
        {"home": {"f": pytest.approx((1, 2, 3, 0, 0, *[math.sqrt(0.5)] * 2), rel=0, abs=1e-15)}},
    ),
    "effects": (beside(EFFECTS), {
        "effects": (("coulomb_friction", {"width": 0.02}), ("spring", {"stiffness": {"elbow": 40.0}})),
    }),
    **{
        f"followers, {name}": (
            beside(model, FOLLOWERS),
            {"home": {joint: pytest.approx((x,)) for joint, x in home.items()}},
        )
        for name, model, home in (
            ("home unstated", "", {"elbow": 0.3, "swing": -0.15}),
            ("their leader stated", DRIVE.format(0.5), {"drive": 0.5, "elbow": -0.7, "swing": 0.35}),
            ("stated", "[home]\nelbow = 0.1", {"elbow": 0.1, "swing": -0.05}),
        )
    },
    "a coupling": (beside(GEAR), {"couplings": [
        {"name": "gear", "terms": (("drive", 2.0), ("elbow", -1.0)), "offset": 0.5, "line": 1},
    ]}),
}  # fmt: skip


@pytest.mark.parametrize("name", READ)
def test_what_is_read(name: str, tmp_path: Path) -> None:
    texts, expected = READ[name]
    holds(read(save_all(tmp_path, texts)), expected)


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
    error = refused(save_all(tmp_path, beside(MODEL.replace(old, new))), message)
    assert (error.line, error.file) == (line, str(tmp_path / "four_bar.model.toml"))


@pytest.mark.parametrize(
    ("text", "keys", "line"),
    [
        (MODEL, ("motors",), 1),
        (MODEL, ("home", "elbow", "1"), 5),
        (MODEL, ("joints", "drive", "gear_ratio"), 9),
        (MODEL, ("joints", "elbow", "friction"), 12),
        ('["a b"]\n"c d".e = 1', ("a b", "c d", "e"), 2),
        (MODEL, ("nothing",), None),
    ],
)
def test_lines_of_keys(text: str, keys: tuple[str, ...], line: int | None) -> None:
    assert line_of(text, keys) == line


COUPLING = "[couplings.gear]\nterms = {{ {} }}"


@pytest.mark.parametrize(
    ("text", "line", "messages"),
    [
        ("[effects.sprig]\nstiffness = { elbow = 1 }", 1, ["unknown key 'sprig' (did you mean 'spring'?)"]),
        ("[effects.spring]\nstifness = { elbow = 1 }", 2, ["'stifness' (did you mean 'stiffness'?)"]),
        ("[effects.spring]\nstiffness = { elbo = 1.0 }", 2, ["'elbo' (did you mean 'elbow'?)"]),
        ("[effects.damper]\ncoefficient = { elbow = -1.0 }", 2, ["greater than or equal to 0"]),
        ("[effects.ground_contact]\nstiffness = 1.0\npoints = { rockr = [[0, 0, 0]] }", 3, ["no such link"]),
        ("[effects.wrench]\nlink = 'rocker'", 1, ["unknown key 'wrench'"]),
        ("[effects.payload]\nmass = 1.0", None, ["'link' is missing"]),
        ("[[effects.payload]]\nmass = 1.0", 1, ["keys with values, not a list of tables (write one, [...]"]),
        ("[effects]\npayload = 1.0", 2, ["keys with values, not a number"]),
        ("[effects]\npayload = 'rocker'", 2, ["keys with values, not a text"]),
        ("[effects.payload]\nmass = 1.0\nlink = 'rockr'", 3, ["no such link 'rockr'"]),
        (COUPLING.format("drve = 1.0"), None, ["'drve' is no movable joint ", "did you mean 'drive'"]),
        (COUPLING.format("drive = 0.0"), None, ["with a coeff"]),
        (COUPLING.format(""), None, ["terms"]),
        *((text, None, [""]) for text in (b"\xff", b"a = " + b"[" * 5000, b"a = " + b"9" * 5000, b"\0")),
        ("[home]\nx_joint = 0", None, ["the joint is fixed"]),
    ],
)  # fmt: skip
def test_what_names_no_part_of_the_robot_is_refused(
    tmp_path: Path, text: str | bytes, line: int | None, messages: list[str]
) -> None:
    error = refused(save_all(tmp_path, beside(text, robot(LOOP, FIXED))), *messages)
    assert line is None or error.line == line
