"""Extension module in Rust; its contents are used by the modules of the package."""

from collections.abc import Callable, Sequence
from os import PathLike
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "FittedDecoder",
    "Network",
    "Sensor",
    "Training",
    "default_geometry",
    "fit_decoder",
    "import_recording",
    "load_network",
    "node_errors",
    "run_program",
    "simulate",
    "train",
]

_Matrix = NDArray[np.float64] | NDArray[np.float32]
_Path = str | PathLike[str]
_Samples = tuple[_Matrix, _Matrix, Sequence[int] | None, Sequence[int] | None]

@final
class Network:
    def predict(
        self,
        X: _Matrix,
        rows: Sequence[int] | None = None,
        times: Sequence[float] | None = None,
        groups: Sequence[int] | None = None,
    ) -> NDArray[np.float64]: ...
    def half_widths(self, answers: _Matrix) -> NDArray[np.float64]: ...
    @property
    def inputs(self) -> list[str]: ...
    @property
    def input_units(self) -> list[str | None]: ...
    @property
    def targets(self) -> list[str]: ...
    @property
    def target_units(self) -> list[str | None]: ...
    @property
    def row_wires(self) -> list[int] | None: ...
    @property
    def hidden_nodes(self) -> int: ...
    @property
    def weights(self) -> int: ...
    @property
    def has_intervals(self) -> bool: ...
    @property
    def metadata(self) -> dict[str, Any]: ...
    @property
    def networks(self) -> list[dict[str, Any]]: ...
    def export(self, path: _Path, format: str = "onnx", precision: str = "f64") -> dict[str, Any]: ...
    def save(self, path: _Path) -> None: ...
    def save_trained(self, path: _Path, training: _Samples, test: _Samples) -> None: ...
    @staticmethod
    def _restore(state: bytes) -> Network: ...

@final
class Training:
    @property
    def network(self) -> Network: ...
    @property
    def epochs(self) -> int: ...
    @property
    def best_epoch(self) -> int: ...
    @property
    def stop_reason(self) -> str: ...
    @property
    def warning(self) -> str | None: ...
    @property
    def interruption(self) -> BaseException | None: ...
    @property
    def loss_curve(self) -> NDArray[np.float64]: ...
    @property
    def validation_loss_curve(self) -> NDArray[np.float64] | None: ...

@final
class FittedDecoder:
    def predict(self, readings: _Matrix, rows: Sequence[int] | None = None) -> NDArray[np.float64]: ...
    @staticmethod
    def _restore(state: bytes) -> FittedDecoder: ...

@final
class Sensor:
    def __new__(cls, scale: str, geometry: dict[str, float], resistivity_ohm_per_mm: float) -> Sensor: ...
    @property
    def scale(self) -> str: ...
    @property
    def counts(self) -> tuple[int, int, int, int]: ...
    def positions(self, displacements: NDArray[np.float64]) -> NDArray[np.float64]: ...
    def resistances(self, displacements: NDArray[np.float64]) -> NDArray[np.float64]: ...
    def jacobian(self, displacements: NDArray[np.float64]) -> NDArray[np.float64]: ...
    def identifiability(
        self, row: int, displacements: _Matrix, axes: str, noise: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], float, float]: ...
    @staticmethod
    def _restore(state: str) -> Sensor: ...

def train(
    readings: _Matrix,
    targets: _Matrix,
    settings: dict[str, Any],
    *,
    row_wires: Sequence[int] | None = None,
    groups: Sequence[int] | None = None,
    validation: tuple[_Matrix, _Matrix, Sequence[int] | None] | None = None,
    callback: Callable[[int, dict[str, float | None]], object] | None = None,
) -> Training: ...
def fit_decoder(
    kind: str,
    readings: _Matrix,
    targets: _Matrix,
    *,
    inputs: str,
    scaling: str,
    seed: int,
    row_wires: Sequence[int] | None = None,
    groups: Sequence[int] | None = None,
) -> FittedDecoder: ...
def load_network(path: _Path) -> Network: ...
def import_recording(recipe: _Path, seed: int) -> dict[str, Any]: ...
def simulate(
    sensor: Sensor, settings: dict[str, Any]
) -> tuple[dict[str, Any], dict[str, Any] | None, dict[str, Any], float]: ...
def node_errors(
    truth: _Matrix,
    decoded: _Matrix,
    stroke_mm: float,
    row_wires: Sequence[int] | None = None,
    snapshots: Sequence[int] | None = None,
) -> dict[str, Any]: ...
def default_geometry() -> tuple[dict[str, float], float, str]: ...
def run_program(arguments: Sequence[str]) -> int: ...
