"""The resistance model of a sensor array."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native

_GEOMETRY, _RESISTIVITY_OHM_PER_MM, ASSUMPTION = _native.default_geometry()


class Identifiability(NamedTuple):
    """How well the readings of a row-wire determine the displacements of its nodes.

    Attributes
    ----------
    singular_values_per_mm : ndarray of shape (unknowns,)
        Singular values of the Jacobian of ln R in 1/mm, largest first.
    worst_pattern : ndarray of shape (nodes, 3)
        Displacements of unit length that change the readings least.
    sensitivity_per_mm : ndarray of shape (nodes, 3)
        Root mean square over the readings of the derivative of ln R, for each node and axis, in
        1/mm.
    condition : float
        Largest singular value over the smallest; infinite if a pattern changes no reading.
    worst_spread_mm : float
        Standard deviation of the worst pattern, for readings with the given noise, in mm.
    """

    singular_values_per_mm: NDArray[np.float64]
    worst_pattern: NDArray[np.float64]
    sensitivity_per_mm: NDArray[np.float64]
    condition: float
    worst_spread_mm: float


@dataclass(frozen=True)
class SensorArray:
    """Sensor array of crossed row-wires and column-wires with its resistance model.

    Row-wires run along y above the rubber, column-wires along x below it; z points up from the
    column-wires. The default geometry is partly assumed: see `ASSUMPTION`.

    Parameters
    ----------
    scale : str, default="10x10_5x30"
        Numbers M1xM2_M3xM4: row-wires, nodes on each, nodes on each column-wire, column-wires.
    height_mm : float, default=5.0
        Distance of the undeformed row-wires above the column-wires.
    row_x0_mm : float, default=8.0
        x of the first row-wire.
    row_pitch_mm : float, default=1.0
        Distance between row-wires.
    node_pitch_mm : float, default=2.0
        Distance between the nodes on a row-wire, which is centred over the column-wires.
    column_y0_mm : float, default=1.0
        y of the first column-wire.
    column_pitch_mm : float, default=1.0
        Distance between column-wires.
    column_node_x0_mm : float, default=14.0
        x of the first node on each column-wire.
    column_node_pitch_mm : float, default=5.0
        Distance between the nodes on a column-wire.
    resistivity_ohm_per_mm : float, default=100.0
        Resistance g of a millimetre of rubber.

    Examples
    --------
    >>> import numpy as np
    >>> from decoupler import SensorArray
    >>> sensor = SensorArray("10x6_3x18")
    >>> displacements = np.zeros((10, 6, 3))
    >>> before = sensor.resistances(displacements)
    >>> before.shape
    (10, 18)
    >>> displacements[0, 2, 2] = 0.5  # The third node of the first row-wire, 0.5 mm down.
    >>> bool((sensor.resistances(displacements)[0] < before[0]).all())
    True
    """

    scale: str = "10x10_5x30"
    height_mm: float = _GEOMETRY["height_mm"]
    row_x0_mm: float = _GEOMETRY["row_x0_mm"]
    row_pitch_mm: float = _GEOMETRY["row_pitch_mm"]
    node_pitch_mm: float = _GEOMETRY["node_pitch_mm"]
    column_y0_mm: float = _GEOMETRY["column_y0_mm"]
    column_pitch_mm: float = _GEOMETRY["column_pitch_mm"]
    column_node_x0_mm: float = _GEOMETRY["column_node_x0_mm"]
    column_node_pitch_mm: float = _GEOMETRY["column_node_pitch_mm"]
    resistivity_ohm_per_mm: float = _RESISTIVITY_OHM_PER_MM

    def __post_init__(self) -> None:
        geometry = {name: float(getattr(self, name)) for name in _GEOMETRY}
        native = _native.Sensor(str(self.scale), geometry, float(self.resistivity_ohm_per_mm))
        object.__setattr__(self, "_native", native)

    def _sensor(self) -> _native.Sensor:
        native: _native.Sensor = self.__dict__["_native"]
        return native

    @property
    def row_wires(self) -> int:
        """Number M1 of row-wires."""
        return self._sensor().counts[0]

    @property
    def nodes_per_row(self) -> int:
        """Number M2 of nodes on each row-wire."""
        return self._sensor().counts[1]

    @property
    def nodes_per_column(self) -> int:
        """Number M3 of nodes on each column-wire."""
        return self._sensor().counts[2]

    @property
    def column_wires(self) -> int:
        """Number M4 of column-wires: of readings of a row-wire."""
        return self._sensor().counts[3]

    def _frames(self, displacements: ArrayLike) -> tuple[NDArray[np.float64], tuple[int, ...]]:
        array = np.asarray(displacements, dtype=np.float64)
        expected = (self.row_wires, self.nodes_per_row, 3)
        if array.shape[-3:] != expected:
            raise ValueError(
                f"displacements have shape {array.shape}: give (..., {expected[0]}, {expected[1]}, "
                "3), the x, y and z (downwards) of each node of each row-wire in mm"
            )
        return array.reshape(-1, *expected), array.shape[:-3]

    def positions(self, displacements: ArrayLike | None = None) -> NDArray[np.float64]:
        """Return the positions of the nodes of the row-wires.

        Parameters
        ----------
        displacements : array-like of shape (..., M1, M2, 3), default=None
            Displacements in mm, z downwards; None for the undeformed array.

        Returns
        -------
        ndarray of shape (..., M1, M2, 3)
            Coordinates x, y and z in mm, z upwards.
        """
        if displacements is None:
            displacements = np.zeros((self.row_wires, self.nodes_per_row, 3))
        frames, leading = self._frames(displacements)
        positions = np.array([self._sensor().positions(frame) for frame in frames])
        return positions.reshape(*leading, *frames.shape[1:])

    def resistances(self, displacements: ArrayLike) -> NDArray[np.float64]:
        """Return the resistances between row-wires and column-wires, by Eq. (2) of the paper.

        Parameters
        ----------
        displacements : array-like of shape (..., M1, M2, 3)
            Displacement of each node of each row-wire along x, y and z (downwards) in mm.

        Returns
        -------
        ndarray of shape (..., M1, M4)
            Resistances in ohm.

        Raises
        ------
        ValueError
            If a node touches a column-wire.
        """
        frames, leading = self._frames(displacements)
        resistances = self._sensor().resistances(frames)
        return resistances.reshape(*leading, *resistances.shape[1:])

    def jacobian(self, displacements: ArrayLike) -> NDArray[np.float64]:
        """Return the analytic derivatives of the resistances.

        Parameters
        ----------
        displacements : array-like of shape (..., M1, M2, 3)
            Displacement of each node of each row-wire along x, y and z (downwards) in mm.

        Returns
        -------
        ndarray of shape (..., M1, M4, M2, 3)
            Derivative of the resistance of row-wire and column-wire with respect to the
            displacement of each node of the row-wire, in ohm/mm.
        """
        frames, leading = self._frames(displacements)
        jacobian = self._sensor().jacobian(frames)
        return jacobian.reshape(*leading, *jacobian.shape[1:])

    def identifiability(
        self,
        row: int = 0,
        displacements: ArrayLike | None = None,
        *,
        axes: str = "z",
        noise: float = 0.0,
    ) -> Identifiability:
        """Analyse how well the readings of a row-wire determine the displacements of its nodes.

        Parameters
        ----------
        row : int, default=0
            Row-wire, counted from 0.
        displacements : array-like of shape (M2, 3), default=None
            Displacement of each node of the row-wire in mm; None for the undeformed array.
        axes : {"z", "xyz"}, default="z"
            Axes along which nodes move.
        noise : float, default=0.0
            Standard deviation of each reading, relative to the reading.

        Returns
        -------
        Identifiability
            Singular values, worst pattern, sensitivities, condition number and spread.
        """
        if displacements is None:
            displacements = np.zeros((self.nodes_per_row, 3))
        array = np.asarray(displacements, dtype=np.float64)
        if array.ndim != 2:
            raise ValueError("displacements of one row-wire have shape (M2, 3)")
        if row < 0:
            raise ValueError(f"row is {row}: give a row-wire from 0 to {self.row_wires - 1}")
        return Identifiability(*self._sensor().identifiability(row, array, axes, float(noise)))
