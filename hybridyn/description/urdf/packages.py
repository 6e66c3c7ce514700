"""Find packages by the name that their package.xml states, as ROS does, else by the name of their folder."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence

from ...errors import ModelError
from ..bounds import BOUNDS
from .xml_node import parse

#: The file that marks a package and states its name.
STATEMENT = "package.xml"


def stated_name(folder: str) -> str:
    """Return the name that a folder's package.xml states, "" if it has none that can be read."""
    file = os.path.join(folder, STATEMENT)
    try:
        if not os.path.isfile(file) or os.path.getsize(file) > BOUNDS["side-car"].most:
            return ""
        with open(file, "rb") as opened:
            name = parse(opened.read(BOUNDS["side-car"].most), file).child("name")
        return name.content() if name else ""
    except (OSError, ModelError):
        return ""


def package_folders(package: str, places: Sequence[str]) -> Iterator[str]:
    """Yield the folders that may be a package, the likeliest first: those that state its name.

    Args:
        package: Its name.
        places: Folders that are packages or hold some, the strongest first.
    """
    called = []
    for place in places:
        for folder in (place, os.path.join(place, package)):
            if os.path.basename(folder) == package and os.path.isdir(folder):
                called.append(folder)
                if stated_name(folder) in ("", package):
                    yield folder
        yield from (folder for folder in (place, *_folders_in(place)) if stated_name(folder) == package)
    yield from called


def _folders_in(place: str) -> list[str]:
    """Return the folders in a folder, without hidden ones; none of the system's root and of what holds home.

    Those are not packages of one robot, and may be large.
    """
    home = os.path.expanduser("~")
    if place == os.path.dirname(place) or f"{home}/".startswith(f"{place}/"):
        return []
    try:
        with os.scandir(place) as found:
            return sorted(entry.path for entry in found if entry.name[0] != "." and entry.is_dir())
    except OSError:
        return []
