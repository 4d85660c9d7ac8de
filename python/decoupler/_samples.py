"""Sets of samples."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class Samples(NamedTuple):
    """Samples for training or testing.

    Attributes
    ----------
    X : ndarray of shape (samples, channels)
        Readings; for a simulated array resistances in ohm.
    y : ndarray of shape (samples, targets)
        Targets; for a simulated array the coordinates x, y and z of each node of the row-wire
        in mm.
    rows : ndarray of shape (samples,) or None
        Row-wire of each sample, counted from 0; None if there are no row-wires.
    groups : ndarray of shape (samples,)
        Group of each sample, which a division keeps together: the snapshot of a simulated array,
        the group or file of a recording.
    """

    X: NDArray[np.float64]
    y: NDArray[np.float64]
    rows: NDArray[np.int64] | None
    groups: NDArray[np.int64]

    def with_rows(self) -> NDArray[np.float64]:
        """Return X with the row-wires as an additional last column.

        Estimators with ``rows=-1`` read it, so that there is one decoder for each row-wire.
        """
        if self.rows is None:
            raise ValueError("the samples have no row-wires: name their column in the recipe")
        return np.column_stack([self.X, self.rows])


def samples(arrays: dict[str, Any]) -> Samples:
    return Samples(arrays["X"], arrays["y"], arrays["rows"], arrays["groups"])
