"""Number types of generated code: C type, lanes of a vector, and their arithmetic."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib import resources

#: Size of each number type [bytes].
BYTES = {"float64": 8, "float32": 4, "float128": 16}

#: C types of a robot's models: those that a caller may ask for.
REAL = {"float64": "double", "float32": "float"}

#: Functions of the C library that kernels call, of one number and of two; those of `LIBRARY` are others.
OF_ONE = (
    "TAN", "ASIN", "ACOS", "ATAN", "SINH", "COSH", "ASINH", "ACOSH", "ATANH", "EXPM1", "LOG", "LOG1P",
    "FLOOR", "CEIL", "ERF",
)  # fmt: skip
OF_TWO = ("ATAN2", "FMOD", "REMAINDER", "HYPOT", "COPYSIGN", "POW")
#: Functions of plain numbers that have the same name in the C library.
FUNCTIONS = ("SQRT", "FABS", *OF_ONE, *OF_TWO)

#: Largest guard at which a sample is trusted.
GUARD_LIMIT = 1.0

#: Functions that have C of their own, in lanes, as the C library has them.
LIBRARY = """INLINE void SINCOS(V x, V *s, V *c) {
    for (int i = 0; i < W; i++) {
        LANE(*s, i) = SCALAR(sin)(LANE(x, i));
        LANE(*c, i) = SCALAR(cos)(LANE(x, i));
    }
}
INLINE V TANH(V x) {
    for (int i = 0; i < W; i++) LANE(x, i) = SCALAR(tanh)(LANE(x, i));
    return x;
}
INLINE V EXP(V x) {
    for (int i = 0; i < W; i++) LANE(x, i) = SCALAR(exp)(LANE(x, i));
    return x;
}"""
#: The definitions of `plain.h` for "float128".
WIDE = """#include <quadmath.h>
typedef __float128 S;
#define SCALAR(name) name##q
#define INLINE static inline __attribute__((always_inline, unused))"""


@dataclass(frozen=True)
class Scalar:
    """Number type of generated code.

    Attributes:
        name: One of `BYTES`.
        lanes: Numbers in a vector; 1 for scalar code.
    """

    name: str = "float64"
    lanes: int = 1

    @property
    def bytes(self) -> int:
        """Size of all lanes in bytes."""
        return BYTES[self.name] * self.lanes

    def prelude(self) -> str:
        """Return the C source that defines the vector type V, its arithmetic and its functions."""
        wide = self.name == "float128"
        head = WIDE if wide else f"{single(self.name)}{c_text('plain.h')}"
        return f"#include <math.h>\n{head}\n{arithmetic(self.lanes)}\n{LIBRARY if wide else of_doubles()}"

    def moves(self) -> str:
        """Return the C source that moves numbers into lanes and out of them."""
        rows = f"#define ROWS(row, k) {', '.join(f'(row)[{i}][k]' for i in range(self.lanes))}"
        return "\n".join([moves_of_copies(self.lanes), rows, c_text("lanes.h")])


def single(dtype: str) -> str:
    """Return what stands before `plain.h`."""
    return "#define SINGLE\n" if dtype == "float32" else ""


def arithmetic(lanes: int) -> str:
    """Return the C source of the arithmetic and the functions of kernels, after `plain.h`; not `LIBRARY`."""
    if lanes == 1:
        return "\n".join([c_text("scalar.h"), *(f"#define {x} SCALAR({x.lower()})" for x in FUNCTIONS)])
    every = [*(f"LANES1({name}" for name in OF_ONE), *(f"LANES2({name}" for name in OF_TWO)]
    functions = [f"{one}, SCALAR({one[7:].lower()}))" for one in every]
    return "\n".join([f"#define W {lanes}", c_text("vector.h"), *functions])


def of_doubles() -> str:
    """Return the C source of the functions of `LIBRARY` in lanes; they count on `EXACT`."""
    return "".join(c_text(name) for name in ("doubles.h", "sines.h", "tanh.h", "exp.h"))


def moves_of_copies(lanes: int) -> str:
    """Return the C source that moves numbers between the lanes of vectors, which hold copies."""
    if lanes == 1:
        return ""
    entries = ", ".join(f"(from)[(at)[{i}]]" for i in range(lanes))
    return f"#define FROM(from, at) {entries}\n{c_text('copies.h')}"


@cache
def c_text(name: str) -> str:
    """Read one of the C sources of the folder `c`."""
    return (resources.files("hybridyn.compiled") / "c" / name).read_text()
