"""Operations of a program for one sample; and how far compiled models are from what one core can do.

The peak is measured in the same run: independent fused multiply-adds on vectors of the machine's width, two
operations each. Models also divide, shuffle and load, and wait for their own results: no straight-line code
of this kind comes near it; the share says how much room there is.

Counted from the kernels of gough_stewart and lx4, two vector operations in every cycle would be 0.52 to 0.64
of the peak: 45 % of the arithmetic statements are fused, and a sine with its cosine counts as two operations
and takes some fifty. Kernels of legs, half of the time, run at what their instructions allow: arithmetic,
selections and divisions fill both ports of vectors. Moves to and from the stack are 8 % of the vector
instructions; statements ordered depth first, and other flags of scheduling and register allocation, change
neither them nor the time. The rest is rows that are read and written, and pivots that wait for each other.
"""

from __future__ import annotations

import ctypes
import os
import subprocess
import tempfile
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from functools import partial, reduce
from pathlib import Path

import casadi as ca

import hybridyn
from benchmarks.cases import case_of
from benchmarks.peers.ours import COMPILED
from benchmarks.results import NAN, Row
from benchmarks.timing import timed
from hybridyn.compiled.code.graph import Graph, Operation
from hybridyn.compiled.code.kernels import operations_of
from hybridyn.compiled.library.building import NATIVE, best_lanes, find_compiler
from hybridyn.compiled.program import Add, Call, Program
from hybridyn.compiled.programs.whole_robot import programs, run

#: Kinds of operations: sums and differences; products; quotients; square roots; sines and cosines; others.
KINDS = ("add", "mul", "div", "sqrt", "trig", "other")

#: Operations that cost nothing.
FREE = ("input", "constant", "neg")

_KIND = {"add": "add", "sub": "add", "mul": "mul", "div": "div", "sqrt": "sqrt", "sin": "trig", "cos": "trig"}
#: Independent sums, more than the latency of a multiply-add times those begun in a cycle.
CHAINS = 12
#: Of each sum in a round.
LENGTH = 200_000
ROUNDS = 50
SAMPLES = 4096

SOURCE = """\
typedef double V __attribute__((vector_size(8 * W)));
double run(long length) {
    V x[CHAINS];
    const V a = (V){0} + 0.999999, b = (V){0} + 1e-9;
    for (int i = 0; i < CHAINS; i++) x[i] = (V){0} + i;
    for (long k = 0; k < length; k++)
        for (int i = 0; i < CHAINS; i++) x[i] = x[i] * a + b;
    double sum = 0;
    for (int i = 0; i < CHAINS; i++) sum += x[i][0];
    return sum;
}
"""


def costing(graph: Graph) -> list[Operation]:
    """Return the operations that are computed at run time."""
    constant = [node.name == "constant" for node in graph.nodes]
    return [
        node
        for node in graph.nodes
        if node.name not in FREE
        and not (node.name == "div" and all(constant[abs(x) - 1] for x in node.arguments))
    ]


def operations(program: Program) -> dict[str, dict[str, int]]:
    """Count operations by part (`Kernel.part`) and kind, over all calls and copies.

    Returns:
        For each part, in the order of the calls, the number of operations of each kind.
    """
    each = [
        Counter(_KIND.get(node.name, "other") for node in costing(operations_of(kernel.function)))
        for kernel in program.kernels
    ]
    out: dict[str, Counter[str]] = {}
    for step in program.steps:
        if isinstance(step, Call):
            total = out.setdefault(program.kernels[step.kernel].part, Counter())
            for kind, number in each[step.kernel].items():
                total[kind] += number * step.copies
            total["add"] += step.copies * sum(t.size for t in step.targets if isinstance(t, Add))
    return {part: {kind: total[kind] for kind in KINDS} for part, total in out.items()}


def total(program: Program, without: str = "") -> int:
    """Count all operations of a program, without those of a part."""
    return sum(sum(kinds.values()) for part, kinds in operations(program).items() if part != without)


def flattened(program: Program) -> tuple[int, int]:
    """Count the operations of a program written as one expression, with common terms computed once.

    Args:
        program: The program.

    Returns:
        The number of operations with the guard and without it.
    """
    symbols = [ca.SX.sym(name, size) for name, size in program.inputs]
    result, guards = run(program, [x for column in symbols for x in ca.vertsplit(column)])
    outputs = [ca.vertcat(*result), reduce(ca.fmax, guards)]
    both = (ca.Function("flat", symbols, ca.cse(wanted)) for wanted in (outputs, outputs[:-1]))
    with_guard, alone = (len(costing(operations_of(f))) for f in both)
    return with_guard, alone


def peak() -> tuple[float, float]:
    """Return the most operations per second of one core, and of all at once, in double precision."""
    lanes = best_lanes("float64")
    with tempfile.TemporaryDirectory() as folder:
        source, library = Path(folder, "peak.c"), Path(folder, "peak.so")
        source.write_text(SOURCE)
        sizes = [f"-DW={lanes}", f"-DCHAINS={CHAINS}"]
        flags = ["-O3", *NATIVE, "-ffp-contract=fast", "-shared", "-fPIC", *sizes]
        subprocess.run([*find_compiler(), *flags, str(source), "-o", str(library)], check=True)
        run = ctypes.CDLL(str(library)).run
        run.argtypes, run.restype = [ctypes.c_long], ctypes.c_double
        run(LENGTH)
        one = 2 * lanes * CHAINS * LENGTH / min(timed(partial(run, LENGTH), 1) for _ in range(ROUNDS))
        cores = os.cpu_count() or 1
        with ThreadPoolExecutor(cores) as pool:
            long = [10 * LENGTH] * cores  # long enough for all to run at once
            least = min(timed(lambda: list(pool.map(run, long)), 1) for _ in range(ROUNDS))
        return one, 2 * lanes * CHAINS * sum(long) / least


def measure(case: str) -> list[Row]:
    """Return both models of a robot: operations of a sample, time in a batch on one thread, and the peak."""
    own = case_of(case)
    robot = own.load()
    compiled, (most, together) = hybridyn.compile(robot, wait=True), peak()
    q, v, a = own.states(robot, SAMPLES)
    rows = []
    for model, given in (("ddm", hybridyn.idm(robot, q, v, a)), ("idm", a)):
        count = total(programs(robot, models=(model,))[model])
        call = partial(getattr(compiled, model), q, v, given)
        call()
        seconds = min(timed(call, 1) for _ in range(ROUNDS)) / SAMPLES
        row = Row(case, model, COMPILED, us=1e6 * seconds, value=count / seconds / most)
        rows.append(row._replace(setting="share of the peak rate"))
        for what, value, unit in (
            ("operations", count, "operations"),
            ("peak rate of one core", 1e-9 * most, "1e9/s"),
            ("rate of all cores, of one times their number", together / most / (os.cpu_count() or 1), ""),
        ):
            rows.append(row._replace(setting=what, us=NAN, value=value, unit=unit))
    return rows
