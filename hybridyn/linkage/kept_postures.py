"""Keep the generic postures of larger modules in the cache folder, for robots that are loaded again.

An entry is named by a hash of all that the postures depend on, also of this package's files. Its numbers are
those that the search found, bit by bit.
"""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np

from ..description.cache_folder import hashed
from ..description.kept_texts import keep, kept, state_of
from ..spatial import Array
from .closures import Closures
from .generic_postures import generic_postures

#: Freedoms from which on a search takes longer than reading its result, several times.
WORTH_KEEPING = 12
#: Folder of the entries in the cache folder.
FOLDER = "postures"


def kept_generic_postures(
    closures: Closures, home: Array, row_scale: Array, col_scale: Array, tolerance: float
) -> tuple[Array, float]:
    """Return `generic_postures`, from the cache folder if they are there."""
    given = (closures, home, row_scale, col_scale, tolerance)
    if closures.tree.nv < WORTH_KEEPING:
        return generic_postures(*given)
    here = Path(__file__).parent
    about = hashed(np.__version__, state_of(here), state_of(here.parent))
    name = hashed(about, pickle.dumps(given).hex())
    found = kept(name, FOLDER)
    if found is not None:
        return np.array(found["postures"], dtype=float).reshape(-1, closures.tree.nq), found["best"]
    postures, best = generic_postures(*given)
    keep(name, {"postures": postures.tolist(), "best": best}, FOLDER)
    return postures, best
