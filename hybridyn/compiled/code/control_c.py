"""Exported C of a control step: loops closed from the motors, then the efforts of the motion found."""

from __future__ import annotations

from dataclasses import replace

from ..program import Program, stored
from .plain_c import REAL, prototype

#: Most Newton steps of `<name>_close` in one call: four suffice from the last tick's posture.
NEWTON_STEPS = 8


class ControlStep:
    """The function `<name>_idm_from_motors`.

    Attributes:
        form: Its name, arguments and workspace, a program without calls.
        inverse: The inverse model that it calls after `<name>_close`.
    """

    def __init__(self, close: Program, inverse: Program) -> None:
        """Join both programs; the guard of `inverse` need not compare the loops."""
        kernels = tuple(replace(x, name=f"closed_{i}") for i, x in enumerate(inverse.kernels))
        self._close, self.inverse = close, replace(inverse, name="idm_of_closed", kernels=kernels)
        outputs = (*close.outputs, *inverse.outputs)
        near = close.inputs[0][1]
        own = near + max(_room(close), _room(inverse))
        self.form = Program("idm_from_motors", close.inputs, outputs, (), (), 1, own)

    def text(self, name: str, dtype: str) -> str:
        """Return the public C function; `idm_of_closed_samples` is the driver of the inverse model."""
        real, close = REAL[dtype], self._close
        near = close.inputs[0][1]
        inputs = ", ".join(n for n, _ in close.inputs[1:])
        states = [n for n, _ in close.outputs]
        read = [*zip(states, (size for _, size in self.inverse.inputs), strict=False)]
        read += [(n, size) for n, size in self.inverse.inputs[len(states) :]]
        given, result = (sum(size for _, size in x) for x in (self.inverse.inputs, self.inverse.outputs))
        lines = [
            f"{prototype(self.form, name, dtype)} {{",
            f"    {real} *from = work->numbers, *given = from + {near}, *result = given + {given};",
            f"    V *shared = ROOM(result + {result}), *own = shared + {max(self.inverse.shared, 1)};",
            f"    {real} guard = 0;",
            "    int k, n;",
            f"    for (k = 0; k < {near}; k++) from[k] = near[k];",
            f"    for (n = 0; n < {NEWTON_STEPS}; n++) {{",
            f"        guard = {name}_close(from, {inputs}, {', '.join(states)}, ({name}_close_work *)given);",
            "        if (guard <= 1) break;",
            f"        for (k = 0; k < {near}; k++) from[k] = q[k];",
            "    }",
            "    if (!(guard <= 1)) return guard;",
        ]
        lines += [
            f"    for (k = 0; k < {size}; k++) given[{at} + k] = {n}[k];" for n, size, at in stored(read)
        ]
        lines.append("    idm_of_closed_samples(given, result, shared, own, &guard);")
        lines.append(f"    for (k = 0; k < {result}; k++) guard += result[k] * 0; /* not finite: NaN */")
        lines += [f"    for (k = 0; k < {size}; k++) {n}[k] = result[k];" for n, size in self.inverse.outputs]
        return "\n".join([*lines, "    return guard;", "}"])


def _room(program: Program) -> int:
    """Return the size of a program's workspace."""
    sizes = (size for x in (program.inputs, program.outputs) for _, size in x)
    return sum(sizes) + max(program.shared, 1) + max(program.own, 1)
