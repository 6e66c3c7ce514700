"""The judge of the core: inverse and direct dynamics in maximal coordinates, from the `Description` alone.

Read `arithmetic` (float64 or any number of digits), `rows` (what joints and closures hold), `tree`,
`bodies`, `models`. It shares no code with the models that it judges.

May import: `description`.
"""

from .arithmetic import Extended, Float64
from .models import Oracle
from .tree import Base

__all__ = ["Base", "Extended", "Float64", "Oracle"]
