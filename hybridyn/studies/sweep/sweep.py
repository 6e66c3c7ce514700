"""The verb: evaluate every design of a study that has no row yet."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

import numpy as np

from ...description.writing import locked
from ...errors import HybridynError
from ...spatial import Index
from .compiled_chunks import evaluate_chunk, plan_for
from .compiled_designs import Plan
from .designs import Designs
from .evaluation import Chunk, Designer, Evaluated, Row
from .identity import identity
from .measures import unit_of
from .pools import MOST_DEATHS, Pool, PoolName, Task, check_pool, open_pool
from .reading import read_study
from .shards import About, Shards, read_shards, shards_in
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
        done: Number of designs with a row.
        now: Number of those that this run evaluated.
        statuses: Number of designs by status.
        unreachable: Number of postures that do not close.
        singular: Number of singular postures.
        restarts: Times that a worker process died and its designs were given again.
        workers: Number of processes.
        seconds: Wall time [s].
        work: Time of all processes spent on designs [s].
        compiled: Number of designs that compiled models evaluated now.
        checked: Number of those that were compared with robots built for them.
        difference: Largest relative difference found.
        why_general: Why the general path evaluates all designs, or "".
    """

    folder: Path
    designs: int
    done: int = 0
    now: int = 0
    statuses: Counter[str] = field(default_factory=Counter)
    unreachable: int = 0
    singular: int = 0
    restarts: int = 0
    workers: int = 0
    seconds: float = 0.0
    work: float = 0.0
    compiled: int = 0
    checked: int = 0
    difference: float = 0.0
    why_general: str = ""


Progress = Callable[[Swept], None]


def sweep(
    study: str | PathLike[str],
    output: str | PathLike[str] = "results",
    *,
    pool: PoolName = "loky",
    jobs: int | None = None,
    scheduler: str | None = None,
    resume: bool = False,
    allow_python: bool = False,
    format: str | None = None,
    compiled: bool = True,
    progress: Progress | None = None,
) -> Swept:
    """Evaluate every design of a study: one row per design, in shards in a folder.

    The designs and their rows are the same, bit for bit, for every pool, number of processes and division
    into shards.

    Args:
        study: The study's TOML file, see docs/sweeps.md.
        output: Folder of the results.
        pool: "loky" (processes on this machine), "dask" or "ray".
        jobs: Number of processes; one per core by default.
        scheduler: Address of a running cluster: of Dask, "tcp://host:8786", or of Ray, "host:6379". Its
            workers need the same files.
        resume: Whether to continue from the shards in the folder.
        allow_python: Whether measures may be functions of Python files, which run with all rights of the
            processes.
        format: Format of the shards, "parquet" (default) or "csv".
        compiled: Whether compiled models may evaluate designs if the study allows it. A resumed run uses the
            choice of the earlier run.
        progress: Called after each chunk.

    Returns:
        A summary of the run.

    Raises:
        HybridynError: The study is wrong, none of its designs loads, the folder has other results, another
            process holds it, the scheduler does not answer, or compiled models differ from the general path.
        OSError: The disk is full; the shards written so far are complete.
    """
    started = time.perf_counter()
    check_pool(pool, scheduler)
    source = read_study(Path(study), allow_python=allow_python)
    designs = Designs(source)
    state = Swept(Path(output), designs.count)
    pace, plan = _begun(source, designs, state, compiled=compiled)
    about = About(
        str(study), identity(source, designs), designs.count, designs.names, source.columns,
        format or "parquet", designs.method, plan is not None, _units(source, designs),
    )  # fmt: skip
    with locked(output):
        shards = Shards.create(Path(output), about, resume=resume)
        _count_rows(state)
        if shards.gaps():
            plan = _plan_of(shards, plan, source, designs)
            with open_pool(pool, jobs, scheduler) as processes:
                state.workers = processes.workers
                _Run(source, designs, shards, state, processes, plan, pace, progress, started).all()
    state.seconds = time.perf_counter() - started
    return state


def _begun(source: StudyFile, designs: Designs, state: Swept, *, compiled: bool) -> tuple[float, Plan | None]:
    """Try a design where no results are there; return the time of one [s], and what is compiled."""
    pace, plan = CHUNK_SECONDS, None
    if not shards_in(state.folder):
        pace = _try_some(source, designs)
        if compiled:
            plan, state.why_general = plan_for(source, designs, _tried(designs))
    return pace, plan


def _units(source: StudyFile, designs: Designs) -> dict[str, str]:
    """Return the units of measures, as far as the robot of the first design tells them."""
    variants = Variants(source)
    try:
        description = variants.description(variants.named(designs.values(0, 1)[0]))
    except HybridynError:
        return {}
    tasks = source.study.tasks.items()
    return {
        source.column(name, key): unit_of(word, description)
        for name, task in tasks
        for key, word in task.wanted.items()
    }


