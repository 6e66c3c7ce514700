"""What accuracy costs in time, for one robot and one motion (`hybridyn cost`).

`points` says what a measured configuration is, and which of them are worth having; `models` measures the
inverse model along a trajectory, `runs` the integration of a scene.
"""
