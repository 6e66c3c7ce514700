"""Programs as native Warp functions: the plain numbers of exported C, on the stack; and kernels of them.

The programs are static members of a structure that is local to the function, so that nothing of them is seen
outside of it. Macros are undefined at the end. Only this file imports Warp.
"""

from __future__ import annotations

import hashlib
import itertools
import linecache
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module, resources
from importlib.util import find_spec
from typing import Any

from ..compiled import GUARD_LIMIT, Program, sample_code, stored
from ..description.names import did_you_mean

#: Warp; None where it is not installed, as where the pages are built.
wp: Any = import_module("warp") if find_spec("warp") else None

#: Python of the function and of kernels that call it: in each thread, and for each sample.
STUB = "@wp.func_native(text)\ndef {name}({arguments}){returns}:\n    ...\n"
EACH = """@wp.kernel(module="unique", enable_backward=False)
def kernel({arguments}, count: int, threads: int):
    function({names}, wp.tid(), threads, count)
"""
KERNEL = """@wp.kernel(module="unique", enable_backward=False)
def kernel({arguments}, guard: wp.array(dtype=S), failed: wp.array(dtype=wp.int32)):
    i = wp.tid()
    worst = function({rows})
    guard[i] = worst
    if not (worst <= S({limit})):
        wp.atomic_add(failed, 0, 1)
"""
#: Further arguments of the function of a thread.
THREAD = ("thread: int", "threads: int", "count: int")
_numbers = itertools.count()

#: Names and sizes of inputs, and of outputs.
Ends = tuple[Sequence[tuple[str, int]], Sequence[tuple[str, int]]]
#: Mark of a function of the device.
ON_DEVICE = "CUDA_CALLABLE "
#: What the C of programs needs before it, beside `scalar.h`.
HEAD = """#define restrict __restrict__
#if defined(__CUDA_ARCH__) || defined(__FMA__)
#define FAST_FMA
#endif
#define INLINE static CUDA_CALLABLE inline"""


@dataclass(frozen=True)
class Native:
    """A native function of one sample, which returns the guard.

    Attributes:
        name: Its name.
        inputs: Name and width of each array that it reads.
        outputs: Name and width of each array that it writes: NaN where the guard is above its limit.
        text: C of its body; the arrays have the names above.
        by_modules: How kernels compute it module by module, if they do.
    """

    name: str
    inputs: tuple[tuple[str, int], ...]
    outputs: tuple[tuple[str, int], ...]
    text: str
    by_modules: ByModules | None = None


@dataclass(frozen=True)
class ByModules:
    """A function that is computed for each module of each sample, then for each sample.

    Attributes:
        each: The function of a thread, which closes some modules of all samples: its arrays have all rows,
            its last output is the modules' guards. It also reads its number, that of threads, and samples.
        last: The function of a sample; its last input has the modules' guards.
        count: Number of modules.
    """

    each: Native
    last: Native
    count: int


def native(
    name: str, ends: Ends, programs: Mapping[str, Program], run: str, dtype: str, more: str = ""
) -> Native:
    """Return a native function.

    Args:
        ends: Its inputs and outputs.
        programs: Programs that it calls, by name.
        run: C expression of the guard, from `given` (all inputs one after the other) and `result`.
        more: C of members of the structure that follow the programs.
    """
    inputs, outputs = (tuple(end) for end in ends)
    given, result = (max(sum(size for _, size in end), 1) for end in (inputs, outputs))
    read = "\n".join(_moved(n, size, f"given[{at} + k] = {{}}") for n, size, at in stored(inputs))
    written = "\n".join(_moved(n, size, f"{{}} = result[{at} + k]") for n, size, at in stored(outputs))
    lines = [
        f"S given[{given}], result[{result}];",
        read,
        f"const S guard = Code::{run};",
        f"if (!(guard <= {GUARD_LIMIT}))",
        f"    for (int k = 0; k < {result}; k++) result[k] = (S)(HUGE_VAL - HUGE_VAL);",
        written,
    ]
    return Native(name, inputs, outputs, _body(programs, dtype, more, lines))


def of_program(program: Program, dtype: str) -> Native:
    """Return the native function that is one program, by its name."""
    name, ends = program.name, (program.inputs, program.outputs)
    return native(name, ends, {name: program}, f"{name}_run(given, result)", dtype)


def on_rows(
    name: str, ends: Ends, programs: Mapping[str, Program], run: str, dtype: str, more: str
) -> Native:
    """Return a native function like `native`, whose C reads and writes the arrays in place.

    Args:
        ends, programs, more: As for `native`; the C has a structure `Row` (`rows.h`).
        run: C expression of the guard, from rows named after the arrays, as `near_row`.
    """
    inputs, outputs = (tuple(end) for end in ends)
    rows = (
        f"const Code::Row {array}_row = {{(char *){array}.data, (long long){array}.strides[0]}};"
        for array, _ in (*inputs, *outputs)
    )
    unknown = (
        f"for (int k = 0; k < {size}; k++) {array}_row[k] = (S)(HUGE_VAL - HUGE_VAL);"
        for array, size in outputs
    )
    lines = [*rows, f"const S guard = Code::{run};", f"if (!(guard <= {GUARD_LIMIT})) {{", *unknown, "}"]
    return Native(name, inputs, outputs, _body(programs, dtype, more, lines))


def on_tables(name: str, ends: Ends, run: str, dtype: str, more: str) -> Native:
    """Return a native function of a thread, see `ByModules`.

    Args:
        ends, more: As for `on_rows`.
        run: C call, with tables named after the arrays, as `near_table`.
    """
    inputs, outputs = (tuple(end) for end in ends)
    strides = "(long long){0}.strides[0], (long long){0}.strides[1]"
    tables = (
        f"const Code::Table {array}_table = {{(char *){array}.data, {strides.format(array)}}};"
        for array, _ in (*inputs, *outputs)
    )
    return Native(name, inputs, outputs, _body({}, dtype, more, [*tables, f"Code::{run};"], answers=False))


