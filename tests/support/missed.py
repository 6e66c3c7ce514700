"""The tests that the last run skipped for an extra that was not installed: `pytest --missed` runs them."""

import pytest

#: The words of `extras.skip` by which a skipped test is known.
NEEDS = "needs the extra"
#: Name of the list in pytest's cache.
CACHE = "hybridyn/missed"


class Missed:
    """Collects the names of skipped tests and files, and keeps them in pytest's cache at the end."""

    def __init__(self) -> None:
        self.names: set[str] = set()

    def pytest_runtest_logreport(self, report: pytest.TestReport | pytest.CollectReport) -> None:
        """Note a skipped test or file."""
        if report.skipped and NEEDS in str(report.longrepr):
            self.names.add(report.nodeid)

    pytest_collectreport = pytest_runtest_logreport

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Keep the names for the next run."""
        if cache := _cache(session.config):
            cache.set(CACHE, sorted(self.names))


def select(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Keep the tests that the last run skipped, by their own names or their files'."""
    cache = _cache(config)
    names = set(cache.get(CACHE, []) if cache else [])
    items[:] = [item for item in items if item.nodeid in names or item.nodeid.split("::", 1)[0] in names]


def _cache(config: pytest.Config) -> pytest.Cache | None:
    """Return the cache, or None where it is switched off."""
    return getattr(config, "cache", None)
