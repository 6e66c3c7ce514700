"""Each number of a table is refused below its bound, and where it is none or misspelt.

The rows of all formats go through one engine, so the tables are the cases.
"""

import math
from pathlib import Path

import pytest

from hybridyn.description import read
from hybridyn.description.rows import Row, every_in, numbers_in, stated_in
from hybridyn.description.sdf import elements
from hybridyn.description.urdf.loops import DYNAMICS
from hybridyn.description.urdf.urdf import LIMIT
from hybridyn.description.usd import schema
from hybridyn.errors import ModelError
from tests.conversion.judge import needs_reader
from tests.description.sdf_texts import link, sdf
from tests.description.usd_texts import DRIVE, at, body, joint, usda
from tests.support.comparing import refused
from tests.support.files import save


class Stated(dict[str, float]):
    """An element with numbers by name."""

    def stated(self, name: str, infinite: bool) -> float | None:
        """Return a number; only some are infinite."""
        value = self.get(name)
        if value is not None and math.isinf(value) and not infinite:
            raise self.error(f"{name} is infinite")
        return value

    def error(self, message: str) -> ModelError:
        """Return an error that says where the element is."""
        return ModelError(message, file="f", line=3)


ROWS = {
    "mass": Row(1.0, least=0.0),
    "angle": Row(names={"angle": "degree", "angle_rad": ""}),
    "limit": Row(math.inf, endless=1e16),
}


def test_defaults_units_names_and_limits() -> None:
    assert numbers_in(ROWS, None) == {"mass": 1.0, "angle": 0.0, "limit": math.inf}
    in_degrees = every_in(ROWS, Stated(angle=3.0, limit=-2e16), {"degree": 0.5})
    assert [*in_degrees] == [("angle", "angle", 1.5), ("limit", "limit", -math.inf)]
    assert stated_in(ROWS, Stated(angle_rad=3.0)) == {"angle": 3.0}
    assert stated_in(ROWS, Stated(limit=math.inf)) == {"limit": math.inf}
    refused(lambda: stated_in(ROWS, Stated(mass=math.inf)), ModelError, "mass is infinite")
    refused(lambda: stated_in(ROWS, Stated(mass=-2.0), " of it"), ModelError, "f:3: negative mass -2 of it")


def test_what_two_names_state_is_told() -> None:
    both, told = {"angle": 3.0, "angle_rad": 2.0}, list[str]()
    assert stated_in(ROWS, Stated(both), " of it", told.append) == {"angle": 3.0}
    assert told == ["angle_rad 2 of it, which is 3 by another name"]
    assert stated_in(ROWS, Stated(both, angle_rad=3.0), "", told.append) == {"angle": 3.0}
    assert len(told) == 1


ARM = (
    '<robot name="r"><link name="a"/><link name="b"><inertial><mass value="2"/></inertial></link>'
    '<joint name="j" type="revolute"><parent link="a"/><child link="b"/><limit{}/><dynamics{}/></joint>'
    "</robot>"
)


def urdf_text(element: str, name: str, value: str) -> str:
    """Return a URDF whose joint states a number."""
    stated = f' {name}="{value}"'
    return ARM.format(*((stated, "") if element == "limit" else ("", stated)))


def sdf_text(element: str, name: str, value: str) -> str:
    """Return an SDF with a number in an element of a joint or link."""
    stated = f"<{name}>{value}</{name}>"
    wrapped = f"<{element}>{stated}</{element}>"
    own = {"inertial": wrapped, "inertia": f"<inertial>{wrapped}</inertial>", "velocity_decay": wrapped}
    in_axis = stated if element == "axis" else wrapped * (element in ("limit", "dynamics"))
    in_joint = stated if element == "joint" else ""
    bodies = link("a"), f'<link name="b">{own.get(element, "")}</link>'
    ends = "<parent>a</parent><child>b</child>"
    axis = f"<axis><xyz>0 0 1</xyz>{in_axis}</axis>"
    return sdf(*bodies, f'<joint name="j" type="revolute">{ends}{axis}{in_joint}</joint>')


def usd_text(_: str, name: str, value: str) -> str:
    """Return a stage whose joint states a number."""
    own = f"custom float {name} = {value}"
    schemas = (DRIVE, "PhysxJointAPI", "PhysxJointAxisAPI:angular")
    hinge = joint(
        "Revolute", "j", "", "a", 'token physics:axis = "Y"', at(0, "0, 0, 0"), own, schemas=schemas
    )
    return usda(body("a"), hinge, root="PhysicsArticulationRootAPI")


#: Ending, writer, and rows by element.
TABLES = {
    "urdf": (".urdf", urdf_text, {"dynamics": DYNAMICS, "limit": LIMIT}),
    "sdf": (".sdf", sdf_text, {tag: rows for tag, rows in elements.NUMBERS.items() if tag != "mimic"}),
    "usd": (".usda", usd_text, {"": {word: row.about("angular") for word, row in schema.NUMBERS.items()}}),
}
CASES = [
    (form, tag, name, row)
    for form, (_, _, tables) in TABLES.items()
    for tag, rows in tables.items()
    for word, row in rows.items()
    for name in (row.names or (word,))
]


def saved(folder: Path, form: str, tag: str, name: str, value: str) -> Path:
    ending, text, _ = TABLES[form]
    needs_reader(folder / f"r{ending}")
    return save(folder, text(tag, name, value), f"r{ending}")


@pytest.mark.parametrize(("form", "tag", "name", "row"), [case for case in CASES if case[3].least == 0.0])
def test_numbers_below_their_bound_are_refused(
    form: str, tag: str, name: str, row: Row, tmp_path: Path
) -> None:
    error = refused(lambda: read(saved(tmp_path, form, tag, name, "-2")), ModelError, f"negative {name} -2")
    assert error.file
    assert error.line or form == "usd", "OpenUSD knows no lines"


@pytest.mark.parametrize(("form", "tag", "name", "row"), CASES)
def test_numbers_that_are_none_are_refused(form: str, tag: str, name: str, row: Row, tmp_path: Path) -> None:
    refused(lambda: read(saved(tmp_path, form, tag, name, "nan")), ModelError, name.rpartition(":")[2])
    if not row.endless:
        refused(lambda: read(saved(tmp_path, form, tag, name, "inf")), ModelError, name.rpartition(":")[2])


@pytest.mark.parametrize(("form", "tag", "name", "row"), [case for case in CASES if case[0] != "usd"])
def test_misspelt_numbers_are_refused(form: str, tag: str, name: str, row: Row, tmp_path: Path) -> None:
    wrong = name + name[-1]
    refused(lambda: read(saved(tmp_path, form, tag, wrong, "2")), ModelError, f"did you mean .*{name}")
