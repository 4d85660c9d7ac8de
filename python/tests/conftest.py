"""Shared samples, and the program of the installed package."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from decoupler import NetworkRegressor, Simulated, simulate


@pytest.fixture(scope="session")
def small() -> Simulated:
    return simulate("4x4_2x12", samples=200, validation_samples=40, test_samples=40, seed=3)


@pytest.fixture(scope="session")
def curve() -> tuple[np.ndarray, np.ndarray]:
    """Two targets that depend on three readings."""
    X = np.random.default_rng(0).uniform(-1.0, 1.0, size=(300, 3))
    return X, np.column_stack([np.tanh(X[:, 0] - 2.0 * X[:, 1]), X[:, 2] ** 2])


@pytest.fixture
def quick() -> NetworkRegressor:
    return NetworkRegressor(hidden=4, epochs=20, random_state=5)


def program(*arguments: str | Path, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run a command of the program."""
    command = [sys.executable, "-m", "decoupler", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, timeout=300)
