"""A headless Chromium for tests of pages, where there is one."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.support.extras import needs

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = (
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--use-gl=angle", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
)  # fmt: skip


def chromium() -> str:
    """Return the path of a Chromium, or skip the test."""
    needs("dev", "playwright")
    found = next((path for name in NAMES if (path := shutil.which(name))), None)
    if found is None:
        pytest.skip(
            f"no browser: none of {', '.join(NAMES)} is on the path (Debian: apt-get install chromium)"
        )
    return found


@contextmanager
def browser(profile: Path) -> Iterator[Any]:
    """Return a browser's context with an empty profile, drawing without a graphics card."""
    program = chromium()
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        context = playwright.chromium.launch_persistent_context(
            str(profile),
            executable_path=program,
            headless=True,
            args=list(FLAGS),
            viewport={"width": 900, "height": 640},
        )
        try:
            yield context
        finally:
            context.close()
