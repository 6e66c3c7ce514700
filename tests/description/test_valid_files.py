"""Every small file that a format allows is read, or refused for one of few reasons, and no part is lost.

Files are drawn from grammars (`valid_files`). A part that is taken out changes the robot, is told of in a
note, is needed, or is of those that every reader passes over (`HARMLESS`). Trees are built, too.
"""

import dataclasses
import random
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.description import Description, read
from hybridyn.description.notes import place_of
from tests.conversion.judge import needs_reader
from tests.description.grammar import Element, Place, places, without
from tests.description.reading import finite
from tests.description.valid_files import FORMATS, Format
from tests.support import waiting
from tests.support.files import save
from tests.support.samples import slow

pytestmark = pytest.mark.filterwarnings("ignore")

#: Files of each seed, and the parts that are taken out of each.
FILES, PARTS = 25, 4

#: Parts that say nothing of the motion, or nothing where they stand: `Place.name` by format.
HARMLESS = {
    "urdf": r"""
        link\S*/visual link\S*/collision link\S*@type robot/material robot/sensor robot@version
        joint\S*/(calibration|safety_controller) joint\S*/hardwareInterface actuator/hardwareInterface
        transmission/type transmission/actuator gazebo/(provideFeedback|implicitSpringDamper)
        gazebo@reference robot/gazebo robot/ros2_control ros2_control\S*[@/](hardware|type|joint)
        loop(_joint)?\[(spherical|point|fixed)\]/axis joint\[(planar|fixed|floating)\]/(axis|dynamics|limit)
        axis@xyz gazebo/springReference
    """,
    "sdf": r"""
        link/(visual|collision) joint\S*/(sensor|physics) world/(light|physics) model/(plugin|self_collide)
        model/(allow_auto_disable|frame) joint\[fixed\]/pose joint\[ball\]/axis
    """,
    "mjcf": r"""
        mujoco/(visual|statistic|custom|sensor|contact) body/(camera|light|site)
        joint\[(hinge|slide)\]@(type|margin|solreflimit|springref|actuatorfrcrange) geom\S*@(rgba|friction)
        compiler@(angle|balanceinertia) option@(integrator|timestep|wind) geom\S*@(density|type)
        weld@torquescale (position|velocity)@(k.|ctrlrange|forcerange) motor@(gear|ctrlrange|forcerange|name)
        mujoco/(option|compiler)
    """,
    "usd": r"""
        Xform/Cube \S*@physics:collisionEnabled \S*@drive:angular:physics:targetPosition
        Xform@xformOp:translate \S*@mjc:frictionloss
    """,
    "model.toml": "",
    "robot.yaml": "",
}
#: Reasons for which a valid file may be refused: what is not read yet, and what means nothing.
REFUSED = {
    "urdf": (
        "in a form that is not read", "only joints with one freedom can be coupled",
        "there is no movable joint between",
    ),
    "sdf": ("is not read",),
    "mjcf": ("is not read", "state the same for all joints that carry it"),
    "usd": (),
    "model.toml": ("has no coordinate", "does not", "no freedom", "stays within"),
    "robot.yaml": (),
}  # fmt: skip


def plain(value: Any) -> Any:
    """Return a record as parts that can be compared, without lines and files."""
    if dataclasses.is_dataclass(value):
        fields = (field.name for field in dataclasses.fields(value))
        return [plain(getattr(value, name)) for name in fields if name not in ("line", "read_from", "source")]
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, dict):
        return [*map(plain, value.items())]
    if isinstance(value, tuple | list):
        return [*map(plain, value)]
    return re.sub(r":\d+|line \d+", "", value) if isinstance(value, str) else value


def told(place: Place, description: Description) -> bool:
    """Return whether a note tells of a part: it has a word of it, and the name of what the part is about."""
    inner = place.part if isinstance(place.part, Element) else Element(place.part, {})
    parts = [part for one in inner.below() for part in (one.tag, *one.attributes) if part != "name"]
    spelt = (re.sub("[A-Z]", lambda letter: f" {letter[0].lower()}", part) for part in parts)
    words = [*parts, *(word.rpartition(":")[2].split()[-1] for word in spelt), place.owner.tag, "left out"]
    notes = [place_of(note)[2] for note in description.notes]
    return any(place.about in note and any(word.rstrip("s") in note for word in words) for note in notes)


def saved(folder: Path, form: Format, root: Element) -> Path:
    """Write a drawn file; return the path of the robot."""
    file = save(folder, form.text(root), f"r{form.ending}")
    return save(folder, form.beside, "r.urdf") if form.beside else file


def check(name: str, seed: int, folder: Path, opened: Callable[[Path], Description]) -> bool:
    """Check a drawn file and some parts of it; return whether it is read."""
    form, draw, harmless = FORMATS[name], random.Random(f"{name} {seed}"), HARMLESS[name].split()
    root = form.drawn(draw)
    text = form.text(root)
    path = saved(folder, form, root)
    found, reason = waiting.outcome(f"{name} {seed}:\n{text}", lambda: opened(path))
    if found is None:
        assert any(words in reason for words in REFUSED[name]), (seed, text, reason)
        return False
    finite(found, text)
    assert all(place_of(note)[0] for note in found.notes), found.notes
    parts = [*places(root, lambda part: any(re.fullmatch(words, part) for words in harmless))]
    for place in draw.sample(parts, min(PARTS, len(parts))):
        with without(place):
            path = saved(folder, form, root)
            other, _ = waiting.outcome(f"{name} {seed} without {place.name}", lambda: opened(path))  # noqa: B023
        changed = other is None or plain(other) != plain(found)
        assert changed or told(place, found), (seed, place.name, place.about, found.notes, text)
    return True


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("seed", [0, *(slow(seed) for seed in range(1, 30))])
def test_files_are_read_and_no_part_is_lost(name: str, seed: int, tmp_path: Path) -> None:
    needs_reader(tmp_path / f"r{FORMATS[name].ending}")
    read_files = sum(check(name, seed * FILES + number, tmp_path, read) for number in range(FILES))
    assert read_files > FILES / 4


@pytest.mark.parametrize("name", ["urdf", "sdf", "mjcf", "usd"])
@pytest.mark.parametrize("seed", [0, *(slow(seed) for seed in range(1, 20))])
def test_files_that_are_read_are_built(name: str, seed: int, tmp_path: Path) -> None:
    form = FORMATS[name]
    needs_reader(tmp_path / f"r{form.ending}")
    for number in range(10):
        root = form.drawn(random.Random(f"{name} {seed} {number}"))
        path = saved(tmp_path, form, root)
        robot, reason = waiting.outcome(form.text(root), lambda: hybridyn.load(path))  # noqa: B023
        assert robot is not None or reason
        if robot is not None and not robot.description.closures:
            assert robot.mobility >= 0
