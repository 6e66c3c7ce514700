"""Robot files in, plain records out: links, joints, closures, couplings, motors, home posture.

Read `records` (what every reader returns), `closure_forms` (the closures that files name), `reading` (which
reader takes a file), then one format: `urdf/`, or the files beside a URDF in `side_cars/`. `validate`
checks every description, whatever file it came from.

May import: `errors`, `spatial`, `colours`.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .reading import read
    from .records import Closure, Coupling, Description, Joint, Link

__all__ = ["Closure", "Coupling", "Description", "Joint", "Link", "read"]


def __getattr__(name: str) -> object:
    """Import a name when it is first used: NumPy comes with the records, which is too slow for completion."""
    if name not in __all__:
        raise AttributeError(f"module 'hybridyn.description' has no attribute {name!r}")
    if name == "read":
        from .reading import read

        return read
    from . import records

    return getattr(records, name)