def _plan_of(shards: Shards, plan: Plan | None, source: StudyFile, designs: Designs) -> Plan | None:
    """Return the compiled models by which the shards began, or None if they began without."""
    if not shards.about.compiled:
        return None
    if plan is None:
        plan, why = plan_for(source, designs, _tried(designs), asked=True)
        if plan is None:
            raise HybridynError(
                f"{shards.folder}: its results are of compiled models, which are not to be had: {why}"
            )
    return plan


class _Run:
    """The chunks of a sweep, given to processes until every design has a row."""

    def __init__(
        self, source: StudyFile, designs: Designs, shards: Shards, state: Swept, pool: Pool,
        plan: Plan | None, pace: float, progress: Progress | None, started: float,
    ) -> None:  # fmt: skip
        self.source, self.designs, self.shards, self.state = source, designs, shards, state
        self.pool, self.plan, self.pace, self.progress, self.started = pool, plan, pace, progress, started

    def all(self) -> None:
        """Evaluate what has no row, and write the shards."""
        tasks = ((self.source, chunk, self.plan) for chunk in self._chunks(self.shards.gaps()))
        for done in self.pool.run(evaluate_chunk, tasks, self._deadly, _designs):
            self._keep(done)

    def _keep(self, done: Evaluated) -> None:
        """Write a shard, and learn how long designs take."""
        self.shards.write(done.rows)
        self.state.restarts = self.pool.deaths
        self.state.work += done.seconds
        self.state.compiled += done.compiled
        self.state.checked += done.checked
        self.state.difference = max(self.state.difference, done.difference)
        self.state.now += len(done.rows)
        if done.seconds > 0:
            self.pace += (done.seconds / len(done.rows) - self.pace) / 2
        for row in done.rows:
            _add(self.state, row.status, row.unreachable, row.singular)
        self.state.seconds = time.perf_counter() - self.started
        if self.progress is not None:
            self.progress(self.state)

    def _chunks(self, gaps: list[tuple[int, int]]) -> Iterator[Chunk]:
        """Divide designs into chunks of about a second, by the pace so far."""
        for start, stop in gaps:
            while start < stop:
                size = min(self._size(), stop - start)
                yield Chunk(start, self.designs.values(start, start + size))
                start += size

    def _size(self) -> int:
        """Return the number of designs in the next chunk."""
        return min(max(1, round(CHUNK_SECONDS / max(self.pace, 1e-9))), MOST_IN_CHUNK)

    def _deadly(self, source: StudyFile, chunk: Chunk, plan: Plan | None) -> Evaluated:
        """Return the row of a design that ends every process that evaluates it."""
        nothing = (float("nan"),) * len(source.columns)
        message = f"its worker process ended without a result {MOST_DEATHS} times; memory may have run out"
        row = Row(chunk.start, tuple(chunk.values[0].tolist()), "failed", 0, 0, nothing, message)
        return Evaluated((row,), 0.0)


def _designs(task: Task) -> list[Task]:
    """Divide the task of a chunk into those of its designs."""
    source, chunk, plan = task
    return [(source, Chunk(chunk.start + i, chunk.values[i : i + 1]), plan) for i in range(len(chunk.values))]


def _count_rows(state: Swept) -> None:
    """Count the rows of earlier runs."""
    if not shards_in(state.folder):
        return
    for part in read_shards(state.folder, ["status", "unreachable", "singular"]):
        cells = zip(part["status"], part["unreachable"].tolist(), part["singular"].tolist(), strict=True)
        for status, unreachable, singular in cells:
            _add(state, status, int(unreachable), int(singular))


def _add(state: Swept, status: str, unreachable: int, singular: int) -> None:
    state.done += 1
    state.statuses[status] += 1
    state.unreachable += unreachable
    state.singular += singular


def _tried(designs: Designs) -> Index:
    """Return the numbers of designs that are spread over the study."""
    return np.unique(np.linspace(0, designs.count - 1, TRIALS).astype(int))


def _try_some(source: StudyFile, designs: Designs) -> float:
    """Evaluate designs in this process until one loads; return the time that it took [s].

    Raises:
        HybridynError: None of the designs tried loads, or fails for another reason than its postures.
    """
    designer = Designer(source)
    first: Row | None = None
    tried = _tried(designs)
    for number in tried.tolist():
        started = time.perf_counter()
        row = designer(number, designs.values(number, number + 1)[0])
        if row.status in ("ok", "unreachable", "singular"):
            return time.perf_counter() - started
        first = first or row
    assert first is not None
    named = ", ".join(
        f"{name} = {value:.6g}" for name, value in zip(designs.names, first.values, strict=True)
    )
    verb = "loads" if first.status == "not loaded" else "can be evaluated"
    raise HybridynError(
        f"{source.file}: no design {verb} (tried {len(tried)} of {designs.count:,}); design {first.design} "
        f"({named}): {first.message}"
    )
