"""Read robot files into plain records: links, joints, closures, couplings, motors, home posture.

Read `records` first (the data that every reader returns), then `closure_forms` (the closures that files and
frames name), `residuals`, `residual_frames` and `residual_closures` (those of other packages), `placement`,
`joint_chains` (joints one behind the other), `joint_graph` (a tree with closures, of bodies and joints in
any order), `reading` (bytes, xacro, XML, and the choice of the reader), `added_formats` (readers of other
packages), and one format: `urdf/`, or the files beside a URDF in `side_cars/`, of whose effects
`effect_names` says what their numbers are by. `loop_signs` refuses loops in forms that are not read, and
finds signs of lost ones. `validate` checks the description from every format.

May import: `errors`, `extensions`, `spatial`, `colours`.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .added_formats import RobotFormat
    from .closure_forms import closure_of
    from .reading import read
    from .records import Closure, Coupling, Description, Joint, Link, MotorStatement, RobotFile

__all__ = [
    "Closure",
    "Coupling",
    "Description",
    "Joint",
    "Link",
    "MotorStatement",
    "RobotFile",
    "RobotFormat",
    "closure_of",
    "read",
]
#: Files of the names that are no records.
_FILES = {"RobotFormat": ".added_formats", "closure_of": ".closure_forms", "read": ".reading"}


def __getattr__(name: str) -> object:
    """Import a name on first use: the records import NumPy, which is too slow for shell completion."""
    if name not in __all__:
        raise AttributeError(f"module 'hybridyn.description' has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_FILES.get(name, ".records"), __name__), name)
