"""Make names, find the one that a misspelt name probably means, count and list things in messages."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping

#: How notes on physics begin, behind the place: the file states a force, an inertia or a constraint for some
#: engine, and the robot has it not. `load` warns of them.
DROPS = "drops"

#: Why it is told.
NOTHING = "no force, inertia or constraint comes of it here"

#: How many names an error message lists before it writes "and n more".
LISTED_NAMES = 8
#: Least similarity of a name to the one that it probably means, as difflib measures it.
SIMILAR = 0.72


def closest(name: str, known: Iterable[str]) -> str | None:
    """Return the known name most similar to `name`, or None if none is similar."""
    return _closest(name, tuple(known))


@functools.lru_cache(maxsize=256)  # a file repeats its unknown tags
def _closest(name: str, known: tuple[str, ...]) -> str | None:
    by_lower = {candidate.lower(): candidate for candidate in known}
    for word in by_lower:
        if sorted(word) == sorted(name.lower()):
            return by_lower[word]
    near = [word for word in by_lower if _shared(name.lower(), word) >= SIMILAR]
    if not near:
        return None
    import difflib  # only misspelt names need it

    found = difflib.get_close_matches(name.lower(), near, n=1, cutoff=SIMILAR)
    return by_lower[found[0]] if found else None


def _shared(one: str, other: str) -> float:
    """Return the part of the letters of two words that they share, a bound on difflib's ratio."""
    shared = sum(min(one.count(letter), other.count(letter)) for letter in {*one})
    return 2 * shared / (len(one) + len(other))


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return " (did you mean 'x'?)" if another known name is similar, else an empty string."""
    best = closest(name, (word for word in known if word != name))
    return f" (did you mean '{best}'?)" if best else ""


def unique(name: str, taken: set[str]) -> str:
    """Return a name that is not taken, and take it: the name itself, else with a number."""
    number, out = 2, name
    while out in taken:
        out, number = f"{name}{number}", number + 1
    taken.add(out)
    return out


def counted(number: int, thing: str) -> str:
    """Format a count: "1 motor", "1,000 motors"."""
    return f"{number:,} {thing}" + ("" if number == 1 else "s")


def listed(names: Iterable[str]) -> str:
    """Return names in the form "'a', 'b' and 3 more"."""
    quoted = [f"'{name}'" for name in names]
    if len(quoted) <= LISTED_NAMES:
        return ", ".join(quoted)
    return ", ".join(quoted[:LISTED_NAMES]) + f" and {len(quoted) - LISTED_NAMES} more"


def noted(found: Mapping[str, Iterable[str]]) -> list[str]:
    """Return the remarks that concern something; "{}" in them stands for its names, each once."""
    named = {text: dict.fromkeys(names) for text, names in found.items()}
    return [text.replace("{}", listed(names)) for text, names in named.items() if names]


def drops(notes: Iterable[str]) -> list[str]:
    """Return the notes on what is dropped of the physics that a file states."""
    return [note for note in notes if f" {DROPS} " in f" {note}"]
