"""Read a file that may be broken: it is the robot that is expected, or refused with one readable line."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hybridyn.description import Description, read
from hybridyn.description.bounds import BOUNDS
from hybridyn.errors import ModelError
from tests.support.files import save
from tests.support.snippets import ROOT
from tests.support.waiting import must_end

Texts = str | bytes | Mapping[str, str | bytes]


def outcome(path: Path, text: bytes, *, never: str | None = None) -> Description | None:
    """Read a file that must be read, or refused with one readable line.

    Args:
        path: The file.
        text: What was written to it, or beside it, for messages.
        never: Words that no refusal may have.

    Returns:
        The robot, or None where it was refused.
    """
    try:
        with must_end(text):
            return read(path)
    except ModelError as error:
        message = str(error)
        assert message.strip()
        assert "\n" not in message, text
        assert len(message) < 2000, text
        assert never is None or never not in message, text
        return None


def refused(file: Path | str, *words: str, **options: object) -> ModelError:
    """Check that a file is refused in one line that has all these words, and give the error."""
    with pytest.raises(ModelError) as caught:
        read(file, **options)  # type: ignore[arg-type]
    assert [word for word in words if word not in str(caught.value)] == [], caught.value
    assert "\n" not in str(caught.value)
    return caught.value


def save_all(folder: Path, texts: Texts, name: str = "four_bar.urdf") -> Path:
    """Write the text of a robot, or the texts of its files by name, of which the first is the robot's."""
    files = texts if isinstance(texts, Mapping) else {name: texts}
    robot, *_ = (save(folder, text, name) for name, text in files.items())
    return robot


def holds(found: Any, expected: Any) -> None:
    """Check what a record says.

    Args:
        found: A record, or a part of one.
        expected: A dictionary has some attributes of the record, or some parts of a tuple by name; a list
            has all parts of a tuple, where a text is the name of one; a set has words, each of which some
            line says. Anything else is the value.
    """
    if isinstance(expected, dict) and not isinstance(found, dict):
        parts = {part.name: part for part in found} if isinstance(found, tuple) else {}
        for name, value in expected.items():
            holds(parts[name] if parts else getattr(found, name), value)
    elif isinstance(expected, list):
        for part, value in zip(found, expected, strict=True):
            holds(part.name if isinstance(value, str) else part, value)
    elif isinstance(expected, set):
        assert not [word for word in expected if not any(word in line for line in found)], found
    else:
        assert np.all(found == expected), (found, expected)


def rows_of_page(heading: str) -> dict[str, str]:
    """Return what a table of forms on the page says: the second cell of each row by the first one."""
    page = (ROOT / "docs" / "formats.md").read_text().partition(f"### {heading}\n")[2]
    lines = [line for line in re.split(r"\n##+ ", page)[0].splitlines() if line.startswith("| ")]
    cells = [re.split(r"(?<!\\)\|", line)[1:-1] for line in lines]
    return {first.strip(): second.strip() for first, second, _ in cells[1:]}


def finite(description: Description, text: object) -> None:
    """Check that a robot has only finite numbers, and closures that close something."""
    for link in description.links:
        assert np.isfinite([link.mass, *link.com, *link.inertia.ravel()]).all(), text
        assert link.mass >= 0, text
    for joint in description.joints:
        assert np.isfinite([*joint.placement.ravel(), *joint.axis]).all(), text
        assert joint.lower <= joint.upper, text
    for closure in description.closures:
        assert np.isfinite([closure.frame_a, closure.frame_b]).all(), text
        assert len(closure.translations) or closure.rotation != "free", text


def bound(monkeypatch: pytest.MonkeyPatch, **most: int) -> None:
    """Set bounds of what is read to other numbers; the words are keys of `BOUNDS`."""
    for what, number in most.items():
        monkeypatch.setitem(BOUNDS, what, BOUNDS[what]._replace(most=number))
