"""The kinds of joints, each once: coordinates, motion and names, on numbers or symbols."""
