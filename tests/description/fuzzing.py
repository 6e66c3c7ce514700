"""Read many drawn and broken files of every format, in forked batches of one process.

`python -m tests.description.fuzzing 100000 --seed 0 --out found` prints a line for each kind of files, and
writes those that end in a traceback, take more than `SECONDS`, end their process, need more memory than
`MEMORY` or lose a part without a word. A kind's cases are the same for a seed, whatever their number.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import resource
import select
import signal
import sys
import tempfile
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from hybridyn.description import read
from hybridyn.description.bounds import BOUNDS
from tests.description.reading import finite, outcome, save_all
from tests.description.test_fuzz_readers import CASES, Judge, of_mjcf, of_sdf, of_urdf, of_usd
from tests.description.test_valid_files import check, saved
from tests.description.test_xacro_judged import agrees
from tests.description.valid_files import FORMATS
from tests.robots.mutations import TREE, USDA

#: Processor time that a case may take [s], and memory of a batch beyond that of its start [bytes].
SECONDS, MEMORY = 10, 2**30
#: Cases of a batch, and time without a word after which it is ended [s].
BATCH, SILENCE = 250, 200

#: Other parsers of broken files.
JUDGES: dict[str, Judge] = {"urdf": of_urdf, "sdf": of_sdf, "mjcf": of_mjcf, "usd": of_usd}

#: Reads one file of its own, or a few; returns how many were read, and how many were refused.
Case = Callable[[int, Path], tuple[int, int]]


class HangError(BaseException):
    """A case takes too long; no reader may keep it for itself."""


class Tally(NamedTuple):
    """What became of the cases of a kind.

    Attributes:
        counts: Numbers of cases, of files that were read, and of files that were refused.
        grown: Most memory that a batch took beyond that of its start [bytes].
        found: Seed and words of each fault.
    """

    counts: Counter[str]
    grown: list[int]
    found: list[tuple[int, str]]


def drawn(name: str, seed: int, folder: Path) -> tuple[int, int]:
    """Draw a valid file, and take parts out: it is read, or refused for a known reason, and none is lost."""
    is_read = check(name, seed, folder, read)
    return int(is_read), int(not is_read)


def broken(name: str, seed: int, folder: Path) -> tuple[int, int]:
    """Break a robot that has everything, and compare it with another parser."""
    case, draw = CASES[name], random.Random(f"{name} {seed}")
    path = save_all(folder, case.files)
    text = draw.choice(case.mutations)(case.files[case.name], draw)
    (folder / case.name).write_bytes(text)
    found = outcome(path, text, never=case.never)
    if found is not None:
        finite(found, text)
        case.judge(path, found, text)
    return int(found is not None), int(found is None)


def drawn_and_broken(name: str, seed: int, folder: Path) -> tuple[int, int]:
    """Break a drawn file up to four times, and compare it with another parser."""
    form, draw = FORMATS[name], random.Random(f"broken {name} {seed}")
    root = form.drawn(draw)
    path = saved(folder, form, root)
    text = form.text(root)
    for _ in range(draw.choice([1, 1, 2, 4])):
        raw = draw.choice(USDA if name == "usd" else TREE)(text, draw)
        text = raw.decode(errors="replace")
        if not text:
            break
    (folder / f"r{form.ending}").write_bytes(raw)
    found = outcome(path, raw, never="ended while")
    if found is not None:
        finite(found, raw)
        if name in JUDGES:
            JUDGES[name](path, found, raw)
    return int(found is not None), int(found is None)


def drawn_xacro(seed: int, folder: Path) -> tuple[int, int]:
    """Draw a xacro file, and compare its expansion with xacro's."""
    is_read = agrees(str(seed), folder)
    return int(is_read), int(not is_read)


KINDS: dict[str, Case] = {
    "drawn xacro": drawn_xacro,
    **{f"drawn {name}": partial(drawn, name) for name in FORMATS},
    **{f"broken {name}": partial(broken, name) for name in CASES},
    **{f"drawn and broken {name}": partial(drawn_and_broken, name) for name in FORMATS},
}


