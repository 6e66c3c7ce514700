"""Open a USD file after a check of every layer that it names: inside the folders, regular, not too large."""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Sequence
from typing import Any

from pxr import Ar, Sdf, Tf, Usd

#: First bytes of the text format, older ones included, of the binary format, and of a package.
TEXT, BINARY, PACKAGE = (b"#usda", b"#sdf"), b"PXR-USDC", b"PK\x03\x04"

#: Formats that the suffix of a file may stand for; for any other, the content decides alone.
SUFFIXES = {".usd": ("usda", "usdc"), ".usda": ("usda",), ".usdc": ("usdc",), ".usdz": ("usdz",)}

#: Most layers of a robot.
MOST_LAYERS = 1000

_PLACE = re.compile(r"'?([^':\n]+):(\d+):\d+: ([^\n]*)")
_GRAMMAR = re.compile(r"parse error matching .*?(?= at '|$)")
_QUOTED = re.compile(r": '(.*?)'?\s*$", re.DOTALL)


class RefusedError(Exception):
    """The file is refused.

    Attributes:
        file: Path of the file that is wrong, or None for the robot's own.
        line: Line in it, or None.
    """

    def __init__(self, message: str, file: str | None = None, line: int | None = None) -> None:
        super().__init__(message)
        self.file, self.line = file, line


def open_stage(file: str, folders: Sequence[str], largest: int) -> Any:
    """Open a file with the layers that it names.

    Args:
        folders: Real paths of the folders in which layers may be.
        largest: Largest size of all layers together [bytes].

    Raises:
        RefusedError: A layer cannot be read, or may not be.
    """
    root = _root_layer(file)
    _check_layers(root, folders, largest)
    try:
        stage = Usd.Stage.Open(root)
    except Tf.ErrorException as error:
        raise refusal(error) from None
    for problem in stage.GetCompositionErrors():
        raise RefusedError(f"OpenUSD: {' '.join(str(problem).split())}")
    return stage


def _root_layer(file: str) -> Any:
    """Return the robot's own layer, whose format its content decides."""
    with open(file, "rb") as opened:
        start = opened.read(8)
    if start.startswith(TEXT):
        kind = "usda"
    elif start.startswith(BINARY):
        kind = "usdc"
    else:
        kind = "usdz"
    if kind in SUFFIXES.get(os.path.splitext(file)[1], ()):
        return _opened(file)
    advice = f"rename it to end in .{kind}"
    if kind == "usdz":
        raise RefusedError(
            f"this is a zip archive, which is read as a USD package only; {advice} if it is one"
        )
    if kind != "usda":
        raise RefusedError(f"this is USD ({kind}), but its name does not say so; {advice}")
    layer = Sdf.Layer.CreateAnonymous("robot.usda")
    try:
        with open(file, encoding="utf-8") as text:
            done = layer.ImportFromString(text.read())
    except (Tf.ErrorException, UnicodeDecodeError) as error:
        raise refusal(error) from None
    if not done:
        raise RefusedError("OpenUSD cannot read it")
    if any(layer.GetCompositionAssetDependencies()):
        raise RefusedError(f"it names other layers, but its own name does not end in .usda; {advice}")
    return layer


def _check_layers(root: Any, folders: Sequence[str], largest: int) -> None:
    """Check the layers that a layer names, those that they name, and so on."""
    waiting, seen, total = [root], {root.identifier}, 0
    while waiting:
        layer = waiting.pop()
        for asset in layer.GetCompositionAssetDependencies():
            path = _path_of(layer, asset) if asset else ""  # one prim of a layer may name another
            if not path or path in seen:
                continue
            seen.add(path)
            if len(seen) > MOST_LAYERS:
                raise RefusedError(f"it has more than {MOST_LAYERS:,} layers")
            outer = Ar.SplitPackageRelativePathOuter(path)[0] if Ar.IsPackageRelativePath(path) else path
            total += _checked_size(asset, outer, folders)
            if total > largest:
                raise RefusedError(f"its layers together are larger than {largest // 2**20} MiB")
            waiting.append(_opened(path, asset))


def _path_of(layer: Any, asset: str) -> str:
    """Return the path of a layer that another names."""
    if "`" in asset or ":SDF_FORMAT_ARGS:" in asset or "\0" in asset:
        raise RefusedError(
            f"layer '{asset}': expressions and arguments in paths are not read; write the path of the file",
            str(layer.realPath) or None,
        )
    return str(layer.ComputeAbsolutePath(asset))


def _checked_size(asset: str, path: str, folders: Sequence[str]) -> int:
    """Return the size of a layer's file [bytes]."""
    real = os.path.realpath(path)
    around = [at for at in folders if at != os.sep and os.path.commonpath([real, at]) == at]
    inside = [os.path.relpath(real, at) for at in around]
    if not inside:
        raise RefusedError(
            f"layer '{asset}' is outside the robot's folder; copy it there, or name its folder with "
            "package_dirs"
        )
    if all(any(part.startswith(".") for part in rest.split(os.sep)) for rest in inside):
        raise RefusedError(f"layer '{asset}' is hidden, and a robot file may not read it")
    try:
        about = os.stat(real)
    except OSError as error:
        raise RefusedError(f"layer '{asset}' cannot be read: {error.strerror}") from None
    if not stat.S_ISREG(about.st_mode):
        raise RefusedError(f"layer '{asset}' is not a regular file")
    return about.st_size


def _opened(path: str, asset: str | None = None) -> Any:
    """Return a layer; raise RefusedError with OpenUSD's reason if it cannot be read."""
    try:
        layer = Sdf.Layer.FindOrOpen(path)
    except Tf.ErrorException as error:
        raise refusal(error) from None
    if layer is None:
        raise RefusedError(f"OpenUSD cannot read layer '{asset}'" if asset else "OpenUSD cannot read it")
    return layer


def refusal(error: Exception) -> RefusedError:
    """Return the refusal with OpenUSD's reason, file and line."""
    text = str(error)
    if place := _PLACE.search(text):
        reason = _GRAMMAR.sub("it is not well formed", place[3].strip())
        return RefusedError(f"OpenUSD: {reason}", place[1], int(place[2]))
    lines = [line for line in text.splitlines() if line.strip()]
    first = lines[0] if lines else type(error).__name__
    quoted = _QUOTED.search(first)
    return RefusedError(f"OpenUSD: {' '.join((quoted[1] if quoted else first).split())}")
