"""Small programs with everything a program may have."""

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from hybridyn.compiled.code.library_source import Source
from hybridyn.compiled.library.artifact import Artifact
from hybridyn.compiled.library.cache import Built
from hybridyn.compiled.library.calls import Library
from hybridyn.compiled.library.direct_calls import REFUSED
from hybridyn.compiled.program import (
    Add,
    Call,
    Constants,
    Each,
    GivenPlace,
    Kernel,
    Own,
    Program,
    ResultPlace,
    Shared,
    Start,
    Worst,
)

OPERATIONS = (
    lambda a, b, c: a * b + c,
    lambda a, b, c: a - b * c,
    lambda a, b, c: -a * b,
    lambda a, b, c: (a - b) / (1 + c * c),
    lambda a, b, c: ca.sin(a),
    lambda a, b, c: ca.cos(a),
    lambda a, b, c: ca.sqrt(1 + a * a),
    lambda a, b, c: ca.tanh(a),
    lambda a, b, c: ca.atan2(a, 1.5 + b * b),
    lambda a, b, c: ca.if_else(a < b, c, -a),
    lambda a, b, c: ca.fmax(a, b),
    lambda a, b, c: ca.fabs(a) * 0.25,
    lambda a, b, c: ca.sin(2 * a) - ca.cos(2 * a),
)
KERNEL_SIZE = 20  # operations of a random kernel


def random_function(
    rng: np.random.Generator, name: str, inputs: list[int], outputs: list[int]
) -> ca.Function:
    """Return a function of random operations whose values stay moderate."""
    columns = [ca.SX.sym(f"i{k}", size) for k, size in enumerate(inputs)]
    values: list[Any] = [x[k] for x in columns for k in range(x.numel())] or [ca.SX(0.7)]

    def pick() -> Any:
        return values[rng.integers(len(values))]

    for _ in range(KERNEL_SIZE):
        value = OPERATIONS[rng.integers(len(OPERATIONS))](pick(), pick(), pick())
        values.append(value / (1 + ca.fabs(value) * 0.01))
    ends = [ca.vertcat(*(pick() for _ in range(size))) if size else ca.SX(0, 1) for size in outputs]
    return ca.Function(name, columns, ends)


def toy(seed: int, copies: int) -> Program:
    """Return a program of legs, a module and legs again, with every kind of source and target."""
    rng = np.random.default_rng(seed)
    legs = Kernel("legs", random_function(rng, "legs", [3, 2, 2], [3, 2, 1, 4]), "legs")
    module = Kernel("module", random_function(rng, "module", [2, 2, 3], [3, 0, 1]), "module")
    after = Kernel("after", random_function(rng, "after", [3, 3, 4, 2], [2, 2]), "legs")
    last = Kernel("last", random_function(rng, "last", [4, 2, 2], [3, 2]), "module")
    behind = 3 * copies
    places = rng.permutation(3 * copies).reshape(copies, 3)
    in_a_row = np.arange(3 * copies).reshape(copies, 3)
    twos = rng.permutation(2 * copies).reshape(copies, 2)
    own, each, sums, more = 0, 10, 2, 10 + 4 * copies
    steps: tuple[Start | Call, ...] = (
        Start(0, rng.normal(size=2)),
        Start(sums, rng.normal(size=2)),
        Call(
            0,
            copies,
            (
                GivenPlace(places if seed % 2 else in_a_row),
                Constants(rng.normal(size=(copies, 2))),
                Shared(0, 2),
            ),
            (Own(own, 3), Add(sums, 2), Worst(), Each(each, 4)),
        ),
        Call(
            1,
            1,
            (Shared(sums, 2), Constants(rng.normal(size=(1, 2))), GivenPlace(np.array([[behind, 0, 1]]))),
            (Shared(4, 3), Shared(0, 0), Worst()),
        ),
        Call(
            2,
            copies,
            (Own(own, 3), Shared(4, 3), Each(each, 4), GivenPlace(twos)),
            (ResultPlace(twos), Each(more, 2)),
        ),
        Call(
            3,
            1,
            (Shared(each, 4), ResultPlace(np.array([[0, 2 * copies - 1]])), Shared(0, 2)),
            (ResultPlace(2 * copies + np.array([[2, 0, 1]])), Shared(0, 2)),
        ),
        Call(
            1, 1, (Shared(0, 2), Constants(np.ones((1, 2))), Shared(4, 3)), (Add(4, 3), Shared(0, 0), Worst())
        ),
        Call(
            3,
            1,
            (Shared(4, 4), Shared(0, 2), Shared(sums, 2)),
            (ResultPlace(2 * copies + np.array([[3, 4, 5]])), Add(7, 2)),
        ),
    )
    steps = (Start(7, np.ones(3)), *steps)
    return Program(
        f"toy{seed}_{copies}",
        (("q", 3 * copies), ("v", 1)),
        (("a", 2 * copies), ("b", 6)),
        (legs, module, after, last),
        steps,
        more + 2 * copies,
        3 * copies,
    )


def double() -> Program:
    """Return the smallest program: it doubles a number."""
    x, place = ca.SX.sym("x"), np.zeros((1, 1), dtype=int)
    kernel = Kernel("double", ca.Function("double", [x], [2.0 * x]), "module")
    call = Call(0, 1, (GivenPlace(place),), (ResultPlace(place),))
    return Program("double", (("x", 1),), (("y", 1),), (kernel,), (call,), 0, 0)


def inputs(program: Program, samples: int, seed: int = 0) -> list[np.ndarray[Any, Any]]:
    """Return random inputs of a program, shapes (samples, n)."""
    rng = np.random.default_rng(seed)
    return [rng.normal(size=(samples, size)) for _, size in program.inputs]


def single(library: Library, name: str, *given: Any) -> tuple[tuple[np.ndarray[Any, Any], ...], float]:
    """Run one sample of a program alone; return its outputs, shapes (n,), and its guard."""
    calls = library.programs[name]
    out, guard = np.empty(calls.size, calls.dtype), np.empty(1, calls.dtype)
    assert calls.at_once is not None
    assert calls.at_once(*(np.array(x, calls.dtype, ndmin=1) for x in given), out, guard) != REFUSED
    return calls.split(out), float(guard[0])


def cached(
    key: str,
    write: Callable[[], Source],
    check: Callable[[Built], None] | None = None,
    robot: Any = None,
    **options: Any,
) -> Built:
    """Return the library of a key, by default one that belongs to no robot."""
    return Artifact(robot, key, write, check).built(**options)


def numbered(number: int) -> Source:
    """Return the source of a library that knows its number, built at once."""
    visible = '__attribute__((visibility("default")))'
    return Source({"number": f"{visible} int number(void) {{ return {number}; }}\n"}, {"number": number})


def never() -> Source:
    """Fail where a library is built that is there."""
    raise AssertionError("it is there, and need not be built")
