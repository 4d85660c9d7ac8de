"""What all estimators share: validation of samples, row-wires, and the shape of answers."""

from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, MultiOutputMixin, RegressorMixin
from sklearn.utils.validation import check_is_fitted, validate_data

from ._arrays import DTYPES, matrix, row_column, row_wires


class Decoder(MultiOutputMixin, RegressorMixin, BaseEstimator):  # type: ignore[misc]
    """Base class of the estimators."""

    rows: int | str | None
    n_features_in_: int

    def _samples(self, X: ArrayLike, y: ArrayLike) -> tuple[NDArray[Any], NDArray[Any], list[int] | None]:
        """Validate samples of a fit, and separate readings from row-wires."""
        X, y = validate_data(
            self,
            X,
            y,
            dtype=DTYPES,
            multi_output=True,
            y_numeric=True,
            ensure_min_samples=2,
        )
        targets: NDArray[Any] = np.asarray(y)
        self._is_flat = targets.ndim == 1
        readings, wires = self._separated(np.asarray(X))
        return readings, matrix(targets, "y"), wires

    def _separated(self, X: NDArray[Any]) -> tuple[NDArray[Any], list[int] | None]:
        if self.rows is None:
            return X, None
        column = row_column(self.rows, self._feature_names(), X.shape[1])
        return np.delete(X, column, axis=1), row_wires(X[:, column], "the column of row-wires")

    def _feature_names(self) -> list[str] | None:
        names = getattr(self, "feature_names_in_", None)
        return None if names is None else [str(name) for name in names]

    def _reading_names(self) -> list[str] | None:
        """Return the names of the readings, without that of the row-wires."""
        names = self._feature_names()
        if names is None or self.rows is None:
            return names
        del names[row_column(self.rows, names, len(names))]
        return names

    def _readings(self, X: ArrayLike) -> tuple[NDArray[Any], list[int] | None]:
        """Validate samples to be decoded."""
        check_is_fitted(self)
        is_checked = (
            type(X) is np.ndarray
            and X.dtype == np.float64
            and X.ndim == 2
            and X.shape[0] > 0
            and X.shape[1] == self.n_features_in_
            and not hasattr(self, "feature_names_in_")
        )
        # The decoder refuses values that are not finite; without the general validation, single
        # samples are decoded many times faster.
        if not is_checked:
            X = validate_data(self, X, reset=False, dtype=DTYPES)
        return self._separated(np.asarray(X))

    def _shaped(self, answers: NDArray[np.float64]) -> NDArray[np.float64]:
        return answers[:, 0] if self._is_flat else answers

    def fit(self, X: ArrayLike, y: ArrayLike) -> Self:
        """Fit to samples."""
        raise NotImplementedError

    def predict(self, X: ArrayLike) -> NDArray[np.float64]:
        """Decode samples.

        Parameters
        ----------
        X : array-like of shape (samples, channels)
            Readings, with the column of row-wires if there is one.

        Returns
        -------
        ndarray of shape (samples,) or (samples, targets)
            Targets, in their units.
        """
        readings, wires = self._readings(X)
        return self._shaped(self._decoded(readings, wires))

    def _decoded(self, readings: NDArray[Any], wires: list[int] | None) -> NDArray[np.float64]:
        """Decode checked readings to samples x targets."""
        raise NotImplementedError
