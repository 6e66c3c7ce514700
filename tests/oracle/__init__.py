"""Reference models: inverse and direct dynamics in maximal coordinates, from the `Description` alone.

Read `arithmetic` (float64 or any number of digits), `rows` (constraint rows of joints and closures),
`joints`, `tree`, `bodies`, `models`, `friction`. The oracle shares no code with the models that it checks.

Of the package it imports `hybridyn.description`, the records that a robot's files state, and no more.
"""

from .arithmetic import Extended, Float64, Long
from .friction import Judge
from .models import Oracle
from .tree import Base

__all__ = ["Base", "Extended", "Float64", "Judge", "Long", "Oracle"]
