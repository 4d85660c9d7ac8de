"""Trained networks and their files."""

import os
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from ._arrays import matrix, row_wires

#: A path of a file or folder.
Path = str | os.PathLike[str]


class Exported(NamedTuple):
    """Files of an exported decoder.

    Attributes
    ----------
    path : str
        The folder.
    files : list of (str, int)
        Names of the files, with their sizes in bytes.
    deviation : float or None
        Largest deviation of the files from the decoder where they were evaluated, as C is and single
        precision, relative to the range of the targets.
    limit : float
        Largest deviation to be expected of other programs.
    remarks : list of str
        Remarks on the accuracy.
    """

    path: str
    files: list[tuple[str, int]]
    deviation: float | None
    limit: float
    remarks: list[str]


class Network:
    """Trained network with its scalings, or one network for each row-wire.

    `load_network` reads one from a file; fitted estimators have one as ``network_``.

    Examples
    --------
    >>> import numpy as np
    >>> from decoupler import NetworkRegressor
    >>> X = np.random.default_rng(0).uniform(size=(100, 3))
    >>> model = NetworkRegressor(hidden=2, epochs=5, random_state=0).fit(X, X[:, :2])
    >>> model.network_
    <Network 3-2-2>
    >>> model.network_.predict(X[:4]).shape
    (4, 2)
    """

    def __init__(self, native: _native.Network) -> None:
        self._native = native

    def predict(
        self,
        X: ArrayLike,
        *,
        rows: ArrayLike | None = None,
        times: ArrayLike | None = None,
        groups: ArrayLike | None = None,
    ) -> NDArray[np.float64]:
        """Decode readings.

        Parameters
        ----------
        X : array-like of shape (samples, channels)
            Readings, in the order of `inputs`.
        rows : array-like of shape (samples,), default=None
            Row-wire of each sample, counted from 0, if there is one network for each, or if the
            network has a memory and samples of several row-wires alternate.
        times : array-like of shape (samples,), default=None
            Time of each sample in seconds, for a network with a memory, which starts again after a
            pause of more than 50 usual intervals; without it, samples follow each other at the
            usual interval of the training.
        groups : array-like of shape (samples,), default=None
            Group of each sample, for a network with a memory: each has a past of its own.

        Returns
        -------
        ndarray of shape (samples, targets)
            Targets, in the order and the units of `targets`.
        """
        wires = None if rows is None else row_wires(rows)
        seconds = None if times is None else np.asarray(times, dtype=np.float64).tolist()
        numbers = None if groups is None else np.unique(np.asarray(groups), return_inverse=True)[1].ravel().tolist()
        return self._native.predict(matrix(X, "X"), wires, seconds, numbers)

    def predict_interval(
        self,
        X: ArrayLike,
        *,
        rows: ArrayLike | None = None,
        times: ArrayLike | None = None,
        groups: ArrayLike | None = None,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the limits of the 90 % prediction intervals.

        Parameters
        ----------
        X, rows, times, groups
            As in `predict`.

        Returns
        -------
        lower, upper : ndarray of shape (samples, targets)
            Limits, in the units of the targets; NaN for a target without an interval.

        Raises
        ------
        ValueError
            If the intervals were not calibrated.
        """
        answers = self.predict(X, rows=rows, times=times, groups=groups)
        half_widths = self._native.half_widths(answers)
        return answers - half_widths, answers + half_widths

    @property
    def inputs(self) -> list[str]:
        """Names of the readings."""
        return self._native.inputs

    @property
    def input_units(self) -> list[str | None]:
        """Units of the readings, None where unknown."""
        return self._native.input_units

    @property
    def targets(self) -> list[str]:
        """Names of the targets."""
        return self._native.targets

    @property
    def target_units(self) -> list[str | None]:
        """Units of the targets, None where unknown."""
        return self._native.target_units

    @property
    def row_wires(self) -> list[int] | None:
        """Row-wires with a network each, counted from 0; None for a shared network."""
        return self._native.row_wires

    @property
    def hidden(self) -> int:
        """Number of hidden nodes of each network."""
        return self._native.hidden

    @property
    def weights(self) -> int:
        """Number of weights of all networks."""
        return self._native.weights

    @property
    def has_intervals(self) -> bool:
        """True if prediction intervals were calibrated."""
        return self._native.has_intervals

    @property
    def metadata(self) -> dict[str, Any]:
        """Settings and, for a network from a file, its source, training record and scores."""
        return self._native.metadata

    @property
    def networks(self) -> list[dict[str, Any]]:
        """Scalings and weights of each network, with the names in network files."""
        return self._native.networks

    def export(self, path: Path, *, format: str = "onnx", precision: str = "f64") -> Exported:
        """Write the network for use without this package.

        Parameters
        ----------
        path : path-like
            New folder.
        format : {"onnx", "c99", "matlab", "numpy"}, default="onnx"
            Kind of files: a graph for ONNX runtimes, a C header and source, a MATLAB function,
            or arrays with a short Python module.
        precision : {"f64", "f32", "fixed16"}, default="f64"
            Numbers with which the files compute; "fixed16" is for "c99" only.

        Returns
        -------
        Exported
            The files and their largest deviation from the network.

        Raises
        ------
        ValueError
            If the path is taken, the format lacks the precision, or the files deviate too much.
        """
        written = self._native.export(os.fspath(path), format, precision)
        return Exported(**{**written, "path": os.fspath(written["path"])})

    def save(self, path: Path) -> None:
        """Write the network file that the network was loaded from.

        Parameters
        ----------
        path : path-like
            The file. It is written whole or not at all.
        """
        self._native.save(os.fspath(path))

    def __repr__(self) -> str:
        return repr(self._native)


def load_network(path: Path) -> Network:
    """Read a network file of the program, trained on a simulated array or on a recording.

    Parameters
    ----------
    path : path-like
        File written by ``decoupler train --out`` or by the window.

    Returns
    -------
    Network
        The network, with the bits with which the program decodes.

    Raises
    ------
    ValueError
        If the file cannot be read, is of another kind or version, or is damaged.
    """
    return Network(_native.load_network(os.fspath(path)))
