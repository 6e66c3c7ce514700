"""Record what every robot file of some folders says, and compare two such records.

`python -m tests.description.recorded write OUT.json FOLDER ...` reads each file under the folders that may be
a robot, in a process of its own; `... compare OLD.json NEW.json` tells which are read in another way. A
record has every number of a `Description`, so two states of the package can be compared on others' files:
`PYTHONPATH` says which one is read.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import os
import re
import signal
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

#: Endings of robot files, and the elements that those in plain XML begin with.
ENDINGS = (".urdf", ".xacro", ".xml", ".mjcf", ".sdf", ".world", ".usd", ".usda", ".usdc", ".usdz")
ROOTS = re.compile(rb"<(robot|mujoco|sdf)[\s>]")
#: Time that a file may take [s].
SECONDS = 60
#: Relative difference of numbers that is none.
SAME = 1e-15
#: Fields that say where a robot comes from, not what it is; notes are compared without their places.
LEFT_OUT = ("source", "read_from", "line", "notes", "file")


def robot_files(folders: list[str]) -> Iterator[str]:
    """Yield the files that may be robots, each once."""
    seen = set[str]()
    for folder in folders:
        for path in sorted(path for path in Path(folder).rglob("*") if path.suffix.lower() in ENDINGS):
            real = os.path.realpath(path)
            if real in seen or not path.is_file():
                continue
            seen.add(real)
            if path.suffix.lower() not in (".xml", ".mjcf") or ROOTS.search(path.read_bytes()[:20_000]):
                yield str(path)


def plain(value: Any) -> Any:
    """Return a record as what JSON can hold, and reads back to the last bit."""
    if dataclasses.is_dataclass(value):
        return {
            one.name: plain(getattr(value, one.name))
            for one in dataclasses.fields(value)
            if one.name not in LEFT_OUT
        }
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, dict):
        return {str(key): plain(one) for key, one in value.items()}
    if isinstance(value, tuple | list | set | frozenset):
        return [plain(one) for one in (sorted(value) if isinstance(value, set | frozenset) else value)]
    return value if value is None or isinstance(value, str | int | float) else repr(value)


def said(path: str) -> dict[str, Any]:
    """Return what a robot file says, or why it is refused; anything but a refusal is told as it is."""
    from hybridyn.description import read
    from hybridyn.errors import HybridynError

    try:
        found = read(path)
    except HybridynError as error:
        return {"refused": str(error)}
    except Exception as error:
        return {"fault": repr(error)}
    return {"robot": plain(found), "notes": list(found.notes)}


def write(out: str, folders: list[str]) -> None:
    """Record every file, in forked processes of 50 files."""
    files = [*robot_files(folders)]
    records: dict[str, Any] = {}
    for start in range(0, len(files), 50):
        part = f"{out}.part"
        batch = files[start : start + 50]
        while batch:
            child = os.fork()
            if not child:
                with open(part, "w") as opened:
                    for path in batch:
                        signal.alarm(SECONDS)
                        opened.write(json.dumps([path, said(path)]) + "\n")
                        opened.flush()
                os._exit(0)
            _, status = os.waitpid(child, 0)
            done = [json.loads(line) for line in Path(part).read_text().splitlines()]
            records |= dict(done)
            batch = batch[len(done) :]
            if status and batch:
                records[batch.pop(0)] = {"fault": f"ended the process: {status}"}
    Path(out).write_text(json.dumps(records))
    print(len(records), Counter(next(iter(one)) for one in records.values()))


def differences(old: Any, new: Any, place: str = "") -> Iterator[str]:
    """Yield where two records differ; what only the new one has may be empty, zero or absent."""
    if isinstance(old, dict) and isinstance(new, dict):
        for name in {**old, **new}:
            if name not in old:
                if new[name] not in (None, 0, 0.0, False, "", [], {}):
                    yield f"{place}.{name}: new {str(new[name])[:80]}"
            elif name not in new:
                if old[name] not in (None, 0, 0.0, False, "", [], {}):
                    yield f"{place}.{name}: lost {str(old[name])[:80]}"
            else:
                yield from differences(old[name], new[name], f"{place}.{name}")
    elif isinstance(old, list) and isinstance(new, list):
        if len(old) != len(new):
            yield f"{place}: {len(old)} parts, now {len(new)}"
            return
        for number, (one, other) in enumerate(zip(old, new, strict=True)):
            label = one.get("name", number) if isinstance(one, dict) else number
            yield from differences(one, other, f"{place}[{label}]")
    elif isinstance(old, float | int) and isinstance(new, float | int):
        same = old == new or (math.isnan(old) and math.isnan(new))
        if not same and not abs(old - new) <= SAME * max(abs(old), abs(new)):
            yield f"{place}: {old!r}, now {new!r}"
    elif old != new:
        yield f"{place}: {str(old)[:80]!r}, now {str(new)[:80]!r}"


def compare(old_file: str, new_file: str) -> None:
    """Print which robots are read in another way, and why files are refused."""
    old, new = (json.loads(Path(one).read_text()) for one in (old_file, new_file))
    counts = Counter[str]()
    for path in sorted({*old, *new}):
        before, now = old.get(path, {"absent": ""}), new.get(path, {"absent": ""})
        kinds = f"{next(iter(before))} -> {next(iter(now))}"
        if "robot" in before and "robot" in now:
            found = [*differences(before["robot"], now["robot"])]
            kinds += ", the same" if not found else ", another"
            for line in found[:6]:
                print(f"{path}: {line}" + (f" (of {len(found)})" if len(found) > 1 else ""))
        elif kinds != "refused -> refused":
            print(f"{path}: {kinds}: {str(now.get('refused', now.get('fault', '')))[:300]}")
        counts[kinds] += 1
    print(*(f"{count} {kinds}" for kinds, count in sorted(counts.items())), sep="\n")


def main() -> None:
    """Write or compare records."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("what", choices=["write", "compare"])
    asked.add_argument("files", nargs="+")
    given = asked.parse_args()
    {"write": write, "compare": lambda old, *new: compare(old, *new[0])}[given.what](
        given.files[0], given.files[1:]
    )


if __name__ == "__main__":
    sys.exit(main())
