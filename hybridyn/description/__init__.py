"""Robot files in, plain records out: links, joints, closures, couplings, motors, home posture.

Read `records` (what every reader returns), `closure_forms` (the closures that files name), `reading` (which
reader takes a file), then one format: `urdf/`, or the files beside a URDF in `side_cars/`. `validate`
checks every description, whatever file it came from.

May import: `errors`, `spatial`, `colours`.
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
