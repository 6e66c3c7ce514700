"""Whether a path is that of a bag of ROS 2; the command line asks before anything large is imported."""

import os


def is_bag(path: str | os.PathLike[str]) -> bool:
    """Return whether a path is that of a bag, perhaps with a topic, `BAG#/joint_states`."""
    return os.path.isfile(os.path.join(str(path).partition("#")[0], "metadata.yaml"))
