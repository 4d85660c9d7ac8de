"""Estimator of back-propagation networks."""

import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.exceptions import ConvergenceWarning
from sklearn.utils.validation import check_is_fitted

from . import _native
from ._arrays import group_numbers, matrix, number, seed_of, texts
from ._base import Decoder
from ._network import Exported, Network, Path

#: Called after each epoch with its number and the losses "training" and "validation" (None if
#: nothing is held out). Training ends if it returns True.
Callback = Callable[[int, dict[str, float | None]], object]

#: Parameters that are settings of the program, with its names, defaults and limits.
SETTINGS = (
    "hidden",
    "method",
    "epochs",
    "starts",
    "combine",
    "begin",
    "goal",
    "min_gradient",
    "max_fail",
    "scaling",
)


class NetworkRegressor(Decoder):
    """Network with one hidden layer of hyperbolic tangents and a linear output layer.

    The training is that of the program `decoupler`: the same settings, samples and seed give the
    same bits. Levenberg-Marquardt uses the structure of the normal equations and needs no dense
    Jacobian.

    Parameters
    ----------
    hidden : int or "auto", default=12
        Number of hidden nodes. With "auto", settings are chosen by cross-validation that respects
        `split`, as by the program, and the answer is the best convex combination of the training
        mean, ridge, kernel ridge and networks; other settings of the network are then ignored.
    memory : {"none", "auto"} or sequence of float or str, default=None
        Time constants of exponential averages of the readings, in samples, which become inputs:
        the rows of `X` are then consecutive, in `fit` (within groups) and in `predict`. With
        ``hidden="auto"``, "auto" tries memories and takes one that is clearly better; None
        tries none.
    budget : float, default=60.0
        Seconds of one core for ``hidden="auto"``, estimated from the work.
    method : str, default="lm"
        Training method: "lm" (Levenberg-Marquardt), "br" (Bayesian regularisation), "scg"
        (scaled conjugate gradient), and other methods of the program.
    method_settings : mapping of str to float, default=None
        Settings of the method that differ from their defaults, such as ``{"mu": 0.01}``.
    epochs : int, default=1000
        Largest number of epochs.
    starts : int, default=1
        Number of trainings from different random weights, in parallel.
    combine : {"best", "mean"}, default="best"
        The network of several starts: that with the lowest validation loss, or the mean of all.
    begin : {"random", "ridge"}, default="random"
        Weights with which a training begins: those of Nguyen and Widrow, or ridge regression.
    goal : float, default=0.0
        Training loss at which the training ends.
    min_gradient : float, default=1e-7
        Norm of the gradient below which the training ends.
    max_fail : int, default=6
        Number of epochs without a new lowest validation loss at which the training ends.
    validation_fraction : float, default=None
        Share of the samples held out for validation. None for 0.2, or 0 with method "br", which
        needs none.
    split : {"time", "group", "random"}, default="time"
        Samples held out: the last ones, whole groups, or single samples at random.
    rows : int or str, default=None
        Index or name of the column of `X` with the row-wire of each sample: there is then one
        network for each row-wire. None for one network that reads all columns.
    inputs : {"raw", "resistance", "conductance", "log"}, default="raw"
        Quantity computed from each reading. All but "raw" need resistances above 0.
    scaling : {"minmax", "whiten"}, default="minmax"
        Scaling of the inputs: each to [-1, 1], or whitened principal components.
    intervals : {"never", "always"}, default="never"
        Whether to calibrate prediction intervals by cross-validation, which takes four times as
        long as the training.
    random_state : int, RandomState instance or None, default=None
        Seed of the initial weights and of random divisions. An integer is the seed of the program.
    callback : callable, default=None
        Called as ``callback(epoch, losses)`` after each epoch; `losses` has the keys "training" and
        "validation". The training ends if it returns True.

    Attributes
    ----------
    network_ : Network
        The network of the epoch with the lowest validation loss (training loss if nothing is
        held out; the last epoch for method "br").
    n_iter_ : int
        Number of epochs run.
    best_epoch_ : int
        Epoch of the network.
    loss_curve_ : ndarray of shape (n_iter_ + 1,)
        Training loss (mean squared error of scaled targets) after each epoch; the first is that of
        the initial weights.
    validation_loss_curve_ : ndarray of shape (n_iter_ + 1,) or None
        Likewise on the samples held out; None if there are none.
    stop_reason_ : str
        Reason why the training ended.
    n_features_in_ : int
        Number of columns of `X`.
    feature_names_in_ : ndarray of shape (n_features_in_,)
        Names of the columns, if `X` was a table with names.

    Examples
    --------
    >>> import numpy as np
    >>> from decoupler import NetworkRegressor
    >>> X = np.random.default_rng(0).uniform(-1.0, 1.0, size=(500, 2))
    >>> y = np.tanh(X[:, 0] - 2.0 * X[:, 1])
    >>> model = NetworkRegressor(hidden=2, random_state=0).fit(X[:400], y[:400])
    >>> model.score(X[400:], y[400:]) > 0.999
    True
    """

    def __init__(
        self,
        hidden: int | str = 12,
        *,
        memory: str | Sequence[float | str] | None = None,
        budget: float = 60.0,
        method: str = "lm",
        method_settings: Mapping[str, float] | None = None,
        epochs: int = 1000,
        starts: int = 1,
        combine: str = "best",
        begin: str = "random",
        goal: float = 0.0,
        min_gradient: float = 1e-7,
        max_fail: int = 6,
        validation_fraction: float | None = None,
        split: str = "time",
        rows: int | str | None = None,
        inputs: str = "raw",
        scaling: str = "minmax",
        intervals: str = "never",
        random_state: Any = None,
        callback: Callback | None = None,
    ) -> None:
        self.hidden = hidden
        self.memory = memory
        self.budget = budget
        self.method = method
        self.method_settings = method_settings
        self.epochs = epochs
        self.starts = starts
        self.combine = combine
        self.begin = begin
        self.goal = goal
        self.min_gradient = min_gradient
        self.max_fail = max_fail
        self.validation_fraction = validation_fraction
        self.split = split
        self.rows = rows
        self.inputs = inputs
        self.scaling = scaling
        self.intervals = intervals
        self.random_state = random_state
        self.callback = callback

    def fit(
        self,
        X: ArrayLike,
        y: ArrayLike,
        *,
        groups: ArrayLike | None = None,
        validation: tuple[Any, ...] | None = None,
    ) -> Self:
        """Train on samples.

        Parameters
        ----------
        X : array-like of shape (samples, channels)
            Readings in the order in which they were recorded, with the column of row-wires if there
            is one.
        y : array-like of shape (samples,) or (samples, targets)
            Targets.
        groups : array-like of shape (samples,), default=None
            Group of each sample, held out together.
        validation : tuple, default=None
            Readings and targets of validation samples, of which further elements are ignored. By
            default a share of the samples is held out.

        Returns
        -------
        NetworkRegressor
            The fitted estimator.

        Raises
        ------
        ValueError
            If a parameter is out of range, or the samples cannot be scaled.
        KeyboardInterrupt
            After Ctrl-C, which ends the training between two epochs. The estimator is then fitted,
            with the best network so far; the same holds for exceptions of the callback.
        """
        readings, targets, wires = self._samples(X, y)
        training = _native.train(
            readings,
            targets,
            self._settings(y),
            row_wires=wires,
            groups=group_numbers(groups, len(readings)),
            validation=None if validation is None else self._held_out(*validation[:2]),
            callback=self.callback,
        )
        self.network_ = Network(training.network)
        self.n_iter_ = training.epochs
        self.best_epoch_ = training.best_epoch
        self.loss_curve_ = training.loss_curve
        self.validation_loss_curve_ = training.validation_loss_curve
        self.stop_reason_ = training.stop_reason
        if training.interruption is not None:
            raise training.interruption
        if training.warning is not None:
            warnings.warn(training.warning, ConvergenceWarning, stacklevel=2)
        return self

    def _settings(self, y: ArrayLike) -> dict[str, Any]:
        fraction = self.validation_fraction
        settings = self.method_settings or {}
        is_auto = isinstance(self.hidden, str)
        if is_auto and self.hidden != "auto":
            raise ValueError(f"hidden: {self.hidden!r} is not a number; give one, or 'auto'")
        words = [self.memory] if isinstance(self.memory, str) else self.memory
        memory = None if words is None else [str(word) for word in words]
        run = {name: getattr(self, name) for name in SETTINGS}
        run["hidden"] = None if is_auto else self.hidden
        return {
            "run": [*texts(run), ("seed", str(seed_of(self.random_state)))],
            "memory": memory,
            "budget": number("budget", self.budget),
            "method_settings": [(str(name), number(name, settings[name])) for name in settings],
            "validation_fraction": None if fraction is None else number("validation_fraction", fraction),
            "split": str(self.split),
            "inputs": str(self.inputs),
            "intervals": str(self.intervals),
            "input_names": self._reading_names(),
            "target_names": target_names(y),
        }

    def _held_out(self, X: ArrayLike, y: ArrayLike) -> tuple[NDArray[Any], NDArray[Any], list[int] | None]:
        readings, wires = self._separated(matrix(X, "X of validation"))
        return readings, matrix(y, "y of validation"), wires

    def _decoded(self, readings: NDArray[Any], wires: list[int] | None) -> NDArray[np.float64]:
        return self.network_._native.predict(readings, wires)

    def predict_interval(self, X: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the limits of the 90 % prediction intervals.

        Parameters
        ----------
        X : array-like of shape (samples, channels)
            Readings, with the column of row-wires if there is one.

        Returns
        -------
        lower, upper : ndarray of shape (samples,) or (samples, targets)
            Limits, in the units of the targets; NaN for a target with too few independent samples.

        Raises
        ------
        ValueError
            If the network was trained without ``intervals="always"``.
        """
        readings, wires = self._readings(X)
        lower, upper = self.network_.predict_interval(readings, rows=wires)
        return self._shaped(lower), self._shaped(upper)

    def export(self, path: Path, *, format: str = "onnx", precision: str = "f64") -> Exported:
        """Write the network for use without this package; see `Network.export`.

        Parameters
        ----------
        path : path-like
            New folder.
        format : {"onnx", "c99", "matlab", "numpy"}, default="onnx"
            Kind of files.
        precision : {"f64", "f32", "fixed16"}, default="f64"
            Numbers with which the files compute.

        Returns
        -------
        Exported
            The files and their largest deviation from the network.
        """
        check_is_fitted(self)
        return self.network_.export(path, format=format, precision=precision)

    def save(
        self,
        path: Path,
        X: ArrayLike,
        y: ArrayLike,
        X_test: ArrayLike,
        y_test: ArrayLike,
        *,
        groups: ArrayLike | None = None,
    ) -> None:
        """Write a network file, which the program opens, decodes with, reports and exports.

        A network file contains errors on test samples and names its recording, so the samples are
        written next to it as ``NAME.training.csv`` and ``NAME.test.csv``.

        Parameters
        ----------
        path : path-like
            The file, such as ``network.json``.
        X, y, groups
            The samples of `fit`.
        X_test : array-like of shape (samples, channels)
            Readings of samples that were not used in `fit`.
        y_test : array-like of shape (samples,) or (samples, targets)
            Their targets.

        Raises
        ------
        ValueError
            If the samples are not those of `fit`, or a file cannot be written.
        """
        readings, wires = self._readings(X)
        tested, test_wires = self._readings(X_test)
        self.network_._native.save_trained(
            os.fspath(path),
            (readings, matrix(y, "y"), wires, group_numbers(groups, len(readings))),
            (tested, matrix(y_test, "y_test"), test_wires, None),
        )


def target_names(y: Any) -> list[str] | None:
    """Return the names of the targets of a table."""
    columns = getattr(y, "columns", None)
    if columns is not None and all(isinstance(name, str) for name in columns):
        return [str(name) for name in columns]
    name = getattr(y, "name", None)
    return [name] if isinstance(name, str) else None
