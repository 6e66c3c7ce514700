"""What tests need beyond the extra `test`: they are skipped where that is absent, and say which it is."""

from importlib import import_module
from importlib.metadata import PackageNotFoundError, files
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

#: A module of each extra by which it is known to be installed.
MODULES = {
    "io": "polars", "mjcf": "mujoco", "sdf": "rod", "usd": "pxr", "view": "viser", "bench": "mujoco",
    "docs": "myst_nb", "plot": "matplotlib", "compiled": "casadi", "sweep": "joblib", "dask": "distributed",
    "gpu": "warp", "identify": "clarabel",
    "search": "optuna", "ros": "rclpy", "torch": "torch", "jax": "jax",
}  # fmt: skip


def needs(extra: str, module: str | None = None) -> Any:
    """Skip a test, or at the head of a file all of its tests, where an extra is not installed.

    Args:
        extra: The extra's name.
        module: A module of it; by default that of `MODULES`.

    Returns:
        The module.
    """
    module = module or MODULES[extra]
    if find_spec(module) is None:
        skip(extra)
    return import_module(module)


def skip(extra: str) -> None:
    """Skip a test, or a file, for an extra that is not installed."""
    pytest.skip(f"needs the extra '{extra}': pip install -e '.[{extra}]'", allow_module_level=True)


def all_installed() -> bool:
    """Return whether every extra is installed, so that no test is skipped for one."""
    return all(find_spec(module) is not None for module in MODULES.values()) and bool(robots_of_others())


def robots_of_others() -> list[Path]:
    """Return the files of the extra "robots" (example-robot-data), none where it is not installed."""
    try:
        return [Path(str(file.locate())) for file in files("example-robot-data") or ()]
    except PackageNotFoundError:
        return []
