"""Puts the shipped configurations, maps and samples into an installed package.

In a clone they lie at its top, where people look for them; see opamc_cli/config/shipped.py.
"""

import shutil
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

SHIPPED = ("configs", "data/samples")


class BuildWithShipped(build_py):
    """Copies the shipped files beside the package's own, but for an editable install."""

    def run(self) -> None:
        """Build, then copy."""
        super().run()
        if self.editable_mode:
            return
        for place in SHIPPED:
            target = Path(self.build_lib, "opamc_cli", "shipped", place)
            shutil.copytree(place, target, dirs_exist_ok=True)


setup(cmdclass={"build_py": BuildWithShipped})
