"""Find the files that belong to a robot file; their readers are imported only if there is such a file."""

from __future__ import annotations

import re
from pathlib import Path


def find_side_car(file: str) -> Path | None:
    """Return the side-car of a robot file: `X.yaml` beside `X.urdf`, else `robot.yaml` in the same folder."""
    path = Path(file)
    name = re.sub(r"(\.urdf)?(\.xacro)?$", "", path.name)
    candidates = [path.with_name(stem + ending) for stem in (name, "robot") for ending in (".yaml", ".yml")]
    return next((candidate for candidate in candidates if candidate.is_file()), None)


def find_submechanisms(file: str) -> Path | None:
    """Return the file `submechanisms.yml` of Phobos and HyRoDyn in a robot file's folder, or None."""
    folder = Path(file).parent
    candidates = [folder / f"submechanisms{ending}" for ending in (".yml", ".yaml")]
    return next((candidate for candidate in candidates if candidate.is_file()), None)


def find_model_file(file: str) -> Path | None:
    """Return the path of the model file that belongs to a robot file, or None.

    It is `X.urdf.model.toml` beside `X.urdf`, as `hybridyn convert` writes it, or `X.model.toml`; else
    `models/X/model.toml` for `urdf/X.urdf`, and `models/group/X/model.toml` for `urdf/group/X.urdf`.
    """
    path = Path(file)
    beside = own_model_file(file)
    name = beside.name.removesuffix(".model.toml")
    group = path.absolute().parent.name
    candidates = [
        path.with_name(f"{path.name}.model.toml"),
        beside,
        path.parent / ".." / "models" / name / "model.toml",
        path.parent / ".." / ".." / "models" / group / name / "model.toml",
    ]
    return next((candidate for candidate in candidates if candidate.is_file()), None)


def own_model_file(file: str) -> Path:
    """Return the path of the model file beside a robot file, whether or not it exists."""
    path = Path(file)
    name = re.sub(r"(\.urdf|\.xml|\.sdf|\.usd[acz]?)?(\.xacro)?$", "", path.name)
    return path.with_name(f"{name}.model.toml")
