"""Decoupling of flexible tactile sensor arrays.

==============================  =======================================================
`NetworkRegressor`              back-propagation network, as a scikit-learn estimator
`RidgeDecoder`,                 the other decoders, as scikit-learn estimators
`RadialBasisDecoder`,
`FuzzyDecoder`
`SensorArray`, `simulate`,      resistance model of an array, samples drawn from it, and
`errors`                        the error figures of the paper
`load_network`, `Network`       network files of the program `decoupler`
`read_recording`,               recordings in files, also those that a recipe describes
`import_recording`
==============================  =======================================================

Examples
--------
>>> from decoupler import NetworkRegressor, errors, simulate
>>> data = simulate("10x6_3x18", samples=300, seed=1)
>>> model = NetworkRegressor(hidden=6, epochs=30, inputs="resistance", random_state=1)
>>> model = model.fit(data.train.X, data.train.y, validation=data.validation)
>>> found = errors(data.test.y, model.predict(data.test.X), stroke_mm=data.stroke_mm)
>>> found.z_percent < 5.0
True
"""

from importlib.metadata import version

from ._decoders import FuzzyDecoder, RadialBasisDecoder, RidgeDecoder
from ._network import Exported, Network, load_network
from ._recording import Recording, import_recording, read_recording
from ._regressor import NetworkRegressor
from ._samples import Samples
from ._sensor import Identifiability, SensorArray
from ._simulation import NodeErrors, Simulated, errors, simulate

__version__ = version("decoupler")

__all__ = [
    "Exported",
    "FuzzyDecoder",
    "Identifiability",
    "Network",
    "NetworkRegressor",
    "NodeErrors",
    "RadialBasisDecoder",
    "Recording",
    "RidgeDecoder",
    "Samples",
    "SensorArray",
    "Simulated",
    "errors",
    "import_recording",
    "load_network",
    "read_recording",
    "simulate",
]
