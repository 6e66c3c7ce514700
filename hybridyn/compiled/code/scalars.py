"""What a number is in printed code: its type, how many lie side by side, and their arithmetic."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib import resources

#: Type in C, integer of the same size (for vectors), bytes.
TYPES = {
    "float64": ("double", "long long", 8),
    "float32": ("float", "int", 4),
    "longdouble": ("long double", "", 16),
    "float128": ("__float128", "", 16),
}

#: How the C library calls a function for a type.
IN_LIBRARY = {
    "float64": "name",
    "float32": "name##f",
    "longdouble": "name##l",
    "float128": "name##q",
}

#: Guards up to this are trusted.
GUARD_LIMIT = 1.0


@dataclass(frozen=True)
class Scalar:
    """A number of printed code.

    Attributes:
        name: One of `TYPES`.
        lanes: Numbers side by side; 1 for plain numbers.
    """

    name: str = "float64"
    lanes: int = 1

    @property
    def c(self) -> str:
        """The type of one number in C."""
        return TYPES[self.name][0]

    @property
    def bytes(self) -> int:
        """Size of all lanes."""
        return TYPES[self.name][2] * self.lanes

    def prelude(self) -> str:
        """Return the C source that defines V, its arithmetic and its functions."""
        c, integer, _ = TYPES[self.name]
        lines = [
            "#include <math.h>",
            f"#define S {c}",
            f"#define SCALAR(name) {IN_LIBRARY[self.name]}",
            {
                "float64": "#define DOUBLE\n#define SCALAR_FMA __builtin_fma",
                "float32": "#define SCALAR_FMA __builtin_fmaf",
                "float128": "#include <quadmath.h>",
            }.get(self.name, ""),
        ]
        if self.lanes > 1:
            lines += [f"#define I {integer}", f"#define W {self.lanes}", text_of("vector.h")]
        else:
            lines += [text_of("scalar.h")]
        lines += [text_of("functions.h"), _sines(self)]
        return "\n".join(lines)


def _sines(scalar: Scalar) -> str:
    """Return SINCOS (and for plain numbers SQRT, FABS)."""
    if scalar.name not in ("float64", "float32"):
        return "\n".join(
            [
                "LANES1(SQRT, SCALAR(sqrt))",
                "LANES1(FABS, SCALAR(fabs))",
                "INLINE void SINCOS(V x, V *s, V *c) { *s = SCALAR(sin)(x); *c = SCALAR(cos)(x); }",
            ]
        )
    own = "sines_vector.h" if scalar.lanes > 1 else "sines_scalar.h"
    return text_of(own).replace("/* trigonometry.h */", text_of("trigonometry.h"))


@cache
def text_of(name: str) -> str:
    """Read one of the C sources that lie beside this package."""
    return (resources.files("hybridyn.compiled") / "c" / name).read_text()
