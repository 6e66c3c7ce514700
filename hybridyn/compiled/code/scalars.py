"""What a number is in printed code: its type, how many lie side by side, and their arithmetic."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib import resources

TYPES = {
    "float64": ("double", "long long", 8),
    "float32": ("float", "int", 4),
    "longdouble": ("long double", "", 16),
    "float128": ("__float128", "", 16),
    "complex128": ("double _Complex", "", 16),
}
"""Type in C, integer of the same size (for vectors), bytes."""

IN_LIBRARY = {
    "float64": "name",
    "float32": "name##f",
    "longdouble": "name##l",
    "float128": "name##q",
    "complex128": "c##name",
}
"""How the C library calls a function for a type."""

#: Guards up to this are trusted.
TRUSTED = 1.0


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
                "complex128": "#include <complex.h>\n#undef I\n#define COMPLEX",
            }.get(self.name, ""),
        ]
        if self.lanes > 1:
            lines += [f"#define I {integer}", f"#define W {self.lanes}", text_of("vector.h")]
        else:
            lines += [text_of("scalar.h")]
        lines += [_comparisons(self.name), text_of("functions.h"), _sines(self)]
        return "\n".join(lines)


def _comparisons(name: str) -> str:
    """Return the comparisons of a type, and what differs from scalar to scalar."""
    part = "creal" if name == "complex128" else ""
    lines = [
        f"#define {word}(a, b) ({part}(a) {sign} {part}(b))"
        for word, sign in (("LT", "<"), ("LE", "<="), ("EQ", "=="), ("NE", "!="))
    ]
    return "\n".join(lines + ([text_of("complex.h")] if name == "complex128" else []))


def _sines(scalar: Scalar) -> str:
    """Return SINCOS (and for plain numbers SQRT, FABS)."""
    if scalar.name not in ("float64", "float32"):
        lines = ["LANES1(SQRT, SCALAR(sqrt))"]
        if scalar.name != "complex128":
            lines.append("LANES1(FABS, SCALAR(fabs))")
        return "\n".join(
            [*lines, "INLINE void SINCOS(V x, V *s, V *c) { *s = SCALAR(sin)(x); *c = SCALAR(cos)(x); }"]
        )
    own = "sines_vector.h" if scalar.lanes > 1 else "sines_scalar.h"
    return text_of(own).replace("/* trigonometry.h */", text_of("trigonometry.h"))


@cache
def text_of(name: str) -> str:
    """Read one of the C sources that lie beside this package."""
    return (resources.files("hybridyn.compiled") / "c" / name).read_text()
