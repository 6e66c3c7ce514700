"""Small files of tests."""

from pathlib import Path

from lxml import etree

from hybridyn.description.reading import open_robot
from tests import ROOT


def save(folder: Path, text: str | bytes, name: str = "four_bar.urdf") -> Path:
    """Write a text to a file in a folder, which is made where it is missing, and give its path."""
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def beginning(folder: Path, robot: str, rows: int) -> Path:
    """Write the header and the first rows of a shipped robot's motion to "motion.csv", and give its path."""
    lines = (ROOT / "models" / robot / "traj.csv").read_text().splitlines(keepends=True)
    return save(folder, "".join(lines[: rows + 1]), "motion.csv")


def expanded(file: Path) -> str:
    """Return the text of an expanded xacro file."""
    return str(etree.tostring(open_robot(file).xml, encoding="unicode"))
