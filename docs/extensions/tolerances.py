"""Write docs/tolerances.md: every tolerance of the package, from the constants and their comments.

Run `python docs/extensions/tolerances.py` after a tolerance or its comment has changed; a test compares.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

DOCS = Path(__file__).parents[1]
PACKAGE = DOCS.parent / "hybridyn"
PAGE = DOCS / "tolerances.md"
HEAD = """# Tolerances

Every tolerance of the package, by folder: its name, its value, and its reason. Unless the reason says
otherwise, lengths are relative to a module's length and angles are in radians. Users set two of them:
`rank_tolerance` and `closure_tolerance` of `hybridyn.load`. `docs/extensions/tolerances.py` writes this page.
"""
#: What counts as a tolerance: a constant written as a power of ten, or by type of number.
SMALL = re.compile(r"\d(\.\d+)?e-\d+")
#: A line that may state one: others are not parsed.
CONSTANT = re.compile(r"\(?[A-Z][^=]*=.*\de-\d")


class Tolerance(NamedTuple):
    """A tolerance.

    Attributes:
        name: Its name.
        value: Its value, as written.
        file: The file, relative to the package.
        reason: Its comment.
    """

    name: str
    value: str
    file: str
    reason: str


def tolerances() -> Iterator[Tolerance]:
    """Yield every tolerance, by file and line."""
    for path in sorted(PACKAGE.rglob("*.py")):
        text = path.read_text()
        lines = text.split("\n") if SMALL.search(text) else []
        for at, line in enumerate(lines):
            if CONSTANT.match(line) and (found := _stated(line)):
                yield Tolerance(*found, path.relative_to(PACKAGE).as_posix(), _comment(lines, at))


def _stated(line: str) -> tuple[str, str] | None:
    """Return name and value of a tolerance that a line states, None if it states none."""
    try:
        (node,) = ast.parse(line).body
    except SyntaxError:  # a part of a statement
        return None
    if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
        return None
    target = node.targets[0] if isinstance(node, ast.Assign) else node.target
    name, value = ast.unparse(target), line[node.value.col_offset : node.value.end_col_offset]
    if not name.isupper() or not SMALL.search(value) or len(value) >= 60:
        return None
    return name.strip("()"), value.strip("()")


def _comment(lines: list[str], end: int) -> str:
    """Return the `#:` comment that ends above a line."""
    begin = end
    while begin and lines[begin - 1].startswith("#:"):
        begin -= 1
    return " ".join(line.removeprefix("#:").strip() for line in lines[begin:end])


def page(found: list[Tolerance]) -> str:
    """Return the page of some tolerances."""
    out, folder = [HEAD], ""
    for tolerance in sorted(found, key=lambda t: t.file.rpartition("/")[0]):
        here = tolerance.file.rpartition("/")[0] or "hybridyn"
        if here != folder:
            folder = here
            out.append(f"\n## {folder}\n\n| name | value | file | reason |\n|---|---|---|---|\n")
        reason = tolerance.reason.replace("|", r"\|")
        out.append(f"| `{tolerance.name}` | `{tolerance.value}` | `{tolerance.file}` | {reason} |\n")
    return "".join(out)


if __name__ == "__main__":
    PAGE.write_text(page(list(tolerances())))
