"""Generate the C sources of one library from programs."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from ..program import Call, Program, stored
from .c_tables import Tables
from .drivers import COPIES_HEAD, HEAD, MOVES, across_copies, across_samples, summed
from .kernels import kernel_graph, kernel_text
from .rules import check, trimmed
from .scalars import GUARD_LIMIT, Scalar, c_text
from .sections import CALLED_ALONE, placed, section
from .steps_source import steps_in_c, steps_source

#: Largest number of statements of one C file of kernels; each file is compiled by its own process.
STATEMENTS_PER_UNIT = 4000
#: Lines of calls after which a C file of batches is full. Small programs share what stands before them, which
#: takes a compiler longest; those of large robots are compiled beside each other.
CALLS_PER_UNIT = 100
#: Widest input or output of which the next rows are fetched ahead; more would drive out the workspace.
FETCHED = 512
#: First line of the driver of batches, which fetches the rows that come next between its kernels: all at once
#: would wait for memory, a fifth of the time of a long batch.
BATCH = HEAD.replace("_samples(", "_rows(").replace(")", ", const B *const *in, B *const *out, Long s)")


@dataclass(frozen=True)
class Source:
    """C sources of a library and the description of its programs.

    Attributes:
        units: Contents of the C files by name.
        about: Description of the programs for `library.Library`, in JSON types.
    """

    units: Mapping[str, str]
    about: dict[str, Any]

    @property
    def digest(self) -> str:
        """Hash of the sources."""
        return hashlib.sha256("\0".join(self.units.values()).encode()).hexdigest()


class _Printed:
    """A program and its kernels in C, arguments and body by name.

    Attributes:
        names: Name of each kernel.
        adding: Name of each kernel in batches, where legs add their sums in place.
        sums: These sums, by kernel; none on one lane.
        bodies: The kernels.
        plain: Those that single calls run on plain numbers, too: their names there, by their names.
        parts: C that puts kernels into the section of the program's single calls, by name.
    """

    def __init__(self, program: Program, lanes: int) -> None:
        self.program = program = trimmed(program)
        check(program)
        self.sums = summed(program) if lanes > 1 else {}
        graphs = [kernel_graph(kernel) for kernel in program.kernels]
        texts = [kernel_text(graph) for graph in graphs]
        adding = [
            kernel_text(graphs[k], self.sums[k]) if self.sums.get(k) else text for k, text in enumerate(texts)
        ]
        self.names, self.adding = ([_named(text) for text in every] for every in (texts, adding))
        self.bodies = dict(zip([*self.names, *self.adding], [*texts, *adding], strict=True))
        single = lanes > 1 and program.name in CALLED_ALONE
        called = [(self.names[step.kernel], step.copies) for step in self.calls if single]
        self.plain = {name: f"n{name[1:]}" for name, copies in called if copies == 1}
        own = [*self.plain.values(), *(name for name, copies in called if copies > 1)]
        self.parts = dict.fromkeys(own, placed(program))

    @property
    def calls(self) -> list[Call]:
        """The calls of kernels."""
        return [step for step in self.program.steps if isinstance(step, Call)]

    def about(self, size: int) -> dict[str, Any]:
        """Return the description of the program for its callers; `size` of a vector [bytes]."""
        lengths = [self.bodies[name].count("\n") for name in self.names]
        return {
            "inputs": [list(x) for x in self.program.inputs],
            "outputs": [list(x) for x in self.program.outputs],
            "work": (sum(self.program.sizes) + 1) * size,
            "statements": sum(call.copies * lengths[call.kernel] for call in self.calls),
        }


def _named(text: str) -> str:
    """Return the name of a kernel from its arguments and body."""
    return f"k{hashlib.sha256(text.encode()).hexdigest()[:12]}"


def library_source(programs: list[Program], scalar: Scalar, more: str = "") -> Source:
    """Generate the sources of programs.

    Args:
        programs: The programs, with unique names.
        scalar: Number type and lanes; with several lanes, single calls spread copies over them.
        more: C that calls the programs.
    """
    every = [_Printed(program, scalar.lanes) for program in programs]
    bodies = {name: text for printed in every for name, text in printed.bodies.items()}
    parts = {name: part for printed in every for name, part in printed.parts.items()}
    units = _numbered("kernels", _kernel_units(bodies, scalar, parts))
    units |= _numbered("batches", _batch_units(every, scalar))
    if scalar.lanes > 1 or more:
        units["calls"] = _driver_unit(every, bodies, scalar, more)
    again = {plain: bodies[name] for printed in every for name, plain in printed.plain.items()}
    texts = _kernel_units(again, Scalar(scalar.name), parts)
    units |= _numbered("plain_kernels", texts)
    about = {
        "number": scalar.name,
        "lanes": scalar.lanes,
        "programs": {printed.program.name: printed.about(scalar.bytes) for printed in every},
        "steps": steps_in_c(programs, scalar),
    }
    return Source(units, about)


def _numbered(name: str, texts: Iterable[str]) -> dict[str, str]:
    """Return contents of files by numbered names."""
    return {f"{name}{k}": text for k, text in enumerate(texts)}


def _kernel_units(bodies: Mapping[str, str], scalar: Scalar, parts: Mapping[str, str]) -> list[str]:
    """Distribute the kernels, longest first, over files of about `STATEMENTS_PER_UNIT` statements."""
    units: list[list[str]] = []
    room = 0
    for name, text in sorted(bodies.items(), key=lambda item: -item[1].count("\n")):
        length = text.count("\n")
        if not units or room + length > STATEMENTS_PER_UNIT:
            units.append([scalar.prelude(), c_text("driver.h"), c_text("fetching.h")])
            room = 0
        units[-1].append(f"{parts.get(name, '')}void {name}{text}\n")
        room += length
    return ["\n".join(unit) for unit in units]


def _batch_units(every: Iterable[_Printed], scalar: Scalar) -> list[str]:
    """Distribute the batches of programs over files, which are full after `CALLS_PER_UNIT` lines."""
    files: list[tuple[Tables, dict[str, str], list[str]]] = []
    room = 0
    for printed in every:
        if room <= 0:
            files.append((Tables(), {}, []))
            room = CALLS_PER_UNIT
        tables, called, drivers = files[-1]
        called |= {name: printed.bodies[name] for name in printed.adding}
        between = f"{printed.program.name}_ahead(in, out, s + W, {{t}});"
        rows = across_samples(printed.program, printed.adding, tables, BATCH, between, printed.sums)
        drivers += [_ahead(printed.program), rows, _batch(printed.program)]
        room -= rows.count("\n")
    return [
        "\n\n".join([driver_prelude(called, scalar), tables.text, *drivers]) + "\n"
        for tables, called, drivers in files
    ]


def _driver_unit(every: Iterable[_Printed], bodies: Mapping[str, str], scalar: Scalar, more: str) -> str:
    """Return the file with single calls and `more`; they use kernels on plain numbers, too."""
    tables = Tables()
    drivers, numbers = [], []
    for printed in every:
        program = printed.program
        if more:
            drivers.append(across_samples(program, printed.adding, tables, sums=printed.sums))
        if scalar.lanes > 1:
            head = placed(program) + COPIES_HEAD
            drivers.append(across_copies(program, printed.names, scalar.lanes, tables, head, printed.plain))
            drivers.append(_single(program))
        numbers += [
            f"void {plain}{argument_names(bodies[name]).replace('V *', 'S *')};"
            for name, plain in printed.plain.items()
        ]
    programs = [printed.program for printed in every]
    if steps_in_c(programs, scalar):
        drivers.append(steps_source(programs))
    arrays = c_text("numpy_array.h") if scalar.lanes > 1 else ""
    before = [driver_prelude(bodies, scalar), arrays, *numbers]
    return "\n\n".join([*before, tables.text, *drivers, more]) + "\n"


def argument_names(text: str) -> str:
    """Return the arguments of a kernel."""
    return text[: text.index("{")]


def driver_prelude(bodies: Mapping[str, str], scalar: Scalar) -> str:
    """Return the C before the drivers: definitions, copying functions, and declarations of the kernels."""
    lines = [
        scalar.prelude(),
        f"#define B {'double' if scalar.name == 'float128' else 'S'}",
        f"#define GUARD_LIMIT {GUARD_LIMIT}",
        '#define EXPORT __attribute__((visibility("default")))',
        "#include <string.h>",
        c_text("driver.h"),
        MOVES,
        c_text("fetching.h"),
        scalar.moves(),
    ]
    return "\n".join([*lines, *(f"void {name}{argument_names(text)};" for name, text in bodies.items())])


def _ahead(program: Program) -> str:
    """Return the C function that fetches rows from s on, the share of the kernel that `t` others precede."""
    kernels = sum(step.copies for step in program.steps if isinstance(step, Call))
    lines = [f"INLINE void {program.name}_ahead(const B *const *in, B *const *out, Long s, int t) {{"]
    for name, entries, write in (("in", program.inputs, 0), ("out", program.outputs, 1)):
        for n, (_, size) in enumerate(entries):
            if kernels and 0 < size <= FETCHED:
                rows = f"{name}[{n}] + s * {size}, W * {size} * (Long)sizeof(B)"
                lines.append(f"    ahead({rows}, {write}, t, {kernels});")
    return "\n".join([*lines, "}"])


def _batch(program: Program) -> str:
    """Return the C function that runs samples `from` to `to`; the caller provides the memory `work`."""
    given, result, shared, _ = program.sizes
    reads, writes = (
        [
            f"        worst_yet += {move.format(n=n, size=size, at=at)}, {size}, valid);"
            for n, (_, size, at) in enumerate(stored(ends))
        ]
        for move, ends in (
            ("from_rows(given + {at}, in[{n}] + s * {size}", program.inputs),
            ("to_rows(out[{n}] + s * {size}, result + {at}", program.outputs),
        )
    )
    return "\n".join(
        [
            f"EXPORT void {program.name}_batch(Long from, Long to, const B *const *in, B *const *out,",
            "                                  B *guard, V *work) {",
            f"    V *given = work, *result = work + {given}, *shared = result + {result};",
            f"    V *own = shared + {shared};",
            "    for (Long s = from; s < to; s += W) {",
            "        const int valid = to - s < W ? (int)(to - s) : W;",
            "        V worst_yet = C(0);",
            *reads,
            f"        {program.name}_rows(given, result, shared, own, &worst_yet, in, out, s);",
            *writes,
            "        to_rows(guard + s, &worst_yet, 1, valid);",
            "    }",
            "}",
        ]
    )


def _single(program: Program) -> str:
    """Return the C functions that run one sample, from NumPy arrays and from pointers."""
    name, last = program.name, len(program.inputs)
    given, count, shared, own = program.sizes
    inputs = list(enumerate(stored(program.inputs)))
    fetch = [f"    FETCH({section(program)}, m->given, m->own);"] * (name in CALLED_ALONE)
    there = " && ".join([*(f"in[{n}]" for n, _ in inputs), "out"])
    return "\n".join(
        [
            f"static struct {{ S given[{max(given, 1)}], shared[{max(shared, 1)}]; V own[{max(own, 1)}]; }}",
            f"{name}_memory ALIGNED;",
            f"static int {name}_run(S *out, S *guard) {{",
            "    S worst_yet = 0;",
            f"    __typeof__({name}_memory) *m = &{name}_memory;",
            *fetch,
            f"    for (int k = 0; k < {given}; k++) worst_yet += m->given[k] * OVER * 0; /* large: NaN */",
            f"    {name}_copies(m->given, out, m->shared, m->own, &worst_yet);",
            f"    worst_yet += none_of(out, {count}); /* not finite: NaN */",
            "    if (guard) *guard = worst_yet;",
            "    return worst_yet <= GUARD_LIMIT ? 0 : 2;",
            "}",
            f"INLINE int {name}_at(const S *const *in, S *out, S *guard) {{",
            *(
                f"    memcpy({name}_memory.given + {at}, in[{n}], sizeof(S[{size}]));"
                for n, (_, size, at) in inputs
            ),
            f"    return {name}_run(out, guard);",
            "}",
            f"EXPORT int {name}_single_at(const S *const *in, S *out) {{ return {name}_at(in, out, 0); }}",
            f"EXPORT const void *{name}_call(const void *self, const Array *const *a, Long count) {{",
            "    (void)self; /* a function of Python, METH_FASTCALL */",
            f"    S *guard = count == {last + 2} ? numbers(a[{last + 1}], 1) : 0;",
            f"    if (count != {last + 1} && !guard) return answered(1);",
            f"    const S *const in[] = {{{', '.join(f'numbers(a[{n}], {x[1]})' for n, x in inputs)}}};",
            f"    S *out = numbers(a[{last}], {count});",
            f"    return answered({there} ? {name}_at(in, out, guard) : 1);",
            "}",
        ]
    )
