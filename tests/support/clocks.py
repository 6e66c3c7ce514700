"""A clock for tests of what measures time: it moves as the test says, not as fast as the machine is."""


class Clock:
    """Stands for the module `time` in a file that reads it.

    Attributes:
        now: Time [s]; the test may change it.
        tick: What each reading adds [s].
    """

    def __init__(self, now: float = 0.0, tick: float = 0.0) -> None:
        self.now, self.tick = now, tick

    def perf_counter(self) -> float:
        """Return the time after one more tick [s]."""
        self.now += self.tick
        return self.now

    time = process_time = perf_counter
