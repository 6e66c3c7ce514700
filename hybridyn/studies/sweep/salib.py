"""Calls of SALib: designs of its methods, and the indices of a measure."""

from __future__ import annotations

import warnings
from importlib import import_module
from typing import Any

import numpy as np

from ...errors import HybridynError, install_advice
from ...spatial import Array

#: Levels of each parameter in Morris's method, the usual number.
LEVELS = 4


def block_size(method: str, parameters: int) -> int:
    """Return the number of designs in a block of "saltelli" or "morris": a base point or a trajectory."""
    return parameters + (2 if method == "saltelli" else 1)


def draw(method: str, parameters: int, count: int, seed: int) -> Array:
    """Draw the designs of a method in the unit cube, shape (count * block_size, parameters).

    Args:
        method: "saltelli" or "morris".
        parameters: Number of parameters.
        count: Number of blocks.
        seed: Seed of the random numbers.

    Raises:
        HybridynError: SALib is missing.
    """
    sampler = package("SALib.sample.sobol" if method == "saltelli" else "SALib.sample.morris")
    words: dict[str, Any] = {"calc_second_order": False} if method == "saltelli" else {"num_levels": LEVELS}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # counts that are no power of 2: docs/sweeps.md says so
        out = sampler.sample(problem(parameters), count, seed=np.random.default_rng(seed), **words)
    return np.asarray(out, dtype=float)


def problem(parameters: int) -> dict[str, Any]:
    """Describe the unit cube to SALib."""
    names = [f"x{i}" for i in range(parameters)]
    return {"num_vars": parameters, "names": names, "bounds": [[0.0, 1.0]] * parameters}


def package(name: str) -> Any:
    """Import a module of SALib.

    Raises:
        HybridynError: SALib is missing.
    """
    try:
        return import_module(name)
    except ImportError:
        raise HybridynError(f"this needs SALib: {install_advice('sensitivity')}") from None
