"""Recordings in files."""

import json
import os
from collections.abc import Iterable, Mapping
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
    return _recording(_native.import_recording(os.fspath(recipe), seed_of(seed)))


def read_recording(
    files: Path | Iterable[Path],
    *,
    inputs: Iterable[str],
    targets: Iterable[str],
    time: str | None = None,
    group: str | None = None,
    row_wire: str | None = None,
    where: Iterable[str] = (),
    units: Mapping[str, str] | None = None,
    test_files: Path | Iterable[Path] = (),
    split: str = "time",
    test_fraction: float = 0.2,
    validation_fraction: float = 0.2,
    seed: int = 0,
) -> Recording:
    """Read a recording from text files, spreadsheets, or files of NumPy or MATLAB.

    Columns are named as in the header, or c1, c2, ... if there is none; "c1..c8" is a range. What
    is not an argument here, such as joined files and computed columns, is described in a recipe:
    see `import_recording`.

    Parameters
    ----------
    files : path-like or sequence of path-like
        Files with the same columns, whose rows follow each other; several files are groups.
    inputs, targets : sequence of str
        Columns of X and y.
    time, group, row_wire : str, default=None
        Columns with the time, the group and the number of the row-wire (from 1) of each sample.
    where : sequence of str, default=()
        Conditions that every used row must meet, such as "force>0.1".
    units : mapping of str to str, default=None
        Units of columns that the header does not give.
    test_files : path-like or sequence of path-like, default=()
        Files with the test samples; by default a share of the samples is held out.
    split : {"time", "group", "random"}, default="time"
        Samples held out: the last ones, whole groups, or single samples at random.
    test_fraction, validation_fraction : float, default=0.2
        Shares of the samples held out for testing, and of the others for validation.
    seed : int, default=0
        Seed of a division by groups or at random.

    Returns
    -------
    Recording
        The samples with names and units.

    Raises
    ------
    ValueError
        If a file cannot be read or lacks a column.
    """
    first, *rest = _paths(files)
    columns = {"time": time, "group": group, "row_wire": row_wire, "units": units}
    plan: dict[str, Any] = {
        "import": {
            "data": first,
            "append": [{"data": file} for file in rest],
            "inputs": list(inputs),
            "targets": list(targets),
            "where": list(where),
            **{name: value for name, value in columns.items() if value is not None},
        },
        "division": {"by": split, "test_fraction": test_fraction, "validation_fraction": validation_fraction},
    }
    if tested := _paths(test_files):
        first, *rest = tested
        plan["test"] = {"data": first, "append": [{"data": file} for file in rest]}
    return _recording(_native.read_recording(json.dumps(plan), seed_of(seed)))


def _paths(files: Path | Iterable[Path]) -> list[str]:
    given = [files] if isinstance(files, str | os.PathLike) else files
    return [os.fspath(file) for file in given]


def _recording(read: dict[str, Any]) -> Recording:
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