def run(kind: Case, seeds: range, tell: Callable[[str], None]) -> None:
    """Run cases in this process; tell a line of JSON before each and after it."""

    def late(*_: object) -> None:
        raise HangError(f"took more than {SECONDS} s")

    warnings.simplefilter("ignore")
    signal.signal(signal.SIGVTALRM, late)
    BOUNDS["seconds"] = BOUNDS["seconds"]._replace(most=SECONDS)
    start = _memory()
    for seed in seeds:
        tell(json.dumps({"seed": seed}))
        with tempfile.TemporaryDirectory() as folder:
            signal.setitimer(signal.ITIMER_VIRTUAL, SECONDS)
            said: dict[str, Any] = {}
            try:
                said["read"], said["refused"] = kind(seed, Path(folder))
            except KeyboardInterrupt:
                raise
            except BaseException:
                said["fault"] = traceback.format_exc()
            signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        tell(json.dumps({"done": seed, **said, "grown": _memory() - start}))


def _memory() -> int:
    """Return the most memory that this process has taken [bytes]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def batches(kind: Case, seeds: range) -> Tally:
    """Run cases in forked batches, and count what became of them."""
    tally = Tally(Counter(), [0], [])
    at = seeds.start
    while at < seeds.stop:
        at = _batch(kind, range(at, min(at + BATCH, seeds.stop)), tally)
    return tally


def _batch(kind: Case, seeds: range, tally: Tally) -> int:
    """Run a batch in a process of its own; return the seed that comes next."""
    here, there = os.pipe()
    sys.stdout.flush()
    child = os.fork()
    if not child:
        status = 1
        try:
            os.close(here)
            run(kind, seeds, lambda line: [None, os.write(there, f"{line}\n".encode())][0])
            status = 0
        finally:
            os._exit(status)
    os.close(there)
    last = seeds.start - 1
    for line in _lines(here):
        said = json.loads(line)
        last = said.get("seed", last)
        if "done" in said:
            tally.counts.update(cases=1, read=said.get("read", 0), refused=said.get("refused", 0))
            tally.grown[0] = max(tally.grown[0], said["grown"])
            if "fault" in said:
                tally.found.append((said["done"], said["fault"]))
            elif said["grown"] > MEMORY:
                tally.found.append((said["done"], f"takes {said['grown'] / 2**20:.0f} MiB"))
                break
            last = said["done"] + 1
    os.close(here)
    os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    if last < seeds.stop and not (tally.found and tally.found[-1][0] == last):
        tally.found.append((last, f"ended its process, or never ended (status {status})"))
        tally.counts["cases"] += 1
    return max(last + 1, seeds.start + 1) if last < seeds.stop else seeds.stop


def heard(pipe: int) -> bool:
    """Wait until a pipe has more, or is closed; return whether it is within `SILENCE`."""
    return bool(select.select([pipe], [], [], SILENCE)[0])


def _lines(pipe: int) -> Iterator[str]:
    """Yield the lines that come through a pipe, until it is closed or silent for `SILENCE`."""
    rest = b""
    while heard(pipe):
        got = os.read(pipe, 1 << 16)
        if not got:
            return
        *lines, rest = (rest + got).split(b"\n")
        yield from (line.decode() for line in lines)


def main() -> None:
    """Run an equal share of the cases of each kind."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("cases", type=int)
    asked.add_argument("--seed", type=int, default=0)
    asked.add_argument("--only", default="", help="words that the names of kinds have")
    asked.add_argument("--out", type=Path, default=Path("found"))
    given = asked.parse_args()
    kinds = {name: kind for name, kind in KINDS.items() if given.only in name}
    share, total = -(-given.cases // len(kinds)), Counter[str]()
    for name, kind in kinds.items():
        tally = batches(kind, range(given.seed, given.seed + share))
        total += tally.counts
        numbers = ", ".join(f"{count:,} {word}" for word, count in tally.counts.items())
        print(f"{name}: {numbers}, {tally.grown[0] / 2**20:.0f} MiB, {len(tally.found)} faults", flush=True)
        for seed, words in tally.found:
            given.out.mkdir(exist_ok=True)
            (given.out / f"{name.replace(' ', '-')}-{seed}.txt").write_text(words)
    print(", ".join(f"{count:,} {word}" for word, count in total.items()))


if __name__ == "__main__":
    main()
