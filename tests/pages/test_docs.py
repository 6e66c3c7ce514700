"""The documentation: its Python runs, its robots load, what it names exists and what it lists is complete."""

import re
import tomllib
from collections import Counter
from dataclasses import fields
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from docs.extensions import tolerances
from hybridyn import extensions
from hybridyn.description import Description
from hybridyn.description.side_cars.tables import EFFECTS
from hybridyn.scenes import scene_file as scenes
from hybridyn.scenes.controller_tables import CONTROLLERS, PointTable, ReferenceTable
from hybridyn.scenes.stage import play, stage
from hybridyn.studies.cost.points import CostPoint
from hybridyn.studies.sweep.evaluation import STATUSES
from hybridyn.studies.sweep.measures import OF_MOTORS, OF_WORKSPACE, STATISTICS
from hybridyn.studies.sweep.reading import FIXED_COLUMNS
from hybridyn.studies.sweep.study_file import DesignsTable, ParameterTable, TaskTable, WorkspaceTable
from tests import ROOT
from tests.support.extras import needs
from tests.support.files import save
from tests.support.samples import slow
from tests.support.snippets import PAGES, Block, blocks, run_python, stand_where_a_user_does

DOCS = ROOT / "docs"
LOOPS = DOCS / "describing-loops.md"
ROTATION_ROWS = {"free": 0, "perpendicular": 1, "parallel": 2, "fixed": 3}
CLOSED = 1e-5  # of the module's size: the home posture is printed with six digits


#: Their Python needs their commands (test_commands.py), or a package (tests/extending).
TOLD_IN_ORDER = {"tutorial.md", "extending.md"}
#: Pages whose Python takes long; `.ci/run` runs them too.
LONG = {
    "cost.md", "scenes.md", "compiled.md", "view-and-plot.md", "units-and-conventions.md", "tables.md",
    "quantities.md", "optimisation.md", "batches.md", "losses.md", "second-order.md",
    "learning.md", "optimal-control.md",
}  # fmt: skip
#: Extras that the Python of a page needs.
EXTRAS = {"optimisation.md": "search", "batches.md": "gpu", "losses.md": "plot", "learning.md": "torch"}
RUN = [page for page in PAGES[1:] if page.name not in TOLD_IN_ORDER and blocks(page, "python")]