def _body(
    programs: Mapping[str, Program], dtype: str, more: str, lines: Sequence[str], *, answers: bool = True
) -> str:
    """Return the C of a body: the structure of programs and more, then lines; it `answers` their `guard`."""
    code = sample_code(programs, dtype, HEAD)
    members = f"{code.functions}\n{more}"
    text = [
        code.head,
        f"struct Code {{\n{_on_device(members)}\n}};",
        *lines,
        "const S answer = guard;" if answers else "",
        *undefined(f"{code.head}\n{members}"),
        "return answer;" if answers else "",
    ]
    return "\n" + "\n".join(text) + "\n"


def undefined(text: str) -> list[str]:
    """Return the lines that forget the macros of C."""
    return [f"#undef {name}" for name in dict.fromkeys(re.findall(r"#define (\w+)", text))]


def own_text(file: str) -> str:
    """Return one of the C sources of the folder `c` of this room."""
    return (resources.files("hybridyn.warp_batch") / "c" / file).read_text()


def sizes_text(**sizes: int | str) -> str:
    """Return the C of an enumeration of sizes."""
    return f"enum {{ {', '.join(f'{name} = {size}' for name, size in sizes.items())} }};\n"


def _moved(array: str, size: int, move: str) -> str:
    """Return the C of a loop over the numbers of an array of Warp."""
    at = f"*(S *)((char *){array}.data + (size_t)k * {array}.strides[0])"
    return f"for (int k = 0; k < {size}; k++) {move.format(at)};"


def _on_device(text: str) -> str:
    """Mark the functions of C for the device."""
    return re.sub(
        r"^static (?=(?:inline )?(?:void|int|S|V) \*?\w+\()", f"static {ON_DEVICE}", text, flags=re.M
    )


@dataclass(frozen=True, eq=False)
class InWarp:
    """A native function in Warp.

    Attributes:
        native: What it computes.
        function: The Warp function: one-dimensional arrays of its inputs and outputs, in this order; it
            returns the guard.
        kernel: The kernel that calls it for each row of two-dimensional arrays; then guards, shape (N,), and
            a counter of guards above 1, shape (1,). Where `before` is, it reads the modules' guards, too.
        before: The kernel of threads that compute each module of each row; then their guards, shape
            (N, modules), N, and the number of threads. None where one kernel computes all.
    """

    native: Native
    function: Any
    kernel: Any
    before: Any = None

    @property
    def kernels(self) -> list[Any]:
        """All kernels, in the order in which they run."""
        return [kernel for kernel in (self.before, self.kernel) if kernel is not None]


def in_warp(native: Native, dtype: str) -> InWarp:
    """Return a native function in Warp; Warp compiles it when it is first launched."""
    function, parts = _function(native, dtype), native.by_modules
    if parts is None:
        return InWarp(native, function, _kernel(KERNEL, native, function, dtype))
    each = _kernel(EACH, parts.each, _function(parts.each, dtype, THREAD, ndim=2, returns=""), dtype)
    last = _kernel(KERNEL, parts.last, _function(parts.last, dtype), dtype)
    return InWarp(native, function, last, each)


def _function(
    native: Native, dtype: str, more: Sequence[str] = (), *, ndim: int = 1, returns: str = " -> S"
) -> Any:
    """Return the Warp function of one sample; of a thread it has `more` arguments, and whole arrays."""
    # Warp knows functions by their names
    called = f"{native.name}_{hashlib.sha256(native.text.encode()).hexdigest()[:12]}"
    arrays = (f"{name}: wp.array(dtype=S, ndim={ndim})" for name, _ in (*native.inputs, *native.outputs))
    stub = STUB.format(name=called, arguments=", ".join([*arrays, *more]), returns=returns)
    return defined(stub, called, {"S": getattr(wp, dtype), "text": native.text})


def _kernel(text: str, native: Native, function: Any, dtype: str) -> Any:
    """Return the kernel of a Python text that calls a function for rows."""
    names = [name for name, _ in (*native.inputs, *native.outputs)]
    arguments = ", ".join(f"{name}: wp.array(dtype=S, ndim=2)" for name in names)
    rows = ", ".join(f"{n}[i]" for n in names)
    written = text.format(arguments=arguments, names=", ".join(names), rows=rows, limit=GUARD_LIMIT)
    return defined(written, "kernel", {"S": getattr(wp, dtype), "function": function})


def defined(text: str, name: str, scope: dict[str, Any]) -> Any:
    """Return a function of a Python text, which Warp reads again."""
    file = f"<hybridyn.warp {next(_numbers)}>"
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
    found = scope | {"wp": wp, "__name__": __name__}
    exec(compile(text, file, "exec", dont_inherit=True), found)  # annotations are types
    return found[name]


class Functions:
    """Warp functions for kernels of the user's own, by name.

    Each takes one-dimensional arrays of one sample, inputs first, and returns the guard. Outputs are NaN
    where the guard is above 1.
    """

    def __init__(self, names: Sequence[str], make: Callable[[str], InWarp]) -> None:
        self._names, self._make = tuple(names), make

    def __getattr__(self, name: str) -> Any:
        """Return a Warp function."""
        if name.startswith("_") or name not in self._names:
            raise AttributeError(f"a batch has no function '{name}'{did_you_mean(name, self._names)}")
        return self._make(name).function

    def __dir__(self) -> list[str]:
        """List the functions."""
        return list(self._names)
