"""Seeded mutations of text files: bytes, numbers, names, values, whole elements."""

import random
import re
from collections.abc import Callable

Mutation = Callable[[str, random.Random], bytes]

NUMBERS = [
    "nan",
    "inf",
    "-1",
    "1e400",
    "1,5",
    "",
    "0",
    "-0",
    "1e-320",
    "1e149",
    "0x1",
    "1_0",
    "999999999999999999999",
]
WORDS = [
    "",
    "a",
    "loop",
    "joint",
    "end_a",
    "drive",
    "lopp",
    "../x",
    "\u00e9",
    "a b",
    "&lt;",
    "${x}",
    "\u202e",
]


def flip_bytes(text: str, draw: random.Random) -> bytes:
    raw = bytearray(text.encode())
    for _ in range(draw.choice([1, 1, 2, 5])):
        raw[draw.randrange(len(raw))] = draw.randrange(256)
    return bytes(raw)


def cut(text: str, draw: random.Random) -> bytes:
    start = draw.randrange(len(text))
    return (text[:start] + text[start + draw.choice([1, 3, 30, 300]) :]).encode()


def elements(text: str) -> list[re.Match[str]]:
    """Return the spans of whole elements: empty ones, and those that hold no element of their own name."""
    return list(re.finditer(r"<([\w:]+)\b[^<>]*/>|<([\w:]+)\b[^<>]*>(?:(?!<\2\b).)*?</\2>", text, re.DOTALL))


def drop_element(text: str, draw: random.Random) -> bytes:
    return _spliced(text, draw, lambda part: "")


def double_element(text: str, draw: random.Random) -> bytes:
    return _spliced(text, draw, lambda part: part + part)


def move_element(text: str, draw: random.Random) -> bytes:
    part = draw.choice(elements(text) or [re.match("", text)])[0]
    rest = text.replace(part, "", 1)
    places = [match.end() for match in re.finditer(r">", rest)] or [0]
    at = draw.choice(places)
    return (rest[:at] + part + rest[at:]).encode()


def wrap_element(text: str, draw: random.Random) -> bytes:
    tag = draw.choice(["link", "joint", "loop", "group", "gazebo", "x"])
    return _spliced(text, draw, lambda part: f"<{tag}>{part}</{tag}>")


def rename(text: str, draw: random.Random) -> bytes:
    """Misspell one tag (both ends) or one attribute."""
    words = sorted(set(re.findall(r"</([\w:]+)>|\s([\w:]+)=|^(\w+):|^(\w+) =", text, re.MULTILINE)))
    word = next(part for part in draw.choice(words or [("x", "")]) if part)
    letters = list(word)
    at = draw.randrange(len(letters))
    letters[at] = draw.choice(["", letters[at] * 2, "z", letters[at].upper()])
    return re.sub(rf"\b{re.escape(word)}\b", "".join(letters), text, count=draw.choice([0, 0, 1])).encode()


def change_number(text: str, draw: random.Random) -> bytes:
    return _replaced(text, draw, r"(?<![\w.])-?\d+(\.\d+)?(e-?\d+)?(?![\w.])", NUMBERS)


def change_value(text: str, draw: random.Random) -> bytes:
    return _replaced(text, draw, r"(?<=[\"'\[, ])\w+(?=[\"'\], ])", WORDS)


def swap_values(text: str, draw: random.Random) -> bytes:
    found = list(re.finditer(r'(?<==")[^"]*(?=")|(?<=\[)[^\[\]]*(?=\])', text))
    if len(found) < 2:
        return text.encode()
    first, second = sorted(draw.sample(found, 2), key=lambda match: match.start())
    middle = text[first.end() : second.start()]
    return (text[: first.start()] + second[0] + middle + first[0] + text[second.end() :]).encode()


def _spliced(text: str, draw: random.Random, change: Callable[[str], str]) -> bytes:
    part = draw.choice(elements(text) or [re.match(".*", text)])
    return (text[: part.start()] + change(part[0]) + text[part.end() :]).encode()


def _replaced(text: str, draw: random.Random, pattern: str, by: list[str]) -> bytes:
    found = list(re.finditer(pattern, text))
    if not found:
        return text.encode()
    part = draw.choice(found)
    return (text[: part.start()] + draw.choice(by) + text[part.end() :]).encode()


def lines(text: str, draw: random.Random) -> bytes:
    """Drop, double or move a line."""
    rows = text.split("\n")
    i = draw.randrange(len(rows))
    row = rows.pop(i)
    if draw.random() < 0.6:
        for _ in range(draw.choice([1, 2])):
            rows.insert(draw.choice([i, draw.randrange(len(rows))]), row)
    return "\n".join(rows).encode()


def replaced(pattern: str, words: list[str]) -> Mutation:
    """Return a mutation that puts another word, or another part of the text, in the place of a part."""
    return lambda text, draw: _replaced(
        text, draw, pattern, [*words, draw.choice(re.findall(pattern, text) or [""])]
    )


TYPES = ["Xform", "PhysicsJoint", "PhysicsFixedJoint", "PhysicsDistanceJoint", "Mesh", "Plane", "Foo", ""]
USDA: list[Mutation] = [
    flip_bytes,
    cut,
    lines,
    lines,
    replaced(r"(?<![\w.])-?\d*\.?\d+(?!\w)", [*NUMBERS, "1e39", "180", "2"]),
    replaced(r"</[\w/]+>", ["</robot>", "</robot/j1>", "</robot/g/shape>", "</x>", "<>"]),
    replaced(r"(?<=def )\w+", TYPES),
    replaced(r'(?<=")\w[\w:]+(?=")', [*WORDS, "PhysicsRigidBodyAPI", "PhysicsArticulationRootAPI", "transX"]),
    replaced(
        r"(?<=\n)(float|point3f|quatf|bool|token|rel)(?= )", ["float", "double3", "string", "token[]", "rel"]
    ),
    replaced(r"[\w:]+:[\w:]+(?= =)", ["physics:mass", "physics:localPos0", "xformOp:translate", "foo:bar"]),
]
FLAT = [flip_bytes, cut, change_number, change_value, rename, swap_values]
TREE = [*FLAT, drop_element, double_element, move_element, wrap_element]
