"""Generate the C sources of one library from programs."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Any

from ..program import Call, Program, stored
from .across_lanes import COPIES_HEAD, HEAD, across_copies, across_samples
from .alone import CALLED_ALONE, in_sections, memory, plain_kernels, section
from .drivers import Tables, moves, summed
from .kernels import kernel_graph, kernel_text
from .rules import check, trimmed
from .scalars import GUARD_LIMIT, Scalar, text_of

#: Largest number of statements of one C file of kernels; each file is compiled by its own process.
STATEMENTS_PER_UNIT = 4000
#: Widest input or output of which the next rows are fetched ahead; more would drive out the workspace.
FETCHED = 512
#: First line of the driver of batches, which fetches the rows that come next between its kernels: all at once
#: would wait for memory, a fifth of the time of a long batch.
BATCH = HEAD.replace("_samples(", "_rows(").replace(")", ", const B *const *in, B *const *out, Long s)")


@dataclass(frozen=True)
class Source:
    """C sources of a library and the description of its programs.

    Attributes:
        units: Contents of the C files.
        about: Description of the programs for `library.Library`, in JSON types.
    """

    units: tuple[str, ...]
    about: dict[str, Any]

    @property
    def digest(self) -> str:
        """Hash of the sources."""
        return hashlib.sha256("\0".join(self.units).encode()).hexdigest()


def library_source(programs: list[Program], scalar: Scalar, more: str = "") -> Source:
    """Generate the sources of programs.

    Args:
        programs: The programs, with unique names.
        scalar: Number type and lanes; with several lanes, single calls spread copies over them.
        more: C that calls the programs.
    """
    bodies: dict[str, str] = {}
    names: dict[str, list[str]] = {}
    adding: dict[str, list[str]] = {}  # in batches, where legs add their sums in place
    added: dict[str, dict[int, set[int]]] = {}  # these sums, by kernel; none on one lane
    programs = [trimmed(program) for program in programs]
    for program in programs:
        check(program)
        sums = added[program.name] = summed(program) if scalar.lanes > 1 else {}
        names[program.name], adding[program.name] = [], []
        for k, kernel in enumerate(program.kernels):
            graph = kernel_graph(kernel)
            name = _named(kernel_text(graph), bodies)
            names[program.name].append(name)
            adding[program.name].append(_named(kernel_text(graph, sums[k]), bodies) if k in sums else name)
    lengths = {name: text.count("\n") for name, text in bodies.items()}
    alone = programs if scalar.lanes > 1 else []
    plain = {p.name: plain_kernels(p, names[p.name], lengths) for p in alone}
    units = _kernel_units(bodies, scalar, in_sections(alone, names))
    units += [_batch_unit(p, adding[p.name], added[p.name], bodies, scalar) for p in programs]
    if alone or more:
        units.append(_driver_unit(programs, plain, names, adding, added, bodies, scalar, more))
    for program in alone:
        again = {called: bodies.pop(name) for name, called in plain[program.name].items() if name in bodies}
        texts = _kernel_units(again, Scalar(scalar.name, 1), dict.fromkeys(again, section(program)))
        units += [f"#ifndef QUICK\n{text}\n#endif\n" for text in texts]
    about = {
        "number": scalar.name,
        "lanes": scalar.lanes,
        "programs": {p.name: _about(p, scalar, [lengths[k] for k in names[p.name]]) for p in programs},
        "steps": steps_in_c(programs, scalar),
    }
    return Source(tuple(units), about)


def _named(text: str, bodies: dict[str, str]) -> str:
    """Return the name of a kernel, and add its arguments and body to those known."""
    name = f"k{hashlib.sha256(text.encode()).hexdigest()[:12]}"
    bodies[name] = text
    return name


def _about(program: Program, scalar: Scalar, lengths: list[int]) -> dict[str, Any]:
    """Return the description of a program for its callers."""
    calls = [step for step in program.steps if isinstance(step, Call)]
    return {
        "inputs": [list(x) for x in program.inputs],
        "outputs": [list(x) for x in program.outputs],
        "work": (sum(_sizes(program)) + 1) * scalar.bytes,
        "statements": sum(call.copies * lengths[call.kernel] for call in calls),
        "notes": list(program.notes),
    }


def _sizes(program: Program) -> tuple[int, int, int, int]:
    """Return the numbers of vectors in given, result, shared and own."""
    given, result = (sum(size for _, size in x) for x in (program.inputs, program.outputs))
    return given, result, program.shared, program.own


def _kernel_units(bodies: dict[str, str], scalar: Scalar, sections: dict[str, str]) -> list[str]:
    """Distribute the kernels, longest first, over files of about `STATEMENTS_PER_UNIT` statements."""
    prelude = "\n".join([scalar.prelude(), text_of("driver.h"), text_of("fetching.h")])
    parts: list[list[str]] = []
    room = 0
    for name, text in sorted(bodies.items(), key=lambda item: -item[1].count("\n")):
        length = text.count("\n")
        if not parts or room + length > STATEMENTS_PER_UNIT:
            parts.append([])
            room = 0
        place = f"IN_SECTION({sections[name]}) " if name in sections else ""
        parts[-1].append(f"{place}void {name}{text}")
        room += length
    return ["\n\n".join([prelude, *part]) + "\n" for part in parts]


def _batch_unit(
    program: Program, called: list[str], sums: dict[int, set[int]], bodies: dict[str, str], scalar: Scalar
) -> str:
    """Return the file with a program's batches; a file of its own is compiled beside the others."""
    tables = Tables()
    between = f"{program.name}_ahead(in, out, s + W, {{t}});"
    rows = across_samples(program, called, tables, BATCH, between, sums)
    kernels = {name: bodies[name] for name in called}
    parts = [driver_prelude(kernels, scalar), tables.text, _ahead(program), rows, _batch(program)]
    return "\n\n".join(parts) + "\n"


