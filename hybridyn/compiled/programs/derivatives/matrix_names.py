"""Names of the matrices of a group's relations, and of what columns cause (`relations`)."""

from __future__ import annotations

from typing import NamedTuple


class MatrixName(NamedTuple):
    """Name of a matrix, or of what columns cause.

    Attributes:
        what: A letter of the equations, or a word below.
        k: Number of the output, or of the run of modules; 0 of what a group has once.
        child: Number of the group on the output.
    """

    what: str
    k: int = 0
    child: int = 0


#: What columns cause: motions of the group, the wrench on its base, and further accelerations.
MOTIONS, WRENCH, MORE = map(MatrixName, ("motions", "wrench", "more"))
#: The same at given motions: forces left along them with the wrench, and accelerations of the outputs.
FORCES, S = map(MatrixName, ("forces", "S"))
#: Forces over the motions, and the factors of these.
OVER_U, FACTORS = map(MatrixName, ("over_u", "factors"))
