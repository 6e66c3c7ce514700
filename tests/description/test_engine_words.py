"""What an engine gives a force, an inertia or a constraint is read, refused or noted in every format."""

import random
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hybridyn.description import Description, read
from hybridyn.description.names import drops
from hybridyn.description.urdf.engines import KNOWN
from hybridyn.errors import ModelError
from tests.description.engine_words import (
    IN_MJCF,
    IN_SDF,
    IN_URDF,
    IN_USD,
    MJCF,
    MJCF_PLACES,
    NO_FORCES,
    SDF,
    SDF_PLACES,
    URDF,
    URDF_PLACES,
    Row,
    usd,
)  # fmt: skip
from tests.support.extras import needs
from tests.support.files import save
from tests.support.samples import slow

Write = Callable[[str, str], str]

#: Fields of a description that no number of the model depends on.
ASIDE = ("notes", "line", "read_from", "source")


def numbers(record: Any) -> Any:
    """Return what the model depends on, comparable."""
    if isinstance(record, np.ndarray):
        return record.tobytes()
    if is_dataclass(record):
        return tuple(numbers(getattr(record, one.name)) for one in fields(record) if one.name not in ASIDE)
    if isinstance(record, Mapping):
        return tuple((name, numbers(value)) for name, value in record.items())
    return tuple(map(numbers, record)) if isinstance(record, list | tuple) else record


def outcome(plain: Description, path: Path, text: str) -> str:
    """Return what happens to what a file states beside a plain robot: read, refused, noted or silent."""
    try:
        found = read(save(path.parent, text, path.name))
    except ModelError:
        return "refused"
    if numbers(found) != numbers(plain):
        return "read"
    return "noted" if {*found.notes} - {*plain.notes} else "silent"


def placed(text: str, places: Mapping[str, tuple[str, str]]) -> Callable[[str, str], str]:
    """Return the function that writes a row into a robot."""

    def written(place: str, row: str) -> str:
        old, new = places[place]
        assert old in text
        return text.replace(old, new.replace("{}", row), 1)

    return written


XML = {
    "urdf": (URDF, placed(URDF, URDF_PLACES), IN_URDF),
    "sdf": (SDF, placed(SDF, SDF_PLACES), IN_SDF),
    "xml": (MJCF, placed(MJCF, MJCF_PLACES), IN_MJCF),
}


def silent(folder: Path, ending: str, plain: str, write: Write, rows: list[Row]) -> list[Row]:
    """Return the rows that a reader passes over."""
    base = read(save(folder, plain, f"plain.{ending}"))
    return [
        row for row in rows if outcome(base, folder / f"robot.{ending}", write(row[1], row[2])) == "silent"
    ]


@pytest.mark.parametrize("ending", XML)
def test_nothing_that_an_engine_knows_is_silent(ending: str, tmp_path: Path) -> None:
    if ending == "xml":
        needs("mjcf")
    plain, write, rows = XML[ending]
    assert silent(tmp_path, ending, plain, write, rows) == []


@pytest.mark.parametrize("rows", [random.Random(1).sample(IN_USD, 2), slow(IN_USD)])
def test_nothing_that_an_engine_of_usd_knows_is_silent(rows: list[Row], tmp_path: Path) -> None:
    needs("usd")
    assert silent(tmp_path, "usda", usd("", ""), usd, rows) == []


@pytest.mark.parametrize("place", [place for place in URDF_PLACES if place != "mujoco"])
def test_a_word_that_no_one_has_thought_of_is_noted(place: str, tmp_path: Path) -> None:
    write = placed(URDF, URDF_PLACES)
    base = read(save(tmp_path, URDF, "plain.urdf"))
    rows = (
        ['wobble="3"'] if place.endswith("=") else ['<wobble value="3"/>', "<wobble>3</wobble>", "<wobble/>"]
    )
    assert {outcome(base, tmp_path / "robot.urdf", write(place, row)) for row in rows} == {"noted"}


@pytest.mark.parametrize("place", KNOWN)
def test_no_word_is_listed_twice(place: str) -> None:
    words = KNOWN[place].split()
    assert len(words) == len({*words})


def test_what_says_that_nothing_changes_is_not_noted(tmp_path: Path) -> None:
    neutral = (
        (
            "gazebo link",
            "<turnGravityOff>false</turnGravityOff><gravity>1</gravity><kp>1e6</kp><mu1>0.9</mu1>",
        ),
        ("gazebo link", "<dampingFactor>0.0</dampingFactor><selfCollide>true</selfCollide>"),
        ("gazebo joint", "<provideFeedback>true</provideFeedback><springStiffness>0</springStiffness>"),
        ("gazebo", '<plugin filename="libgazebo_ros_control.so" name="c"/><static>false</static>'),
        ("gazebo", '<plugin filename="gz-sim-joint-position-controller-system" name="c"/>'),
        ("gazebo link", '<sensor name="s" type="imu"><plugin filename="x.so" name="x"/></sensor>'),
        ("joint", '<safety_controller k_velocity="3"/><calibration rising="0"/>'),
        ("dynamics=", 'rotor_inertia="0" coulomb_window="0.0"'),
    )
    base, write = read(save(tmp_path, URDF, "plain.urdf")), placed(URDF, URDF_PLACES)
    assert base.notes == ()
    for place, row in neutral:
        assert outcome(base, tmp_path / "robot.urdf", write(place, row)) == "silent", row


@pytest.mark.parametrize(("text", "place", "name"), [(URDF, "gazebo", "a.urdf"), (SDF, "model", "a.sdf")])
def test_plugins_of_which_no_force_comes_are_not_dropped(
    text: str, place: str, name: str, tmp_path: Path
) -> None:
    rows = "".join(f'<plugin filename="{one}" name="p{i}"/>' for i, one in enumerate(NO_FORCES))
    whole = placed(text, {**SDF_PLACES, **URDF_PLACES})(place, rows)
    assert drops(read(save(tmp_path, whole, name)).notes) == []


def test_a_note_names_file_line_and_owner(tmp_path: Path) -> None:
    path = save(
        tmp_path, placed(URDF, URDF_PLACES)("gazebo link", "\n<turnGravityOff>1</turnGravityOff>"), "a.urdf"
    )
    (note,) = drops(read(path).notes)
    line = path.read_text().splitlines().index("<turnGravityOff>1</turnGravityOff></gazebo></robot>") + 1
    assert note.startswith(f"{path}:{line}: drops <turnGravityOff> in <gazebo> of 'rocker';")