def _driver_unit(
    programs: list[Program], plain: dict[str, dict[str, str]], names: dict[str, list[str]],
    adding: dict[str, list[str]], added: dict[str, dict[int, set[int]]], bodies: dict[str, str],
    scalar: Scalar, more: str,
) -> str:  # fmt: skip
    """Return the file with single calls and `more`; they use the kernels `plain` on plain numbers."""
    tables = Tables()
    drivers = []
    for program in programs:
        called, sums = adding[program.name], added[program.name]
        if more:
            drivers.append(across_samples(program, called, tables, sums=sums))
        if scalar.lanes > 1:
            place = f"IN_SECTION({section(program)}) " if program.name in CALLED_ALONE else ""
            head = place + COPIES_HEAD
            called = names[program.name]
            quick, full = (
                across_copies(program, called, scalar.lanes, tables, head, on)
                for on in ({}, plain[program.name])
            )
            drivers.append(full if quick == full else f"#ifdef QUICK\n{quick}\n#else\n{full}\n#endif")
            drivers.append(_single(program))
    if steps_in_c(programs, scalar):
        drivers.append(_steps(programs))
    if more:
        drivers.append(more)
    again = {called: name for kernels in plain.values() for name, called in kernels.items()}
    numbers = [f"void {x}{_arguments(bodies[name]).replace('V *', 'S *')};" for x, name in again.items()]
    arrays = text_of("numpy_array.h") if scalar.lanes > 1 else ""
    return "\n\n".join([driver_prelude(bodies, scalar), arrays, *numbers, tables.text, *drivers]) + "\n"


def _arguments(text: str) -> str:
    """Return the arguments of a kernel."""
    return text[: text.index("{")]


def steps_in_c(programs: list[Program], scalar: Scalar) -> bool:
    """Return whether a library takes time steps in C: in double precision, with programs "lift" and "ddm"."""
    return scalar.name == "float64" and scalar.lanes > 1 and {"lift", "ddm"} <= {p.name for p in programs}


#: What `laws.h`, `lift.h` and `steps.h` need of every library, and the size of their memory.
STEPS = "#define STAGES 8\n#define LAST_STEP 1e-12\n#define LAW(name) law->name\n#define DDM ddm_single_at"
STEPS_WORK = "EXPORT Long steps_work = sizeof(Work);"


