"""Arguments of estimators: samples, row-wires and seeds."""

from collections.abc import Mapping, Sequence
from numbers import Integral
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.utils import check_random_state

#: Dtypes that are passed on without a copy.
DTYPES = [np.float64, np.float32]

LARGEST_SEED = 2**64 - 1


def matrix(values: ArrayLike, name: str) -> NDArray[Any]:
    """Return values as a 2-D array of floating-point numbers; a 1-D array is one column."""
    array = np.asarray(values)
    if array.dtype not in DTYPES:
        try:
            array = array.astype(np.float64)
        except (TypeError, ValueError) as error:
            raise ValueError(f"{name} is not an array of numbers: {error}") from error
    if array.ndim == 1:
        array = array[:, np.newaxis]
    if array.ndim != 2:
        raise ValueError(f"{name} has {array.ndim} dimensions: give samples x columns")
    return array


def row_wires(values: ArrayLike, name: str = "rows") -> list[int]:
    """Return the numbers of row-wires as integers."""
    array = np.asarray(values)
    if array.ndim != 1:
        raise ValueError(f"{name} has {array.ndim} dimensions: give one row-wire for each sample")
    whole = array.astype(np.int64)
    if not np.array_equal(whole, array) or (len(whole) and whole.min() < 0):
        raise ValueError(f"{name} has values that are not row-wires: give whole numbers from 0")
    result: list[int] = whole.tolist()
    return result


def group_numbers(groups: ArrayLike | None, count: int) -> list[int] | None:
    """Return the group of each sample as a number."""
    if groups is None:
        return None
    values = np.asarray(groups)
    if values.shape != (count,):
        raise ValueError(f"groups has shape {values.shape} for {count} samples: give one for each")
    numbers: list[int] = np.unique(values, return_inverse=True)[1].tolist()
    return numbers


def seed_of(random_state: Any) -> int:
    """Return the seed: an integer itself, or a number drawn from a generator."""
    if isinstance(random_state, Integral) and not isinstance(random_state, bool):
        seed = int(random_state)
        if not 0 <= seed <= LARGEST_SEED:
            raise ValueError(f"random_state is {seed}: give a whole number from 0 to {LARGEST_SEED}")
        return seed
    if isinstance(random_state, np.random.Generator):
        return int(random_state.integers(2**63))
    return int(check_random_state(random_state).randint(np.iinfo(np.int32).max))


def texts(settings: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return names and texts of the settings that are given, which the program checks."""
    return [(name, str(value)) for name, value in settings.items() if value is not None]


def number(name: str, value: Any) -> float:
    """Return a real number."""
    try:
        return float(value)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} is {value!r}: give a number") from error


def row_column(rows: int | str, names: Sequence[str] | None, columns: int) -> int:
    """Return the index of the column of X with the row-wires."""
    if isinstance(rows, str):
        if names is None or rows not in names:
            known = "X has no column names" if names is None else f"X has {', '.join(names)}"
            raise ValueError(f"rows: there is no column '{rows}'; {known}")
        return list(names).index(rows)
    if not isinstance(rows, Integral) or isinstance(rows, bool):
        raise ValueError(f"rows is {rows!r}: give the index or the name of a column of X, or None")
    if not -columns <= rows < columns or columns < 2:
        raise ValueError(f"rows is {rows}: X has {columns} columns, readings and row-wires together")
    return int(rows) % columns
