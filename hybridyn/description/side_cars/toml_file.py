"""Read TOML files, and find the line of each key."""

from __future__ import annotations

import re
from functools import partial
from typing import Any

from ...errors import ModelError
from ..bounds import BOUNDS, refuse_above

#: Path to a value: tables, indices of tables in an array, and the key.
Keys = tuple[str | int, ...]

#: A part of a dotted key: a bare word, or a text.
_PART = r"""(?:[\w-]++|"(?:\\.|[^"\\\n])*+"|'[^'\n]*+')"""

#: Most parts of a dotted key.
MOST_PARTS = BOUNDS["parts of a key"].most
#: A dotted key.
_WHOLE = rf"{_PART}(?:[ \t]*\.[ \t]*{_PART})*+"

#: A text of several lines (closed or not), a comment, a key of too many parts, or a part of another key.
_TOKEN = (
    r'''(?s)"""(?:\\.|[^\\])*?(?:"""|\Z)|\'\'\'.*?(?:\'\'\'|\Z)|#[^\n]*'''
    rf"|(?P<key>{_PART}(?:[ \t]*\.[ \t]*{_PART}){{{MOST_PARTS}}})|{_PART}"
)

#: The head of a table or of a table in an array, or the key of an assignment.
_KEY = rf"\s*(\[?\[?)\s*({_PART}(?:\s*\.\s*{_PART})*)\s*(?:\]\]?\s*(?:#|$)|=)"


def parse_toml(data: bytes, file: str) -> tuple[str, dict[str, Any]]:
    """Parse the bytes of a TOML file, and return its text and its content.

    Raises:
        ModelError: The file is not UTF-8, not TOML, or too large; the message names the line.
    """
    import tomllib  # imported late: most files are found checked in the cache folder

    refuse_above("side-car", len(data), partial(ModelError, file=file))
    try:
        text = data.decode("utf-8")
        if long := next((token for token in re.finditer(_TOKEN, text) if token["key"]), None):
            line = text.count("\n", 0, long.start()) + 1
            key = re.compile(_WHOLE).match(text, long.start())
            parts = len(re.findall(_PART, key[0] if key else ""))
            refuse_above("parts of a key", parts, partial(ModelError, file=file, line=line))
        return text, tomllib.loads(text)
    except UnicodeDecodeError as error:
        raise ModelError(f"is not UTF-8 text (byte {error.start})", file=file) from None
    except tomllib.TOMLDecodeError as error:
        at = re.search(r"at line (\d+)", str(error))
        raise ModelError(
            f"not readable as TOML: {error}", file=file, line=int(at[1]) if at else None
        ) from None
    except (RecursionError, ValueError):
        raise ModelError("not readable as TOML: nested too deeply, or a number too long", file=file) from None


def line_of(text: str, keys: Keys) -> int | None:
    """Return the line (from 1) that defines a key of a TOML text, else that of the innermost table around it.

    Args:
        keys: Tables, indices of tables in an array, and the key.
    """
    table: Keys = ()
    counts: dict[Keys, int] = {}
    best: tuple[int, int | None] = (0, None)
    for number, line in enumerate(text.splitlines(), start=1):
        if not (found := re.match(_KEY, line)):
            continue
        defined = _dotted(found[2], counts) if found[1] else (*table, *_dotted(found[2], {}))
        if found[1] == "[[":
            counts[defined] = counts.get(defined, -1) + 1
            table = (*defined, counts[defined])
            defined = defined if defined == keys else table  # an array is defined where it begins
        elif found[1]:
            table = defined
        shared = len(defined)
        if defined == keys[:shared] and shared > best[0]:
            best = (shared, number)
    return best[1]


def _dotted(text: str, counts: dict[Keys, int]) -> Keys:
    """Split a dotted key; after the name of an array of tables, insert the index of its last table."""
    out: Keys = ()
    parts = [part.strip("\"'") for part in re.findall(_PART, text)]
    for i, part in enumerate(parts):
        out = (*out, part)
        if out in counts and i < len(parts) - 1:
            out = (*out, counts[out])
    return out
