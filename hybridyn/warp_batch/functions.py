"""Make Warp functions and kernels of native functions. Only this file imports Warp."""

from __future__ import annotations

import hashlib
import itertools
import linecache
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from ..compiled.code.scalars import GUARD_LIMIT
from .native import Native

#: Warp; None where it is not installed, as where the pages are built.
wp: Any = import_module("warp") if find_spec("warp") else None

#: Python of the function and of the kernel that calls it for each sample.
STUB = "@wp.func_native(text)\ndef {name}({arguments}) -> S:\n    ...\n"
KERNEL = """@wp.kernel(module="unique", enable_backward=False)
def kernel({arguments}, guard: wp.array(dtype=S), failed: wp.array(dtype=wp.int32)):
    i = wp.tid()
    worst = function({rows})
    guard[i] = worst
    if not (worst <= S({limit})):
        wp.atomic_add(failed, 0, 1)
"""
_numbers = itertools.count()


@dataclass(frozen=True, eq=False)
class InWarp:
    """A native function in Warp.

    Attributes:
        native: What it computes.
        function: The Warp function: one-dimensional arrays of its inputs and outputs, in this order; it
            returns the guard.
        kernel: The kernel that calls it for each row of two-dimensional arrays; then guards, shape (N,), and
            a counter of guards above 1, shape (1,).
    """

    native: Native
    function: Any
    kernel: Any


def in_warp(native: Native, dtype: str) -> InWarp:
    """Return a native function in Warp; Warp compiles it when it is first launched."""
    key = hashlib.sha256(native.text.encode()).hexdigest()[:12]
    called = f"{native.name}_{key}"  # Warp knows functions by their names
    names = [name for name, _ in (*native.inputs, *native.outputs)]
    scope = {"S": getattr(wp, dtype)}
    row, rows = (f"wp.array(dtype=S{ndim})" for ndim in ("", ", ndim=2"))
    stub = STUB.format(name=called, arguments=", ".join(f"{name}: {row}" for name in names))
    function = defined(stub, called, scope | {"text": native.text})
    arguments = ", ".join(f"{name}: {rows}" for name in names)
    text = KERNEL.format(arguments=arguments, rows=", ".join(f"{n}[i]" for n in names), limit=GUARD_LIMIT)
    return InWarp(native, function, defined(text, "kernel", scope | {"function": function}))


def defined(text: str, name: str, scope: dict[str, Any]) -> Any:
    """Return a function of a Python text, which Warp reads again."""
    file = f"<hybridyn.warp {next(_numbers)}>"
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
    found = scope | {"wp": wp, "__name__": __name__}
    exec(compile(text, file, "exec", dont_inherit=True), found)  # annotations are types
    return found[name]
