"""A headless browser for the tests that look at pages, with a home of its own."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

BROWSER = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), ""
)
FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--hide-scrollbars"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
    "--disable-dev-shm-usage",
)
needs_browser = pytest.mark.skipif(not BROWSER, reason="no Chromium on this machine")


def browse(folder: Path, page: Path, *options: str, dark: bool = False) -> str:
    """Open a page with the given options; return what the browser printed."""
    # what it keeps at home goes with the test
    ended = subprocess.run(
        [
            *(BROWSER, *FLAGS, f"--user-data-dir={folder / 'profile'}"),
            f"--blink-settings=preferredColorScheme={int(not dark)}",
            *(*options, page.as_uri()),
        ],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        env=os.environ | {"HOME": str(folder)},
    )
    assert ended.returncode == 0, ended.stderr[-500:]
    return ended.stdout
