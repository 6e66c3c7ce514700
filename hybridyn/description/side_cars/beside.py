"""Find the files beside a robot's file: side-cars, and `model.toml`.

For `X.urdf`, `X.urdf.xacro` or `X.xml`, the model file is `X.model.toml` beside it, else
`../models/X/model.toml` (`../../models/group/X/model.toml` for `urdf/group/X.urdf`).
"""

from __future__ import annotations

import contextlib
import fnmatch
import os
import re
import stat
from collections.abc import Iterable
from pathlib import Path


def find_side_car(file: str) -> Path | None:
    """Return the side-car of a robot file: `X.yaml` beside `X.urdf`, else `robot.yaml` in the same folder."""
    folder, base = os.path.split(file)
    name = re.sub(r"(\.urdf)?(\.xacro)?$", "", base)
    return _first(
        os.path.join(folder, stem + ending) for stem in (name, "robot") for ending in (".yaml", ".yml")
    )


def _first(places: Iterable[str]) -> Path | None:
    """Return the first path that is a file; as text, paths are tried in a third of the time.

    Raises:
        OSError: A place cannot be looked at.
    """
    for place in places:
        with contextlib.suppress(FileNotFoundError, NotADirectoryError):
            if stat.S_ISREG(os.stat(place).st_mode):
                return Path(place)
    return None


def files_like(folder: str | Path, pattern: str) -> list[Path]:
    """Return the paths in a folder whose names fit a pattern, in order; none if it cannot be read."""
    with contextlib.suppress(OSError):
        return [Path(folder, name) for name in sorted(fnmatch.filter(os.listdir(folder), pattern))]
    return []


def find_loop_closures(file: str) -> Path | None:
    """Return the file that belongs to a robot: beside it, or where packages with a folder `urdf` have it."""
    folder = Path(file).absolute().parent
    above = (folder.parent, folder.parent / "config") if folder.name == "urdf" else ()
    found = (path for place in (folder, *above) for path in files_like(place, "loop_closures.y*ml"))
    return next(found, None)


def find_model_file(file: str) -> Path | None:
    """Return the path of the model file that belongs to a robot file, or None.

    It is `X.urdf.model.toml` beside `X.urdf`, as `hybridyn convert` writes it, or `X.model.toml`; else
    `models/X/model.toml` for `urdf/X.urdf`, and `models/group/X/model.toml` for `urdf/group/X.urdf`.
    """
    folder, base = os.path.split(file)
    name, group = _model_name(base), Path(file).absolute().parent.name
    return _first(
        os.path.join(folder, *place)
        for place in (
            (f"{base}.model.toml",),
            (f"{name}.model.toml",),
            ("..", "models", name, "model.toml"),
            ("..", "..", "models", group, name, "model.toml"),
        )
    )


def own_model_file(file: str) -> Path:
    """Return the path of the model file beside a robot file, whether or not it exists."""
    path = Path(file)
    return path.with_name(f"{_model_name(path.name)}.model.toml")


def _model_name(base: str) -> str:
    """Return the name of a robot's file without its endings."""
    return re.sub(r"(\.urdf|\.xml|\.sdf|\.usd[acz]?)?(\.xacro)?$", "", base)
