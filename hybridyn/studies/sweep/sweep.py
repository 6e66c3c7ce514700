"""The verb: evaluate every design of a study that has no row yet."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, field
from os import PathLike
from pathlib import Path

import numpy as np

from ...errors import HybridynError, required
from ...spatial import Array, Index
from ..pools import MOST_DEATHS, Task, open_pool
from ..results_folder import read_record, writing
from .compiled_chunks import evaluate_chunk, plan_for
from .compiled_designs import DesignPlan
from .designs import designs_of
from .evaluation import Chunk, Designer, DesignRow, Evaluated
from .gradient_chunks import GradientPlan, evaluate_with_gradients, plan_of
from .gradients import StudyGradients
from .measures import unit_of
from .reading import identity, read_study
from .shards import About, about_of, gaps, read_shards, write_shard
from .study_file import StudyFile
from .variants import Variants

#: Work of a chunk [s]: long against the transfer to another process, short against a wait.
CHUNK_SECONDS = 1.0
#: Largest number of designs in a chunk.
MOST_IN_CHUNK = 10_000
#: Designs, spread over the study, of which one has to load before the sweep starts.
TRIALS = 16


@dataclass
class Swept:
    """A sweep that has ended, or its state so far.

    Attributes:
        folder: Folder of the results.
        designs: Number of designs of the study.
        now: Number of those that this run evaluated.
        statuses: Number of designs with a row, by status.
        restarts: Times that a worker process died and its designs were given again.
        seconds: Wall time [s].
        work: Time of all processes spent on designs [s].
        compiled: Number of designs that compiled models evaluated now.
        checked: Number of those that were compared with robots built for them.
        difference: Largest relative difference found.
        why_general: Why the general path evaluates all designs, or "".
    """

    folder: Path
    designs: int
    now: int = 0
    statuses: Counter[str] = field(default_factory=Counter)
    restarts: int = 0
    seconds: float = 0.0
    work: float = 0.0
    compiled: int = 0
    checked: int = 0
    difference: float = 0.0
    why_general: str = ""

    @property
    def done(self) -> int:
        """Number of designs with a row."""
        return self.statuses.total()

    def add(self, found: Evaluated) -> None:
        """Count the designs of a chunk."""
        self.now += len(found.rows)
        self.statuses.update(row.status for row in found.rows)
        self.work += found.seconds
        self.compiled += found.compiled
        self.checked += found.checked
        self.difference = max(self.difference, found.difference)


def sweep(
    study: str | PathLike[str],
    output: str | PathLike[str] = "results",
    *,
    jobs: int | None = None,
    executor: Callable[[], Executor] | None = None,
    resume: bool = False,
    allow_python: bool = False,
    compiled: bool = True,
    gradient: bool = False,
    progress: Callable[[Swept], None] | None = None,
    strict: bool = False,
) -> Swept:
    """Evaluate every design of a study: one row per design, in Parquet files (shards) in a folder.

    The designs and their rows are the same, bit for bit, for every executor, number of processes and division
    into shards.

    Args:
        study: The study's TOML file, see docs/sweeps.md.
        output: Folder of the results.
        jobs: Number of processes; one per core by default.
        executor: Returns an executor of `concurrent.futures`, such as Dask's `client.get_executor`, that runs
            the processes; called again after the death of a process. Its workers need the same files.
        resume: Whether to continue from the shards in the folder.
        allow_python: Whether measures may be functions of Python files, which run with all rights of the
            processes.
        compiled: Whether compiled models may evaluate designs if the study allows it. A resumed run uses the
            choice of the earlier run.
        gradient: Whether rows have the derivatives of their measures over the parameters, too: the columns
            `MEASURE.d_PARAMETER`, `closing`, `conditioning` and theirs. The general path evaluates the
            designs then.
        progress: Called after each chunk.
        strict: Whether notes on the robot are errors, as with `strict` in the study's `[robot]`.

    Returns:
        A summary of the run.

    Raises:
        HybridynError: The study is wrong, none of its designs loads, the folder has other results, another
            process holds it, or compiled models differ from the general path.
        OSError: The disk is full; the shards written so far are complete.

    Example:
        >>> from pathlib import Path
        >>> from tempfile import TemporaryDirectory
        >>> text = '''[robot]
        ... file = "five_bar"
        ... [designs]
        ... method = "grid"
        ... [parameters]
        ... upper_length = { values = [0.24, 0.25] }
        ... [tasks.reach]
        ... workspace = { steps = { x = 0.2, z = 0.2 } }
        ... measure = ["poses"]
        ... '''
        >>> with TemporaryDirectory() as folder:
        ...     study = Path(folder, "study.toml")
        ...     size = study.write_text(text)
        ...     done = hybridyn.sweep(study, Path(folder, "results"), jobs=1)
        >>> done.statuses
        Counter({'ok': 2})
    """
    started = time.perf_counter()
    source = read_study(Path(study), allow_python=allow_python, strict=strict)
    designs = designs_of(source)
    state = Swept(Path(output), len(designs))
    pace = CHUNK_SECONDS
    plan: DesignPlan | GradientPlan | None = None
    begun = read_record(output).begun
    if gradient:
        state.why_general = "gradients are those of single designs"
        if not begun or gaps(state.folder, len(designs)):  # a run that continues needs the same models
            along = StudyGradients(source)
            pace, plan = _try_some(source, designs, along.row), plan_of(along)
    elif not begun:
        pace = _try_some(source, designs, Designer(source))
        if compiled:
            plan, state.why_general = plan_for(source, designs, _tried(designs))
    required("polars", "sweep", "a sweep")
    about = About(
        str(study), len(designs), list(source.study.parameters), source.columns, isinstance(plan, DesignPlan),
        _units(source, designs[0]), source.gradient_columns if gradient else [],
    )  # fmt: skip
    asked = {"command": "sweep", **identity(source, designs[0])}
    asked |= {"gradient": "of measures"} if gradient else {}
    with writing(output, asked, asdict(about), ["[!.]*.parquet"], resume=resume):
        about = about_of(state.folder)
        state.statuses.update(read_shards(state.folder, ["status"])["status"])
        if left := gaps(state.folder, len(designs)):
            if about.compiled and plan is None:
                plan = _plan_again(state.folder, source, designs)
            pool = open_pool(jobs, executor)
            tasks = ((source, chunk, plan) for chunk in _chunks(left, designs, state, pace))
            work = evaluate_with_gradients if gradient else evaluate_chunk
            for found in pool.run(work, tasks, _lost, _designs):
                write_shard(state.folder, about, found.rows)
                state.add(found)
                state.restarts, state.seconds = pool.deaths, time.perf_counter() - started
                if progress is not None:
                    progress(state)
    state.seconds = time.perf_counter() - started
    return state


def _chunks(left: list[tuple[int, int]], designs: Array, state: Swept, pace: float) -> Iterator[Chunk]:
    """Divide designs into chunks of about a second, by the pace so far; `pace` [s] is that of the first."""
    for start, stop in left:
        while start < stop:
            seconds = state.work / state.now if state.now else pace
            size = min(max(1, round(CHUNK_SECONDS / max(seconds, 1e-9))), MOST_IN_CHUNK, stop - start)
            yield Chunk(start, designs[start : start + size])
            start += size


def _units(source: StudyFile, first: Array) -> dict[str, str]:
    """Return the units of measures, as far as the robot of the first design tells them."""
    variants = Variants(source)
    try:
        description = variants.description(variants.named(first))
    except HybridynError:
        return {}
    tasks = source.study.tasks.items()
    return {
        source.column(name, key): unit_of(word, description)
        for name, task in tasks
        for key, word in task.wanted.items()
    }


def _plan_again(folder: Path, source: StudyFile, designs: Array) -> DesignPlan:
    """Return the compiled models by which the shards of a folder began."""
    plan, why = plan_for(source, designs, _tried(designs), asked=True)
    if plan is None:
        raise HybridynError(f"{folder}: its results are of compiled models, which are not to be had: {why}")
    return plan


def _lost(source: StudyFile, chunk: Chunk, plan: DesignPlan | GradientPlan | None) -> Evaluated:
    """Return the row of a design that ends every process that evaluates it."""
    nothing = (float("nan"),) * len(source.columns)
    message = f"its worker process ended without a result {MOST_DEATHS} times; memory may have run out"
    row = DesignRow(chunk.start, tuple(chunk.values[0].tolist()), "failed", nothing, message)
    return Evaluated((row,), 0.0)


def _designs(task: Task) -> list[Task]:
    """Divide the task of a chunk into those of its designs."""
    source, chunk, plan = task
    return [(source, Chunk(chunk.start + i, chunk.values[i : i + 1]), plan) for i in range(len(chunk.values))]


def _tried(designs: Array) -> Index:
    """Return the numbers of designs that are spread over the study."""
    return np.unique(np.linspace(0, len(designs) - 1, TRIALS).astype(int))


def _try_some(source: StudyFile, designs: Array, designer: Callable[[int, Array], DesignRow]) -> float:
    """Evaluate designs in this process until one loads; return the time that it took [s].

    Args:
        designer: Evaluates a design.

    Raises:
        HybridynError: None of the designs tried loads, or fails for another reason than its postures.
    """
    first: DesignRow | None = None
    tried = _tried(designs)
    for number in tried.tolist():
        started = time.perf_counter()
        row = designer(number, designs[number])
        if row.status in ("ok", "unreachable", "singular"):
            return time.perf_counter() - started
        first = first or row
    assert first is not None
    values = zip(source.study.parameters, first.values, strict=True)
    named = ", ".join(f"{name} = {value:.6g}" for name, value in values)
    verb = "loads" if first.status == "not loaded" else "can be evaluated"
    raise HybridynError(
        f"{source.file}: no design {verb} (tried {len(tried)} of {len(designs):,}); design {first.design} "
        f"({named}): {first.message}"
    )
