"""Everything that reads or writes files; each robot format has one reader that returns a `Description`.

The readers are imported when the first file is read: who has a robot already needs none of them.
"""

from typing import TYPE_CHECKING

from .records import Closure, Coupling, Description, Joint, Link

if TYPE_CHECKING:
    from .reading import read

__all__ = ["Closure", "Coupling", "Description", "Joint", "Link", "read"]


def __getattr__(name: str) -> object:
    if name != "read":
        raise AttributeError(f"module 'hybridyn.description' has no attribute {name!r}")
    from .reading import read

    return read
