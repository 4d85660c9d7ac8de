"""Samples drawn from a simulated array, and the error figures of the paper."""

from typing import NamedTuple

from numpy.typing import ArrayLike

from . import _native
from ._arrays import group_numbers, matrix, row_wires, seed_of, texts
from ._samples import Samples, samples
from ._sensor import SensorArray


class Simulated(NamedTuple):
    """Samples of a simulated array.

    Attributes
    ----------
    train : Samples
        Training samples.
    validation : Samples or None
        Validation samples; None if there are none.
    test : Samples
        Test samples.
    stroke_mm : float
        Largest travel of a node in mm: the full scale of its deformation.
    """

    train: Samples
    validation: Samples | None
    test: Samples
    stroke_mm: float


def simulate(
    array: str | SensorArray = "10x10_5x30",
    *,
    preset: str = "paper",
    samples: int | None = None,
    validation_samples: int | None = None,
    test_samples: int | None = None,
    rows: str | int | None = None,
    axes: str | None = None,
    loading: str | None = None,
    noise: float = 0.0,
    noise_ohm: float = 0.0,
    adc_bits: int | None = None,
    drift: float = 0.0,
    noise_in: str = "both",
    seed: int = 0,
) -> Simulated:
    """Draw the samples on which the program would train and test, bit for bit.

    A sample is one row-wire at one moment: its readings in ohm, and the coordinates x, y and z of
    its nodes in mm.

    Parameters
    ----------
    array : str or SensorArray, default="10x10_5x30"
        Array scale, or an array with its geometry.
    preset : {"paper", "best"}, default="paper"
        Values of the arguments that are None.
    samples, validation_samples, test_samples : int, default=None
        Numbers of samples, rounded up to whole snapshots of all row-wires; 1000, 200 and 100 for
        the preset "paper".
    rows : {"all", "known"} or int, default=None
        Row-wires read: all, or only one, counted from 1 as in the program.
    axes : {"z", "xyz"}, default=None
        Axes along which nodes move.
    loading : str, default=None
        "random" nodes, "smooth:MM" for a random field with this correlation length, or "indenter"
        with ":sphere", ":flat-punch", ":cylinder" or ":edge".
    noise : float, default=0.0
        Standard deviation of each reading, relative to the reading.
    noise_ohm : float, default=0.0
        Standard deviation of each reading in ohm.
    adc_bits : int, default=None
        Resolution of the analogue-to-digital converter.
    drift : float, default=0.0
        Standard deviation of the relative gain error that all readings of a snapshot share.
    noise_in : {"both", "training", "test"}, default="both"
        Samples with noise.
    seed : int, default=0
        Seed of all random numbers.

    Returns
    -------
    Simulated
        Training, validation and test samples.

    Raises
    ------
    ValueError
        If an argument is out of range.

    Examples
    --------
    >>> from decoupler import simulate
    >>> data = simulate("10x6_3x18", samples=50, test_samples=20)
    >>> data.train.X.shape, data.train.y.shape, data.test.X.shape
    ((50, 18), (50, 18), (20, 18))
    >>> data.train.rows[:3]
    array([0, 1, 2])
    """
    sensor = array if isinstance(array, SensorArray) else SensorArray(array)

    settings = {
        "samples": samples,
        "validation_samples": validation_samples,
        "test_samples": test_samples,
        "rows": rows,
        "axes": axes,
        "loading": loading,
        "noise": noise,
        "noise_ohm": noise_ohm,
        "adc_bits": adc_bits,
        "drift": drift,
        "noise_in": noise_in,
        "seed": seed_of(seed),
    }
    train, validation, test, stroke_mm = _native.simulate(sensor._sensor(), str(preset), texts(settings))
    held_out = None if validation is None else _samples(validation)
    return Simulated(_samples(train), held_out, _samples(test), stroke_mm)


_samples = samples


class NodeErrors(NamedTuple):
    """Errors of decoded coordinates, as in the paper's tables and beyond.

    Attributes
    ----------
    z_percent, x_percent, y_percent : float or None
        Mean of \\|decoded - true\\| / \\|true\\| in percent of the coordinate: AveZerr, AveXerr and
        AveYerr. None where a true coordinate is 0.
    z_mm : float
        Mean of \\|decoded z - z\\| in mm.
    z_full_scale_percent : float
        `z_mm` in percent of the stroke.
    worst_mm : float
        Largest \\|decoded z - z\\| in mm.
    worst_node : tuple of int
        Snapshot, row-wire and node of the largest error, counted from 0.
    """

    z_percent: float | None
    x_percent: float | None
    y_percent: float | None
    z_mm: float
    z_full_scale_percent: float
    worst_mm: float
    worst_node: tuple[int, int, int]


def errors(
    y_true: ArrayLike,
    y_pred: ArrayLike,
    *,
    stroke_mm: float = 1.0,
    rows: ArrayLike | None = None,
    groups: ArrayLike | None = None,
) -> NodeErrors:
    """Measure errors of decoded coordinates of nodes.

    Parameters
    ----------
    y_true : array-like of shape (samples, 3 * nodes)
        True coordinates x, y and z of each node of a row-wire in mm.
    y_pred : array-like of shape (samples, 3 * nodes)
        Decoded coordinates in mm.
    stroke_mm : float, default=1.0
        Largest travel of a node in mm.
    rows : array-like of shape (samples,), default=None
        Row-wire of each sample, to name the worst node.
    groups : array-like of shape (samples,), default=None
        Snapshot of each sample, to name the worst node.

    Returns
    -------
    NodeErrors
        The errors.

    Examples
    --------
    >>> from decoupler import errors
    >>> found = errors([[8.0, 10.0, 5.0]], [[8.0, 10.0, 4.9]])
    >>> round(found.z_percent, 3), round(found.z_mm, 3), found.worst_node
    (2.0, 0.1, (0, 0, 0))
    """
    truth, decoded = matrix(y_true, "y_true"), matrix(y_pred, "y_pred")
    found = _native.node_errors(
        truth,
        decoded,
        float(stroke_mm),
        None if rows is None else row_wires(rows),
        group_numbers(groups, len(truth)),
    )
    return NodeErrors(**found)