@pytest.mark.parametrize(
    "page", [slow(page) if page.name in LONG else page for page in RUN], ids=lambda page: page.name
)
def test_python_of_a_page_prints_what_is_shown(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if page.name in EXTRAS:
        needs(EXTRAS[page.name])
    stand_where_a_user_does(tmp_path, monkeypatch)
    run_python(page)
    shown = "".join(block.text for block in blocks(page, "output"))
    assert capsys.readouterr().out == shown or not shown


def examples() -> list[Block]:
    return [block for block in blocks(LOOPS) if not {"robot", "whole"} & block.facts.keys()]


def load(folder: Path, example: Block) -> hybridyn.HybridRobot:
    """Load the page's four-bar with an example in its place: in the robot, or in a file beside it."""
    robot, pin = [block for block in blocks(LOOPS) if "whole" not in block.facts][:2]
    closure = {"xml": example.text, "toml": pin.text, "yaml": ""}[example.language]
    path = save(folder, robot.text.replace("<!-- the loop -->", closure), "four_bar.urdf")
    if example.language != "xml":
        name = {"yaml": "robot.yaml", "toml": "four_bar.model.toml"}[example.language]
        (folder / example.facts.get("file", name)).write_text(example.text)
    return hybridyn.load(path)


@pytest.mark.parametrize("example", [b for b in blocks(LOOPS) if "whole" in b.facts], ids=str)
def test_robot_at_the_head_of_the_page_moves_as_it_says(example: Block, tmp_path: Path) -> None:
    """Both models compute it: what its motors need for a motion gives this motion."""
    robot = hybridyn.load(save(tmp_path, example.text, example.facts["whole"]))
    assert (robot.mobility, len(robot.motors)) == (
        int(example.facts["mobility"]),
        int(example.facts["motors"]),
    )
    assert float(hybridyn.closure_residual(robot, robot.home)) < 1e-12
    assert robot.description.notes == ()
    q, v, a = hybridyn.assemble(robot, motors=dict.fromkeys(robot.motors, (0.05, 0.1, 0.3)))
    found = hybridyn.ddm(robot, q, v, hybridyn.idm(robot, q, v, a))
    np.testing.assert_allclose(found, a, atol=1e-9 * np.abs(a).max())


def rows(description: Description) -> int:
    return sum(len(c.translations) + ROTATION_ROWS[c.rotation] for c in description.closures)


@pytest.mark.parametrize("example", examples(), ids=str)
def test_example_of_a_loop_is_read_as_the_page_says(example: Block, tmp_path: Path) -> None:
    robot = load(tmp_path, example)
    if example.language == "toml":
        assert robot.description.motors_from == "model.toml"
        assert float(hybridyn.closure_residual(robot, robot.home)) < CLOSED
        return
    assert rows(robot.description) == int(example.facts.get("rows", 0))
    assert len(robot.description.couplings) == int(example.facts.get("couplings", 0))
    assert robot.mobility == int(example.facts["mobility"])
    assert robot.motors == ("drive",)


def test_every_accepted_element_has_an_example() -> None:
    from hybridyn.description.closure_forms import FORMS
    from hybridyn.description.urdf.loops import CLOSURE_READERS

    text = "".join(block.text for block in examples())
    for element in (*CLOSURE_READERS, "coupling", "mimic", "transmission"):
        assert f"<{element} " in text, element
    table = LOOPS.read_text()
    for kind in (*FORMS, "rows"):
        assert f"`{kind}`" in table, kind


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_names_of_functions_exist(page: Path) -> None:
    for name in re.findall(r"\bhybridyn(?:\.\w+)+", re.sub(r"https?://\S+", "", page.read_text())):
        module, attributes = hybridyn, name.split(".")[1:]
        if attributes[0] in extensions.KINDS:  # a group of entry points
            continue
        while attributes and _is_module(module, attributes[0]):
            module = import_module(f"{module.__name__}.{attributes.pop(0)}")
        value: object = module
        for attribute in attributes:
            fields = getattr(value, "__dataclass_fields__", {})
            assert hasattr(value, attribute) or attribute in fields, f"{page.name}: {name}"
            value = getattr(value, attribute, None)


def _is_module(package: object, name: str) -> bool:
    folder = Path(getattr(package, "__path__", ["/nowhere"])[0])
    return (folder / f"{name}.py").is_file() or (folder / name / "__init__.py").is_file()


@pytest.mark.parametrize(
    "page", [*PAGES, DOCS / "examples" / "index.md", ROOT / "CONTRIBUTING.md"], ids=lambda page: page.name
)
def test_install_lines_work_from_a_clone(page: Path) -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    text, released, after = page.read_text().partition("After the first release")
    assert not released or page == DOCS / "install.md"
    for what in re.findall(r"pip install (?:-q |-e )*('[^']*'|[^\s`]+)", text + after.partition("\n\n")[2]):
        names = re.fullmatch(r"'\.\[([\w,]+)\]'|\.", what)
        assert names, f"{page.name}: {what}"
        assert set((names[1] or "").split(",")) - {""} <= extras.keys(), what


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_rows_of_a_table_have_equal_numbers_of_cells_and_links_lead_somewhere(page: Path) -> None:
    """A `|` in a cell, even in code, begins another cell, and what is beyond the last column is not shown."""
    text = re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
    for table in re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE):
        counts = {row: len(re.findall(r"(?<!\\)\|", row)) for row in table.splitlines()}
        head = next(iter(counts.values()))
        assert [row for row, count in counts.items() if count != head] == []
    for target in re.findall(r"\]\(([^)#\s]+)", page.read_text()):
        if not target.startswith("http"):
            assert (page.parent / target).exists(), target


