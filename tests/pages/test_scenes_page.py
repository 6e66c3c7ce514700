"""docs/scenes.md: its scene runs, and it names every key that a scene may have."""

from __future__ import annotations

from pathlib import Path

import pytest

from hybridyn.description.side_cars.effect_tables import known_keys
from hybridyn.scenes.scene_tables import (
    CONTROLLERS,
    EventTable,
    InitialTable,
    OutputTable,
    PayloadTable,
    PointTable,
    RatesTable,
    ReferenceTable,
    RobotTable,
    Scene,
    SceneEffects,
    SolverTable,
    WrenchTable,
)
from hybridyn.scenes.stage import play, stage
from tests import ROOT
from tests.files import save
from tests.snippets import blocks, stand_where_a_user_does

PAGE = ROOT / "docs" / "scenes.md"
TABLES = (
    Scene, RobotTable, InitialTable, RatesTable, ReferenceTable, PointTable, *CONTROLLERS.values(),
    SceneEffects, PayloadTable, WrenchTable, SolverTable, OutputTable, EventTable,
)  # fmt: skip
OF_EFFECTS = ("coulomb_friction", "stribeck_friction", "spring", "damper", "stop", "ground_contact")


def test_the_scene_of_the_page_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stand_where_a_user_does(tmp_path, monkeypatch)
    path = save(tmp_path, blocks(PAGE, "toml")[0].text, "scene.toml")
    result = play(stage(path))
    assert (result.status, len(result.t)) == ("finished", 51)


def test_every_key_is_named() -> None:
    text = PAGE.read_text()
    keys = {key for table in TABLES for key in table.model_fields}
    keys |= {key for effect in OF_EFFECTS for key in known_keys(("effects", effect, ""))}
    absent = [
        key
        for key in sorted(keys)
        if not any(f"{mark}{key}" in text for mark in ("`", "effects.", "[", "{ ", "\n"))
    ]
    assert absent == []
