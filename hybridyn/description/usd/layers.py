"""Open a USD file with OpenUSD, after a check that every layer that it names is in the robot's folders."""

from __future__ import annotations

import os
import re
from typing import Any

from pxr import Ar, Sdf, Usd

from ...errors import ModelError
from ..urdf.robot_folders import RobotFolders

#: Formats by the first bytes of a file; OpenUSD knows them by the endings of names.
STARTS = {b"#usda": "usda", b"#sdf": "usda", b"PXR-USDC": "usdc", b"PK\x03\x04": "usdz"}

#: What a file is whose name does not end in its format.
NOT_NAMED = {
    "usda": "USD, but its name does not say so; rename it to end in .usda",
    "usdc": "USD (usdc), but its name does not say so; rename it to end in .usdc",
    "usdz": "a zip archive, which is read as a USD package only; rename it to end in .usdz if it is one",
}

_PLACE = re.compile(r"'?([^':\n]+):(\d+):\d+: ([^\n]*)")
_GRAMMAR = re.compile(r"parse error matching .*?(?= at '|$)")
_QUOTED = re.compile(r": '(.*?)'?\s*$", re.DOTALL)


def open_stage(file: str, folders: RobotFolders) -> Any:
    """Open a file with the layers that it names.

    Args:
        file: Path of the file.
        folders: The folders in which layers may be.

    Raises:
        ModelError: A layer cannot be read, or may not be.
        Tf.ErrorException: OpenUSD refuses a layer, see `refusal`.
    """
    start = folders.read(file)[:8]
    kind = next(kind for first, kind in STARTS.items() if start.startswith(first))
    if os.path.splitext(file)[1] not in (".usd", f".{kind}"):
        raise ModelError(f"this is {NOT_NAMED[kind]}", file=file)
    root = _opened(os.path.abspath(file), "", file)
    _check_layers(root, folders, file)
    stage = Usd.Stage.Open(root)
    for problem in stage.GetCompositionErrors():
        raise ModelError(f"OpenUSD: {' '.join(str(problem).split())}", file=file)
    return stage


def _check_layers(root: Any, folders: RobotFolders, file: str) -> None:
    """Check the layers that a layer names, those that they name, and so on."""
    waiting, seen = [root], {root.identifier}
    while waiting:
        layer = waiting.pop()
        for asset in layer.GetCompositionAssetDependencies():
            path = layer.ComputeAbsolutePath(asset) if asset else ""  # one prim may name another
            if not path or path in seen:
                continue
            seen.add(path)
            if "`" in asset:
                raise ModelError(
                    f"layer '{asset}': expressions in paths are not read; write the path", file=file
                )
            try:
                folders.read(Ar.SplitPackageRelativePathOuter(path)[0] or path)
            except (ModelError, OSError, ValueError) as error:
                reason = f"cannot be read: {error.strerror}" if isinstance(error, OSError) else error
                raise ModelError(f"layer '{asset}': {reason}", file=file) from None
            waiting.append(_opened(path, f"layer '{asset}'", file))


def _opened(path: str, name: str, file: str) -> Any:
    layer = Sdf.Layer.FindOrOpen(path)
    if layer is None:
        raise ModelError(f"OpenUSD cannot read {name or 'it'}", file=file)
    return layer


def refusal(error: Exception, file: str) -> ModelError:
    """Return the refusal of a file with OpenUSD's reason, and its file and line where it names them."""
    text = str(error)
    if place := _PLACE.search(text):
        reason = _GRAMMAR.sub("it is not well formed", place[3].strip())
        other = os.path.exists(place[1]) and not os.path.samefile(place[1], file)
        where = os.path.relpath(place[1]) if other else file
        return ModelError(f"OpenUSD: {reason}", file=where, line=int(place[2]))
    first = next((line for line in text.splitlines() if line.strip()), type(error).__name__)
    quoted = _QUOTED.search(first)
    return ModelError(f"OpenUSD: {' '.join((quoted[1] if quoted else first).split())}", file=file)