OF_EFFECTS = ("coulomb_friction", "stribeck_friction", "spring", "damper", "stop", "ground_contact")
SCENES = (
    scenes.Scene, scenes.RobotTable, scenes.InitialTable, scenes.RatesTable, ReferenceTable, PointTable,
    *CONTROLLERS.values(), scenes.SceneEffects, scenes.PayloadTable, scenes.WrenchTable, scenes.SolverTable,
    scenes.OutputTable, scenes.EventTable,
)  # fmt: skip
OF_SCENES = {key for table in SCENES for key in table.model_fields}
OF_SWEEPS = {
    key for table in (DesignsTable, ParameterTable, TaskTable, WorkspaceTable) for key in table.model_fields
}
#: Words that a page names, and the marks of which one stands before each.
NAMED: dict[str, tuple[set[str], tuple[str, ...]]] = {
    "scenes.md": (
        OF_SCENES | {key for effect in OF_EFFECTS for key in EFFECTS[effect]},
        ("`", "effects.", "[", "{ ", "\n"),
    ),
    "sweeps.md": (
        {*OF_SWEEPS, *OF_MOTORS, *OF_WORKSPACE, *STATISTICS, *STATUSES, *FIXED_COLUMNS}, ("`", "designs."),
    ),
    "cost.md": ({f"{column.name}`" for column in fields(CostPoint)}, ("`",)),
}  # fmt: skip


@pytest.mark.parametrize("page", NAMED)
def test_every_key_and_measure_is_named(page: str) -> None:
    text, (words, marks) = (DOCS / page).read_text(), NAMED[page]
    assert [word for word in sorted(words) if not any(f"{mark}{word}" in text for mark in marks)] == []


def test_the_scene_of_the_page_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stand_where_a_user_does(tmp_path, monkeypatch)
    whole = blocks(DOCS / "scenes.md", "toml")[0].text
    assert whole.startswith("duration = 0.5 ")
    scene = whole.replace("duration = 0.5 ", "duration = 0.1 ", 1)
    result = play(stage(save(tmp_path, scene, "scene.toml")))
    assert (result.status, len(result.t)) == ("finished", 11)


#: First column of the table of what is read, by page; `test_formats.py` reads that of the formats.
FORMATS = {"pinocchio": "Pinocchio", "describing-loops": "`type`"}


@pytest.mark.parametrize("page", FORMATS)
def test_a_page_has_its_three_tables(page: str) -> None:
    """Of what is read, what is refused, and what is lost on the way out."""
    text = (DOCS / f"{page}.md").read_text(encoding="utf-8")
    heads = re.findall(r"^\| (.*?) \|.*\n\|(?:-+\|)+\n\| ", text, re.MULTILINE)
    assert {FORMATS[page], "refused"} <= {*heads}
    assert any(head.startswith("lost") for head in heads)


@pytest.mark.parametrize(
    "name", ["view.jpg", "lx4.png", "efforts.svg", "structure.svg", "cost.png", "losses.svg"]
)
def test_pictures_of_pages_are_small(name: str) -> None:
    page = {"cost.png": "cost.md", "losses.svg": "losses.md"}.get(name, "view-and-plot.md")
    assert f"(pictures/{name})" in (DOCS / page).read_text()
    assert (DOCS / "pictures" / name).stat().st_size < 150_000


def test_the_page_names_each_tolerance_of_the_code_once_and_gives_a_reason() -> None:
    found = list(tolerances.tolerances())
    assert tolerances.PAGE.read_text() == tolerances.page(found), "run `python docs/extensions/tolerances.py`"
    assert len(found) > 100
    assert [name for name, count in Counter(t.name for t in found).items() if count > 1] == []
    assert [f"{t.file}: {t.name}" for t in found if not t.reason] == []
