"""Findings that the readers and the build of a robot state themselves."""

from __future__ import annotations

from collections.abc import Iterator

from ...description.names import drops
from ...description.notes import place_of
from ...errors import AssemblyError, HybridynError, ModelError
from .finding import Finding
from .subject import Subject

REPORTED_ELSEWHERE = ("unphysical inertia", "no file says which joints", "both ignored")


def check_notes(subject: Subject) -> Iterator[Finding]:
    """Pass on the reader's remarks."""
    description = subject.description
    dropped = drops(description.notes)
    for note in dropped:
        file, line, text = place_of(note)
        yield Finding(
            "dropped",
            "",
            text,
            "an engine that reads it computes another motion, or other efforts",
            "state it in model.toml or in a form that is read, or nothing if you do without it",
            file or description.source,
            line,
        )
    for note in description.notes:
        if note not in dropped and not any(text in note for text in REPORTED_ELSEWHERE):
            file, line, text = place_of(note)
            yield Finding(
                "reader",
                "",
                text,
                "something in the file was ignored or interpreted in a particular way",
                "nothing to do if that is what you intend",
                file or description.source,
                line,
            )


def not_built(subject: Subject, error: HybridynError) -> Finding:
    """Return the finding that says why the robot cannot be built."""
    element = getattr(error, "module" if isinstance(error, AssemblyError) else "element", None)
    closures = sorted(
        subject.description.closures,
        key=lambda closure: (closure.name != element, element not in (closure.link_a, closure.link_b)),
    )
    place = subject.first_place(closure.name for closure in closures[:1])
    if isinstance(error, AssemblyError):
        return Finding(
            "loops-close-nowhere",
            f"module '{element}'",
            str(error),
            "the robot cannot be assembled in any posture",
            "check the frames and the axes of its closures, one after the other",
            *place,
        )
    doubt = "rank_tolerance" in str(error)
    return Finding(
        "rank-in-doubt" if doubt else "no-robot",
        f"'{element}'" if element else "",
        getattr(error, "message", str(error)),
        "every result depends on the number of freedoms" if doubt else "nothing can be computed",
        "pass --rank-tolerance as the message says, or write more digits"
        if doubt
        else "correct the element that the message names",
        *place,
    )


def unreadable(error: HybridynError, file: str) -> Finding:
    """Return the finding that says why a file cannot be read."""
    place = (error.file, error.line) if isinstance(error, ModelError) else (file, None)
    message = error.message if isinstance(error, ModelError) else str(error)
    element = getattr(error, "element", None)
    return Finding(
        "unreadable",
        f"'{element}'" if element else "",
        message,
        "no other check can run before the file can be read",
        "correct the element that the message names, and check again",
        place[0] or file,
        place[1],
    )
