"""Every row of the tables of forms of Drake, SDF and URDF on the page, as files: they are as the row says."""

import re
from pathlib import Path
from typing import Any

import pytest

from hybridyn.description import read
from hybridyn.description.notes import place_of
from tests.description.reading import holds, refused, rows_of_page, save_all
from tests.description.sdf_rows import SDF_ROWS, Files
from tests.description.urdf_rows import OF_DRAKE_ROWS, URDF_ROWS

TABLES = {"Drake": OF_DRAKE_ROWS, "SDF": SDF_ROWS, "Other forms in URDF": URDF_ROWS}


@pytest.mark.parametrize("table", TABLES)
def test_each_row_of_the_page_has_its_files(table: str) -> None:
    """What a row says is what its files show: read, noted, dropped, refused."""
    rows = rows_of_page(table)
    assert [*rows] == [*TABLES[table]]
    for form, says in rows.items():
        found = {"refused" if isinstance(given, str) else "read" for _, given in TABLES[table][form]}
        found |= {
            "noted" for _, given in TABLES[table][form] if not isinstance(given, str) and "notes" in given
        }
        assert found & {"read", "refused"} >= {*re.findall(r"\b(read|refused)\b", says)}, form
        assert "noted" in found or not any(word in says for word in ("noted", "dropped", "a note")), form


CASES = [
    pytest.param(*case, id=f"{form} {number}")
    for rows in TABLES.values()
    for form, cases in rows.items()
    for number, case in enumerate(cases)
]


@pytest.mark.parametrize(("files", "expected"), CASES)
def test_a_form_is_as_its_row_says(files: Files, expected: dict[str, Any] | str, tmp_path: Path) -> None:
    ending = "sdf" if isinstance(files, str) and files.startswith("<sdf") else "urdf"
    file = save_all(tmp_path, {f"r.{ending}": files} if isinstance(files, str) else files)
    if isinstance(expected, str):
        refused(file, expected)
        return
    found = read(file)
    lines = [place_of(note)[1] for note in found.notes if " drops " in note]
    assert None not in lines, found.notes
    effects = [name for name, _ in found.effects]
    holds(found, {name: value for name, value in expected.items() if name != "effects"})
    assert "effects" not in expected or effects == [
        one if isinstance(one, str) else one[0] for one in expected["effects"]
    ]
