"""Time of `predict`, compared with onnxruntime and MLPRegressor; peak memory of a fit on a million samples."""

import subprocess
import sys
import tempfile
import textwrap
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import onnxruntime
from sklearn.neural_network import MLPRegressor

from decoupler import NetworkRegressor, simulate


def microseconds(call: Callable[[], object]) -> float:
    """Return the shortest time of a call, of many in half a second."""
    call()
    shortest, end = np.inf, time.perf_counter() + 0.5
    while time.perf_counter() < end:
        begun = time.perf_counter()
        call()
        shortest = min(shortest, time.perf_counter() - begun)
    return 1e6 * shortest


def prediction() -> None:
    """Print the times for 1, 10 and 10 000 samples of the paper's array."""
    data = simulate(seed=0)
    model = NetworkRegressor(12, epochs=50, random_state=0).fit(data.train.X, data.train.y, validation=data.validation)
    other = MLPRegressor(hidden_layer_sizes=(12,), activation="tanh", max_iter=5).fit(data.train.X, data.train.y)
    with tempfile.TemporaryDirectory() as folder:
        model.export(Path(folder) / "bundle")
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        graph = next((Path(folder) / "bundle").glob("*.onnx"))
        session = onnxruntime.InferenceSession(str(graph), options)
    name = session.get_inputs()[0].name
    X = np.resize(data.test.X, (10_000, 30))
    for count in (1, 10, 10_000):
        some = np.ascontiguousarray(X[:count])
        times = {
            "NetworkRegressor.predict": microseconds(lambda some=some: model.predict(some)),
            "Network.predict": microseconds(lambda some=some: model.network_.predict(some)),
            "onnxruntime, double precision": microseconds(lambda some=some: session.run(None, {name: some})),
            "MLPRegressor.predict": microseconds(lambda some=some: other.predict(some)),
        }
        print(f"{count} samples: " + ", ".join(f"{key} {value:.4g} us" for key, value in times.items()))


MEMORY = """
    import resource, numpy as np
    from decoupler import NetworkRegressor, RidgeDecoder

    def peak():
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024

    X = np.empty((1_000_000, 30), np.float32)
    generator = np.random.default_rng(0)
    for first in range(0, 1_000_000, 100_000):
        X[first:first + 100_000] = generator.random((100_000, 30), dtype=np.float32)
    y = np.tanh(X[:, :1] - X[:, 1:2])
    NetworkRegressor(12, epochs=2, random_state=0).fit(X[:1000], y[:1000])
    before = peak()
    NetworkRegressor(12, epochs=2, random_state=0, validation_fraction={fraction}).fit(X, y)
    print(f"{{peak() - before:.0f}} MB above the {{X.nbytes / 2**20:.0f}} MB of X")
"""


def memory() -> None:
    """Print the peak memory of a fit on 1 000 000 x 30 numbers in single precision, in a process of its own."""
    for fraction in (0.0, 0.2):
        script = textwrap.dedent(MEMORY).format(fraction=fraction)
        done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
        print(f"validation_fraction={fraction}: {done.stdout.strip()}")


if __name__ == "__main__":
    prediction()
    memory()
