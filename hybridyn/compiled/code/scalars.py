"""Number types of generated code: C type, lanes of a vector, and their arithmetic."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib import resources

#: C type, integer type of the same size (for vectors), and size in bytes of each number type.
TYPES = {
    "float64": ("double", "long long", 8),
    "float32": ("float", "int", 4),
    "longdouble": ("long double", "", 16),
    "float128": ("__float128", "", 16),
}

#: C types of a robot's models: those that a caller may ask for.
REAL = {"float64": "double", "float32": "float"}

#: Name of a C library function for each number type.
IN_LIBRARY = {
    "float64": "name",
    "float32": "name##f",
    "longdouble": "name##l",
    "float128": "name##q",
}

#: Functions of the C library that kernels call, of one number and of two.
OF_ONE = (
    "TAN", "ASIN", "ACOS", "ATAN", "SINH", "COSH", "TANH", "ASINH", "ACOSH", "ATANH", "EXP", "EXPM1", "LOG",
    "LOG1P", "FLOOR", "CEIL", "ERF",
)  # fmt: skip
OF_TWO = ("ATAN2", "FMOD", "REMAINDER", "HYPOT", "COPYSIGN", "POW")

#: Largest guard at which a sample is trusted.
GUARD_LIMIT = 1.0


@dataclass(frozen=True)
class Scalar:
    """Number type of generated code.

    Attributes:
        name: One of `TYPES`.
        lanes: Numbers in a vector; 1 for scalar code.
    """

    name: str = "float64"
    lanes: int = 1

    @property
    def c(self) -> str:
        """C type of one number."""
        return TYPES[self.name][0]

    @property
    def bytes(self) -> int:
        """Size of all lanes in bytes."""
        return TYPES[self.name][2] * self.lanes

    def prelude(self) -> str:
        """Return the C source that defines the vector type V, its arithmetic and its functions."""
        c, integer, _ = TYPES[self.name]
        lines = [
            "#include <math.h>",
            f"#define S {c}",
            f"#define SCALAR(name) {IN_LIBRARY[self.name]}",
            "#define INLINE static inline __attribute__((always_inline, unused))",
            "#define SELDOM static __attribute__((noinline, cold, unused))",
            {
                "float64": "#define DOUBLE\n#define SCALAR_FMA __builtin_fma",
                "float32": "#define SCALAR_FMA __builtin_fmaf",
                "float128": "#include <quadmath.h>",
            }.get(self.name, ""),
        ]
        if self.lanes > 1:
            vector = text_of("vector.h").replace("/* intrinsics.h */", text_of("intrinsics.h"))
            lines += [f"#define I {integer}", f"#define W {self.lanes}", vector]
        else:
            lines += [text_of("scalar.h")]
        lines += [functions(), _sines(self)]
        return "\n".join(lines)

    def moves(self) -> str:
        """Return the C source that moves numbers into several lanes and out of them."""
        lanes = range(self.lanes)
        rows = f"#define ROWS(row, k) {', '.join(f'(row)[{i}][k]' for i in lanes)}"
        return "\n".join([moves_of_copies(self.lanes), rows, text_of("lanes.h")])


def moves_of_copies(lanes: int) -> str:
    """Return the C source that moves numbers between the lanes of vectors, which hold copies."""
    entries = ", ".join(f"(from)[(at)[{i}]]" for i in range(lanes))
    return f"#define FROM(from, at) {entries}\n{text_of('copies.h')}"


def functions() -> str:
    """Return the C source of the functions of kernels."""
    every = [*(f"LANES1({name}" for name in OF_ONE), *(f"LANES2({name}" for name in OF_TWO)]
    lines = [f"{one}, SCALAR({one[7:].lower()}))" for one in every]
    return text_of("functions.h").replace("/* library */", "\n".join(lines))


def _sines(scalar: Scalar) -> str:
    """Return the C source of SINCOS; for "longdouble" and "float128" also of SQRT and FABS."""
    if scalar.name not in ("float64", "float32"):
        return "\n".join(
            [
                "LANES1(SQRT, SCALAR(sqrt))",
                "LANES1(FABS, SCALAR(fabs))",
                "INLINE void SINCOS(V x, V *s, V *c) { *s = SCALAR(sin)(x); *c = SCALAR(cos)(x); }",
            ]
        )
    roots = [
        "INLINE V SQRT(V x) { return SCALAR(__builtin_sqrt)(x); }",
        "INLINE V FABS(V x) { return SCALAR(__builtin_fabs)(x); }",
    ]
    return "\n".join([*(roots if scalar.lanes == 1 else []), own_sines(scalar.lanes)])


def own_sines(lanes: int) -> str:
    """Return the C source of SINCOS in float64 and float32."""
    own = "sines_vector.h" if lanes > 1 else "sines_scalar.h"
    return text_of(own).replace("/* trigonometry.h */", text_of("trigonometry.h"))


@cache
def text_of(name: str) -> str:
    """Read one of the C sources of the folder `c`."""
    return (resources.files("hybridyn.compiled") / "c" / name).read_text()
