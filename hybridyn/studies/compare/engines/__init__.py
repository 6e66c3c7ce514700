"""The engines: each file makes an engine of a robot, in every way in which the engine can take it."""
