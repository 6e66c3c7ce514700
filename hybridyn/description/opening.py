"""Open a robot file: read its bytes, expand xacro, and parse XML."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from ..errors import ModelError
from .files_read import record
from .names import listed
from .urdf.foreign import unread_form
from .urdf.xacro import expand
from .urdf.xml_node import LARGEST_FILE, Node, parse

#: First bytes of USD files: text, binary, package. USD is no XML: an empty element `USD` stands for it.
USD_STARTS = (b"#usda", b"#sdf", b"PXR-USDC", b"PK\x03\x04")
USD = b"<_usd/>"


def open_robot(
    path: str | os.PathLike[str],
    xacro_args: Mapping[str, object] | None = None,
    package_dirs: Sequence[str | os.PathLike[str]] = (),
) -> Node:
    """Return the root element of a robot file, expanded if it is xacro, without checking its content.

    USD is no XML: its root is `USD`, without content.

    Raises:
        ModelError: The file cannot be read, is not XML, or xacro reports an error.
    """
    return open_file(path, xacro_args or {}, package_dirs)[0]


def split_model(path: str | os.PathLike[str]) -> tuple[str, str]:
    """Split `world.sdf#arm` into the file and the name of its model, "" where none is named."""
    whole = os.fspath(path)
    file, _, model = whole.rpartition("#")
    return (whole, "") if not file or not model or os.path.exists(whole) else (file, model)


def open_file(
    path: str | os.PathLike[str],
    xacro_args: Mapping[str, object],
    package_dirs: Sequence[str | os.PathLike[str]],
) -> tuple[Node, list[str]]:
    """Return the root element of a file, of one model if the path names it, and notes of XML and xacro."""
    file, model = split_model(path)
    root, notes = _expanded(file, xacro_args, package_dirs)
    if model:
        from .sdf.library import keep_model

        keep_model(root, model)
    return root, notes


def _expanded(
    file: str, xacro_args: Mapping[str, object], package_dirs: Sequence[str | os.PathLike[str]]
) -> tuple[Node, list[str]]:
    """Return the root element of a file, expanded if it is xacro, and the notes of that expansion."""
    text = read_bytes(file)
    if not file.endswith(".xacro"):
        root = _parsed(text, file)
        if not any(node.tag.startswith("xacro:") for node in root.descendants()):
            if xacro_args:
                raise ModelError(
                    f"is not a xacro file, so it takes no arguments ({listed(xacro_args)})", file=file
                )
            return root, list(root.notes)
    expanded, notes = expand(file, xacro_args, package_dirs)
    return parse(expanded, file, placed=True), notes


def _parsed(text: bytes, file: str) -> Node:
    """Parse a robot file; if it is not XML, add its recognised format to the error.

    Raises:
        ModelError: The text is not well-formed XML.
    """
    try:
        return parse(USD if text.startswith(USD_STARTS) else text, file)
    except ModelError as error:
        if message := unread_form(text):
            error.args = (f"{error}; {message}",)
        raise


def read_bytes(file: str) -> bytes:
    """Return the content of a file.

    Raises:
        ModelError: The file cannot be read, is not a regular file, or is larger than `LARGEST_FILE`.
    """
    try:
        path = Path(file)
        if path.is_dir():
            raise ModelError("is a folder; name the robot file in it", file=file)
        if path.exists() and not path.is_file():
            raise ModelError("is not a regular file", file=file)
        if path.stat().st_size > LARGEST_FILE:
            raise ModelError(f"is larger than {LARGEST_FILE // 2**20} MiB", file=file)
        content = path.read_bytes()
        record(file, content)
        return content
    except OSError as error:
        raise ModelError(f"cannot be read: {error.strerror}", file=file) from None
    except ValueError as error:
        raise ModelError(f"is not a valid path: {error}", file=file) from None
