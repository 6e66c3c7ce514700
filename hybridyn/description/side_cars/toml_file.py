"""Read TOML files, and find the line of each key."""

from __future__ import annotations

import re
from typing import Any

from ...errors import ModelError

#: Path to a value: tables, indices of tables in an array, and the key.
Keys = tuple[str | int, ...]

#: Largest TOML file read [bytes]; those of robots and scenes have a few kilobytes.
LARGEST_TOML = 2**20

#: Most parts of a dotted key; Python's reader keeps a table for each prefix of the key.
MOST_PARTS = 16

#: A text (of any kind, closed or not), a comment, a part of a bare key, spaces, or any other character.
_TOKEN = re.compile(
    r'''(?P<long>"""(?:\\.|[^\\])*?(?:"""|\Z)|\'\'\'.*?(?:\'\'\'|\Z))'''
    r"""|(?P<part>"(?:\\.|[^"\\\n])*"|'[^'\n]*'|[\w-]+)"""
    r"|(?P<comment>#[^\n]*)|(?P<space>[ \t]+)|.",
    re.DOTALL,
)


_PART = r"""(?:[\w-]+|"[^"]*"|'[^']*')"""
_ASSIGNMENT = re.compile(rf"\s*({_PART}(?:\s*\.\s*{_PART})*)\s*=")


def parse_toml(data: bytes, file: str) -> tuple[str, dict[str, Any]]:
    """Parse the bytes of a TOML file, and return its text and its content.

    Raises:
        ModelError: The file is not UTF-8, not TOML, or too large; the message names the line.
    """
    import tomllib  # imported late: most files are found checked in the cache folder

    if len(data) > LARGEST_TOML:
        raise ModelError(f"is larger than {LARGEST_TOML // 2**20} MiB", file=file)
    try:
        text = data.decode("utf-8")
        _refuse_long_keys(text, file)
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


def _refuse_long_keys(text: str, file: str) -> None:
    """Raise ModelError for keys of more than `MOST_PARTS` parts, before they are parsed."""
    parts, after_dot = 0, False
    for token in _TOKEN.finditer(text):
        if token.lastgroup == "space":
            continue
        if token.lastgroup == "part":
            parts = parts + 1 if after_dot else 1
            after_dot = False
            if parts > MOST_PARTS:
                line = text.count("\n", 0, token.start()) + 1
                raise ModelError(f"a key has more than {MOST_PARTS} parts", file=file, line=line)
        else:
            after_dot = parts > 0 and token[0] == "."


def line_of(text: str, keys: Keys) -> int | None:
    """Return the line (from 1) that defines a key of a TOML text, else that of the innermost table around it.

    Args:
        keys: Tables, indices of tables in an array, and the key.
    """
    table: Keys = ()
    counts: dict[Keys, int] = {}
    best: tuple[int, int | None] = (0, None)
    for number, line in enumerate(text.splitlines(), start=1):
        if header := re.match(r"\s*\[\[\s*([^\[\]]+?)\s*\]\]", line):
            name = _dotted(header[1], counts)
            counts[name] = counts.get(name, -1) + 1
            defined: Keys = (*name, counts[name])
            table = defined
        elif header := re.match(r"\s*\[\s*([^\[\]]+?)\s*\]\s*(#|$)", line):
            defined = table = _dotted(header[1], counts)
        elif assignment := _ASSIGNMENT.match(line):
            defined = (*table, *_dotted(assignment[1], {}))
        else:
            continue
        if isinstance(defined[-1], int) and defined[:-1] == keys:  # an array is defined where it begins
            defined = keys
        shared = len(defined)
        if defined == keys[:shared] and shared > best[0]:
            best = (shared, number)
    return best[1]


def _dotted(text: str, counts: dict[Keys, int]) -> Keys:
    """Split a dotted key; after the name of an array of tables, insert the index of its last table."""
    out: Keys = ()
    parts = [part.strip("\"'") for part in re.findall(r"""[\w-]+|"[^"]*"|'[^']*'""", text)]
    for i, part in enumerate(parts):
        out = (*out, part)
        if out in counts and i < len(parts) - 1:
            out = (*out, counts[out])
    return out
