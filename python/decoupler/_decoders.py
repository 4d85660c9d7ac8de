"""Estimators of the decoders without a network."""

from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from ._arrays import group_numbers, seed_of
from ._base import Decoder


class _SampleDecoder(Decoder):
    """Decoder that is fitted in one step."""

    _kind: str

    inputs: str
    scaling: str = "whiten"
    random_state: Any = 0

    def fit(self, X: ArrayLike, y: ArrayLike, *, groups: ArrayLike | None = None) -> Self:
        """Fit to samples.

        Parameters
        ----------
        X : array-like of shape (samples, channels)
            Readings, with the column of row-wires if there is one.
        y : array-like of shape (samples,) or (samples, targets)
            Targets.
        groups : array-like of shape (samples,), default=None
            Group of each sample, left out together when settings such as penalties are chosen.

        Returns
        -------
        self
            The fitted estimator.
        """
        readings, targets, wires = self._samples(X, y)
        self._decoder = _native.fit_decoder(
            self._kind,
            readings,
            targets,
            inputs=self.inputs,
            scaling=self.scaling,
            seed=seed_of(self.random_state),
            row_wires=wires,
            groups=group_numbers(groups, len(readings)),
        )
        return self

    def _decoded(self, readings: NDArray[Any], wires: list[int] | None) -> NDArray[np.float64]:
        return self._decoder.predict(readings, wires)


class RidgeDecoder(_SampleDecoder):
    """Affine map by ridge regression, the penalty of each target chosen by cross-validation.

    It is the baseline of the program's error table.

    Parameters
    ----------
    inputs : {"raw", "resistance", "conductance", "log"}, default="raw"
        Quantity computed from each reading. All but "raw" need resistances above 0.
    rows : int or str, default=None
        Index or name of the column of `X` with the row-wire of each sample: there is then one map
        for each row-wire. None for one map of all columns.

    Attributes
    ----------
    n_features_in_ : int
        Number of columns of `X`.
    feature_names_in_ : ndarray of shape (n_features_in_,)
        Names of the columns, if `X` was a table with names.

    Examples
    --------
    >>> import numpy as np
    >>> from decoupler import RidgeDecoder
    >>> X = np.arange(20.0).reshape(10, 2) ** 1.5
    >>> y = 3.0 * X[:, 0] - X[:, 1] + 1.0
    >>> bool(np.allclose(RidgeDecoder().fit(X, y).predict(X), y, atol=1e-3))
    True
    """

    _kind = "ridge"

    def __init__(self, *, inputs: str = "raw", rows: int | str | None = None) -> None:
        self.inputs = inputs
        self.rows = rows


class RadialBasisDecoder(_SampleDecoder):
    """Radial-basis network by kernel ridge regression.

    Gaussians around all training samples, or around 1000 of more than 4000; their width and the
    penalty of each target are chosen by the error on blocks of samples that are left out.

    Parameters
    ----------
    inputs : {"raw", "resistance", "conductance", "log"}, default="raw"
        Quantity computed from each reading. All but "raw" need resistances above 0.
    scaling : {"minmax", "whiten"}, default="minmax"
        Scaling of the inputs: each to [-1, 1], or whitened principal components.
    rows : int or str, default=None
        Index or name of the column of `X` with the row-wire of each sample: there is then one
        decoder for each row-wire. None for one decoder of all columns.
    random_state : int, RandomState instance or None, default=None
        Seed of the choice of centres. An integer is the seed of the program.

    Attributes
    ----------
    n_features_in_ : int
        Number of columns of `X`.
    feature_names_in_ : ndarray of shape (n_features_in_,)
        Names of the columns, if `X` was a table with names.

    Examples
    --------
    >>> import numpy as np
    >>> from decoupler import RadialBasisDecoder
    >>> X = np.linspace(0.0, 3.0, 60)[:, np.newaxis]
    >>> model = RadialBasisDecoder(random_state=0).fit(X, np.sin(X[:, 0]))
    >>> round(float(model.predict([[1.0]])[0]), 2)
    0.84
    """

    _kind = "rbf"

    def __init__(
        self,
        *,
        inputs: str = "raw",
        scaling: str = "minmax",
        rows: int | str | None = None,
        random_state: Any = None,
    ) -> None:
        self.inputs = inputs
        self.scaling = scaling
        self.rows = rows
        self.random_state = random_state


class FuzzyDecoder(_SampleDecoder):
    """Fuzzy rules with affine consequents: a Takagi-Sugeno system on whitened inputs.

    The number of rules and the penalties are chosen by cross-validation.

    Parameters
    ----------
    inputs : {"raw", "resistance", "conductance", "log"}, default="raw"
        Quantity computed from each reading. All but "raw" need resistances above 0.
    rows : int or str, default=None
        Index or name of the column of `X` with the row-wire of each sample: there is then one
        decoder for each row-wire. None for one decoder of all columns.
    random_state : int, RandomState instance or None, default=None
        Seed of the folds and of the initial cluster centres. An integer is the seed of the program.

    Attributes
    ----------
    n_features_in_ : int
        Number of columns of `X`.
    feature_names_in_ : ndarray of shape (n_features_in_,)
        Names of the columns, if `X` was a table with names.

    Examples
    --------
    >>> import numpy as np
    >>> from decoupler import FuzzyDecoder
    >>> X = np.linspace(-1.0, 1.0, 200)[:, np.newaxis]
    >>> model = FuzzyDecoder(random_state=0).fit(X, np.abs(X))
    >>> model.score(X, np.abs(X)) > 0.95
    True
    """

    _kind = "fuzzy"

    def __init__(
        self,
        *,
        inputs: str = "raw",
        rows: int | str | None = None,
        random_state: Any = None,
    ) -> None:
        self.inputs = inputs
        self.rows = rows
        self.random_state = random_state
