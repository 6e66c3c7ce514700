"""What pages list is what the code has: codes, columns, keys, measures, tolerances; pictures are small."""

import re
from collections import Counter
from dataclasses import fields
from pathlib import Path

import pytest

from docs.extensions import tolerances
from hybridyn.description.side_cars.tables import ModelFile, keys_at
from hybridyn.scenes import scene_tables as scenes
from hybridyn.scenes.stage import play, stage
from hybridyn.studies.check.check import CODES
from hybridyn.studies.cost.points import Point
from hybridyn.studies.sweep.evaluation import STATUSES
from hybridyn.studies.sweep.measures import OF_MOTORS, OF_WORKSPACE, STATISTICS
from hybridyn.studies.sweep.reading import FIXED_COLUMNS
from hybridyn.studies.sweep.study_tables import DesignsTable, ParameterTable, TaskTable, WorkspaceTable
from tests import ROOT
from tests.files import save
from tests.snippets import blocks, stand_where_a_user_does

DOCS = ROOT / "docs"
OF_EFFECTS = ("coulomb_friction", "stribeck_friction", "spring", "damper", "stop", "ground_contact")
SCENES = (
    scenes.Scene, scenes.RobotTable, scenes.InitialTable, scenes.RatesTable, scenes.ReferenceTable,
    scenes.PointTable, *scenes.CONTROLLERS.values(), scenes.SceneEffects, scenes.PayloadTable,
    scenes.WrenchTable, scenes.SolverTable, scenes.OutputTable, scenes.EventTable,
)  # fmt: skip
OF_SCENES = {key for table in SCENES for key in table.model_fields}
OF_SWEEPS = {
    key for table in (DesignsTable, ParameterTable, TaskTable, WorkspaceTable) for key in table.model_fields
}
#: Words that a page names, and the marks of which one stands before each.
NAMED: dict[str, tuple[set[str], tuple[str, ...]]] = {
    "scenes.md": (
        OF_SCENES | {key for effect in OF_EFFECTS for key in keys_at(ModelFile, ("effects", effect))},
        ("`", "effects.", "[", "{ ", "\n"),
    ),
    "sweeps.md": (
        {*OF_SWEEPS, *OF_MOTORS, *OF_WORKSPACE, *STATISTICS, *STATUSES, *FIXED_COLUMNS}, ("`", "designs."),
    ),
    "cost.md": ({f"{column.name}`" for column in fields(Point)}, ("`",)),
}  # fmt: skip


@pytest.mark.parametrize("page", NAMED)
def test_every_key_and_measure_is_named(page: str) -> None:
    text, (words, marks) = (DOCS / page).read_text(), NAMED[page]
    assert [word for word in sorted(words) if not any(f"{mark}{word}" in text for mark in marks)] == []


def test_the_table_of_codes_is_complete() -> None:
    rows = re.findall(r"^\| `([\w-]+)` \| (\w+) \| (.*) \|$", (DOCS / "check.md").read_text(), re.MULTILINE)
    assert {code: (severity, title) for code, severity, title in rows} == CODES


def test_the_scene_of_the_page_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stand_where_a_user_does(tmp_path, monkeypatch)
    result = play(stage(save(tmp_path, blocks(DOCS / "scenes.md", "toml")[0].text, "scene.toml")))
    assert (result.status, len(result.t)) == ("finished", 51)


#: First column of the table of what is read, by page; `test_formats.py` reads that of the formats.
FORMATS = {"pinocchio": "Pinocchio", "describing-loops": "`type`"}


@pytest.mark.parametrize("page", FORMATS)
def test_a_page_has_its_three_tables(page: str) -> None:
    """Of what is read, what is refused, and what is lost on the way out."""
    text = (DOCS / f"{page}.md").read_text(encoding="utf-8")
    heads = re.findall(r"^\| (.*?) \|.*\n\|(?:-+\|)+\n\| ", text, re.MULTILINE)
    assert {FORMATS[page], "refused"} <= {*heads}
    assert any(head.startswith("lost") for head in heads)


@pytest.mark.parametrize("name", ["view.jpg", "lx4.png", "efforts.svg", "structure.svg", "cost.png"])
def test_pictures_of_pages_are_small(name: str) -> None:
    page = "cost.md" if name == "cost.png" else "view-and-plot.md"
    assert f"(pictures/{name})" in (DOCS / page).read_text()
    assert (DOCS / "pictures" / name).stat().st_size < 150_000


def test_the_page_names_each_tolerance_of_the_code_once_and_gives_a_reason() -> None:
    found = list(tolerances.tolerances())
    assert tolerances.PAGE.read_text() == tolerances.page(found), "run `python docs/extensions/tolerances.py`"
    assert len(found) > 100
    assert [name for name, count in Counter(t.name for t in found).items() if count > 1] == []
    assert [f"{t.file}: {t.name}" for t in found if not t.reason] == []
