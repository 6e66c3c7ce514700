"""Digests that say whether results are of the same study."""

from __future__ import annotations

import contextlib
import hashlib
import json

from ...description.reading import read_bytes
from ...description.urdf.robot_folders import recorded
from ...errors import HybridynError
from .designs import Designs
from .study_file import StudyFile
from .variants import Variants


def identity(source: StudyFile, designs: Designs) -> str:
    """Compute a digest of a study and of all files that it reads; meshes are no part of it.

    These are the files that the study names, functions in Python among them, those that the robot's file
    includes for the first design, and `model.toml` and other files beside it.

    Raises:
        ModelError: A file that the study names cannot be read.
    """
    said = source.study.model_dump_json(exclude={"designs": {"check"}})
    digest = hashlib.sha256(said.encode())
    for path in source.files:
        digest.update(read_bytes(path))
    variants = Variants(source)
    with recorded() as files, contextlib.suppress(HybridynError):  # the files of a robot that does not load
        variants.description(variants.named(designs.values(0, 1)[0]))
    digest.update(json.dumps([files[path] for path in sorted(files)]).encode())
    return digest.hexdigest()
