"""Recordings that a recipe describes."""

import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _native
from ._arrays import seed_of
from ._network import Path
from ._samples import Samples, samples


@dataclass(frozen=True)
class Recording:
    """Samples of a recording, and their division into training, validation and test samples.

    Attributes
    ----------
    all : Samples
        All samples except those of test files, in the order in which they were recorded.
    train : Samples
        Training samples.
    validation : Samples or None
        Samples held out for validation; None if there are none.
    test : Samples
        Test samples.
    inputs, targets : list of str
        Names of the columns of X and y.
    input_units, target_units : list of (str or None)
        Their units, None where unknown.
    times : ndarray of shape (samples,) or None
        Time of each sample of `all`, if the recipe names a column.
    dropped : list of (str, int)
        Reasons for which rows were dropped, and their numbers.
    warnings : list of str
        Remarks on the files.
    """

    all: Samples
    train: Samples
    validation: Samples | None
    test: Samples
    inputs: list[str]
    targets: list[str]
    input_units: list[str | None]
    target_units: list[str | None]
    times: NDArray[np.float64] | None
    dropped: list[tuple[str, int]]
    warnings: list[str]


def import_recording(recipe: Path, *, seed: int = 0) -> Recording:
    """Import the recording of a recipe, with the samples on which the program would train and test.

    Parameters
    ----------
    recipe : path-like
        Recipe written by ``decoupler inspect --recipe-out``, by the window, or by hand. Its paths
        are relative to its folder.
    seed : int, default=0
        Seed of a division by groups or at random.

    Returns
    -------
    Recording
        The samples with names and units.

    Raises
    ------
    ValueError
        If the recipe or a file cannot be read, or does not contain what the recipe names.
    """
    read: dict[str, Any] = _native.import_recording(os.fspath(recipe), seed_of(seed))
    validation = read["validation"]
    return Recording(
        all=samples(read),
        train=samples(read["training"]),
        validation=None if validation is None else samples(validation),
        test=samples(read["test"]),
        inputs=read["inputs"],
        targets=read["targets"],
        input_units=read["input_units"],
        target_units=read["target_units"],
        times=read["times"],
        dropped=read["dropped"],
        warnings=read["warnings"],
    )
