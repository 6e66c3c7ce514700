"""C code of time steps by a library's direct model."""

from __future__ import annotations

from ..program import Program
from .scalars import Scalar, c_text


def steps_in_c(programs: list[Program], scalar: Scalar) -> bool:
    """Return whether a library takes time steps in C: in double precision, with programs "lift" and "ddm"."""
    return scalar.name == "float64" and scalar.lanes > 1 and {"lift", "ddm"} <= {p.name for p in programs}


#: What `laws.h`, `lift.h` and `steps.h` need of every library.
STEPS = "#define STAGES 8\n#define LAST_STEP 1e-12\n#define LAW(name) law->name\n#define DDM ddm_single_at"
#: The C of the steps, in order.
NEEDED = "laws.h", "one_lane.h", "newton.h", "lift.h", "steps.h"
#: The size of their memory.
STEPS_WORK = "EXPORT Long steps_work = sizeof(Work);"


def steps_source(programs: list[Program]) -> str:
    """Return the C of the time steps."""
    lift, ddm = (next(p for p in programs if p.name == name) for name in ("lift", "ddm"))
    sizes, names = dict(lift.outputs), {"NQ": "q", "NV": "xi_dot", "MODULES": "step"}
    defines = [f"#define {name} {sizes[key]}" for name, key in names.items()]
    defines.append(f"#define EFFORTS {dict(ddm.inputs)['tau']}")
    return "\n".join([*defines, STEPS, *map(c_text, NEEDED), STEPS_WORK])