def _steps(programs: list[Program]) -> str:
    """Return the C of the time steps."""
    lift, ddm = (next(p for p in programs if p.name == name) for name in ("lift", "ddm"))
    sizes, names = dict(lift.outputs), {"NQ": "q", "NV": "xi_dot", "MODULES": "step"}
    defines = [f"#define {name} {sizes[key]}" for name, key in names.items()]
    defines.append(f"#define EFFORTS {dict(ddm.inputs)['tau']}")
    return "\n".join([*defines, STEPS, *map(text_of, ("laws.h", "lift.h", "steps.h")), STEPS_WORK])


def driver_prelude(bodies: dict[str, str], scalar: Scalar) -> str:
    """Return the C before the drivers: definitions, copying functions, and declarations of the kernels."""
    border = "double" if scalar.name == "float128" else "S"
    lines = [
        scalar.prelude(),
        f"#define B {border}",
        f"#define GUARD_LIMIT {GUARD_LIMIT}",
        '#define EXPORT __attribute__((visibility("default")))',
        "#include <string.h>",
        text_of("driver.h"),
        *moves("INLINE").values(),
        text_of("fetching.h"),
    ]
    if scalar.lanes > 1:
        lines.append(scalar.moves())
    else:
        lines.append(text_of("rows_scalar.h"))
    lines += [f"void {name}{_arguments(text)};" for name, text in bodies.items()]
    return "\n".join(lines)


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
    given, result, shared, _ = _sizes(program)
    reads = [
        f"        worst_yet += from_rows(given + {at}, in[{n}] + s * {size}, {size}, valid);"
        for n, (_, size, at) in enumerate(stored(program.inputs))
    ]
    writes = [
        f"        worst_yet += to_rows(out[{n}] + s * {size}, result + {at}, {size}, valid);"
        for n, (_, size, at) in enumerate(stored(program.outputs))
    ]
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
    given = _sizes(program)[0]
    count = sum(size for _, size in program.outputs)
    arguments = [f"const Array *a{n}" for n, _ in enumerate(program.inputs)]
    checks, copies, moves = [], [], []
    fetch = [f"    FETCH({section(program)}, m->given, m->own);"] * (program.name in CALLED_ALONE)
    for n, (_, size, at) in enumerate(stored(program.inputs)):
        checks.append(f"    const S *in{n} = numbers(a{n}, {size});")
        copies.append(f"    memcpy({program.name}_memory.given + {at}, in{n}, sizeof(S[{size}]));")
        moves.append(f"    memcpy({program.name}_memory.given + {at}, in[{n}], sizeof(S[{size}]));")
    handed = [f"a[{n}]" for n in range(len(program.inputs) + 1)]
    all_there = " && ".join([f"in{n}" for n, _ in enumerate(program.inputs)] + ["out"])
    name = program.name
    return "\n".join(
        [
            memory(program),
            f"static int {name}_run(S *out, S *guard) {{",
            "    S worst_yet = 0;",
            f"    __typeof__({name}_memory) *m = &{name}_memory;",
            *fetch,
            f"    for (int k = 0; k < {given}; k++) worst_yet += m->given[k] * 0; /* not finite: NaN */",
            f"    {name}_copies(m->given, out, m->shared, m->own, &worst_yet);",
            f"    worst_yet += none_of(out, {count}); /* not finite: NaN */",
            "    if (guard) *guard = worst_yet;",
            "    return worst_yet <= GUARD_LIMIT ? 0 : 2;",
            "}",
            f"EXPORT int {name}_single({', '.join([*arguments, 'const Array *result', 'S *guard'])}) {{",
            *checks,
            f"    S *out = numbers(result, {count});",
            f"    if (!({all_there})) return 1;",
            *copies,
            f"    return {name}_run(out, guard);",
            "}",
            f"EXPORT int {name}_single_at(const S *const *in, S *out) {{",
            *moves,
            f"    return {name}_run(out, 0);",
            "}",
            f"EXPORT const void *{name}_call(const void *self, const Array *const *a, Long count) {{",
            "    (void)self; /* a function of Python, METH_FASTCALL */",
            f"    S *guard = count == {len(handed) + 1} ? numbers(a[{len(handed)}], 1) : 0;",
            f"    if (count != {len(handed)} && !guard) return answered(1);",
            f"    return answered({name}_single({', '.join([*handed, 'guard'])}));",
            "}",
        ]
    )
