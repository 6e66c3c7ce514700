"""Packages that add to hybridyn: that of the page "Extending", and small wrong ones."""

import importlib
import re
import sys
import tomllib
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path

import pytest

from hybridyn import extensions
from tests import ROOT
from tests.support.files import save
from tests.support.snippets import Block, blocks

PAGE = ROOT / "docs" / "extending.md"


def files() -> dict[str, Block]:
    """Return the files that the page shows, by name."""
    return {block.facts["file"]: block for block in blocks(PAGE) if "file" in block.facts}


def install(
    folder: Path, name: str, points: Mapping[str, Mapping[str, str]], texts: Mapping[str, str]
) -> None:
    """Install a package as pip does: its modules, and a folder that tells its entry points.

    Args:
        folder: Where packages lie.
        name: Name of the package.
        points: Entry points by the kind of what is added.
        texts: Texts of its modules by file.
    """
    for file, text in texts.items():
        save(folder, text, file)
    about = folder / f"{name.replace('-', '_')}-1.0.dist-info"
    save(about, f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n", "METADATA")
    groups = (
        "\n".join([f"[hybridyn.{kind}]", *(f"{key} = {value}" for key, value in own.items()), ""])
        for kind, own in points.items()
    )
    save(about, "\n".join(groups), "entry_points.txt")


def install_workshop(folder: Path) -> None:
    """Install the package of the page."""
    every = files()
    stated = tomllib.loads(every["pyproject.toml"].text)["project"]["entry-points"]
    points = {group.removeprefix("hybridyn."): own for group, own in stated.items()}
    texts = {file: block.text for file, block in every.items() if file.startswith("workshop/")}
    install(folder, "workshop", points, {"workshop/__init__.py": "", **texts})


def use(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let Python find the packages of a folder, and hybridyn look for them anew, there alone."""

    def entry_points(**asked: str) -> metadata.EntryPoints:
        found = metadata.distributions(path=[str(folder)])
        return metadata.EntryPoints(point for one in found for point in one.entry_points).select(**asked)

    monkeypatch.setattr(metadata, "entry_points", entry_points)
    monkeypatch.syspath_prepend(folder)
    forget()
    for name in [name for name in sys.modules if re.match(r"(workshop|odd\w*)(\.|$)", name)]:
        monkeypatch.delitem(sys.modules, name)


def forget() -> None:
    """Let hybridyn look for packages anew."""
    importlib.invalidate_caches()
    extensions._points.cache_clear()
    extensions._loaded.cache_clear()
