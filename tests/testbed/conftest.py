"""The robot of configs/testbed.yaml, and short programs."""

from dataclasses import replace
from pathlib import Path

import pytest

from opamc_cli.config.testbed import TestbedConfig, load_testbed
from opamc_cli.testbed.parameters import Robot
from opamc_cli.testbed.program import Program

CONFIG = Path(__file__).parents[2] / "configs" / "testbed.yaml"


@pytest.fixture(scope="session")
def testbed() -> TestbedConfig:
    return load_testbed(CONFIG)


@pytest.fixture(scope="session")
def robot(testbed: TestbedConfig) -> Robot:
    return testbed.robot


@pytest.fixture
def program(testbed: TestbedConfig) -> Program:
    """One cycle of axis 3."""
    return replace(testbed.program, axes=(3,), cycles=1)
