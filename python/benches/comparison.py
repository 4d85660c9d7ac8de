"""Error on test samples after 1, 10 and 60 s of training, compared with other networks for Python on the same arrays.

All networks have one hidden layer of 12 hyperbolic tangents and take inputs and targets scaled to [-1, 1]. What is
trained without early stopping is tested with the weights of the lowest validation error. Needs `pyrenn`;
torch-levenberg-marquardt is included if it is installed. Usage:

    comparison.py [--seconds 1,10,60] [--recording X.npy y.npy X_test.npy y_test.npy]
"""

import argparse
import time
import warnings
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from sklearn.neural_network import MLPRegressor

import decoupler

HIDDEN = 12


class Task(NamedTuple):
    """Samples, scaled to [-1, 1] by those of training, and the error in the unit of the report."""

    name: str
    unit: str
    train: tuple[np.ndarray, np.ndarray]
    validation: tuple[np.ndarray, np.ndarray]
    test: tuple[np.ndarray, np.ndarray]
    error: Callable[[np.ndarray], float]


def scaling(values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    low, high = values.min(axis=0), values.max(axis=0)
    varying = high > low
    return (low + high)[varying] / 2, (high - low)[varying] / 2, varying


def task(name, unit, train, validation, test, error) -> Task:
    (x0, dx, x), (y0, dy, y) = map(scaling, train)
    constants = train[1][0]

    def scaled(part):
        return (part[0][:, x] - x0) / dx, (part[1][:, y] - y0) / dy

    def measured(answers):
        restored = np.tile(constants, (len(answers), 1))
        restored[:, y] = answers * dy + y0
        return error(test[1], restored)

    return Task(name, unit, scaled(train), scaled(validation), scaled(test), measured)


def paper() -> Task:
    data = decoupler.simulate(seed=0)
    parts = [(part.X, part.y) for part in (data.train, data.validation, data.test)]
    return task(
        "10x10_5x30, 1000 samples",
        "AveZerr, %",
        *parts,
        lambda truth, answers: decoupler.errors(truth, answers).z_percent,
    )


def recording(files: list[str]) -> Task:
    X, y, X_test, y_test = map(np.load, files)
    first = len(X) * 4 // 5

    def error(truth, answers):
        return float(100 * np.mean(np.abs(answers - truth) / np.ptp(y, axis=0)))

    name = f"recording, {first} samples, {X.shape[1]} to {y.shape[1]}"
    return task(name, "MAE, % of range", (X[:first], y[:first]), (X[first:], y[first:]), (X_test, y_test), error)


#: Seconds since the beginning, and the test error of the network with the lowest validation error so far.
Progress = Iterator[tuple[float, float]]


class Best:
    """Error on the test samples of the best network so far by validation error."""

    def __init__(self, task: Task) -> None:
        self.task, self.validation, self.test = task, np.inf, np.nan

    def update(self, predict: Callable[[np.ndarray], np.ndarray]) -> float:
        inputs, targets = self.task.validation
        found = np.mean((predict(inputs) - targets) ** 2)
        if found < self.validation:
            self.validation, self.test = found, self.task.error(predict(self.task.test[0]))
        return self.test


def ours(task: Task, seconds: float, **settings) -> Progress:
    """A fit for each limit, which the callback ends; training continues after validation failures."""
    for limit in (1.0, 10.0, 60.0):
        if limit > seconds:
            return
        begun = time.perf_counter()
        model = decoupler.NetworkRegressor(
            HIDDEN,
            epochs=1_000_000,
            max_fail=1_000_000,
            random_state=0,
            callback=lambda *_, begun=begun, limit=limit: time.perf_counter() - begun > 0.97 * limit,
            **settings,
        )
        model.fit(*task.train, validation=task.validation)
        taken = time.perf_counter() - begun
        yield min(taken, limit), task.error(model.predict(task.test[0]))
        print(f"    {model.n_iter_} epochs in {taken:.2f} s", flush=True)


def ours_by_default(task: Task, seconds: float) -> Progress:
    """A fit that ends by itself."""
    begun = time.perf_counter()
    model = decoupler.NetworkRegressor(HIDDEN, random_state=0).fit(*task.train, validation=task.validation)
    yield time.perf_counter() - begun, task.error(model.predict(task.test[0]))
    print(f"    {model.n_iter_} epochs: {model.stop_reason_}")


def lbfgs(task: Task, seconds: float, **settings) -> Progress:
    """Fits of more and more iterations, each timed from its own beginning."""
    best, iterations = Best(task), 25
    while True:
        model = MLPRegressor(
            hidden_layer_sizes=(HIDDEN,),
            activation="tanh",
            solver="lbfgs",
            max_iter=iterations,
            max_fun=10**9,
            tol=0.0,
            random_state=0,
            **settings,
        )
        begun = time.perf_counter()
        model.fit(*task.train)
        taken = time.perf_counter() - begun
        if taken > seconds:
            return
        yield taken, best.update(lambda X: model.predict(X).reshape(len(X), -1))
        if model.n_iter_ < iterations:
            return
        iterations *= 2


def adam(task: Task, seconds: float, **settings) -> Progress:
    """Epochs until the time is over."""
    best, spent = Best(task), 0.0
    model = MLPRegressor(hidden_layer_sizes=(HIDDEN,), activation="tanh", solver="adam", random_state=0, **settings)
    while spent < seconds:
        begun = time.perf_counter()
        for _ in range(10):
            model.partial_fit(*task.train)
        spent += time.perf_counter() - begun
        yield spent, best.update(lambda X: model.predict(X).reshape(len(X), -1))


def pyrenn(task: Task, seconds: float) -> Progress:
    """Levenberg-Marquardt with a dense Jacobian; its own output is silenced."""
    import pyrenn as toolbox

    (inputs, targets), best, spent = task.train, Best(task), 0.0
    np.random.seed(0)
    net = toolbox.CreateNN([inputs.shape[1], HIDDEN, targets.shape[1]])
    while spent < seconds:
        begun = time.perf_counter()
        net = toolbox.train_LM(inputs.T, targets.T, net, k_max=2, E_stop=0.0)
        spent += time.perf_counter() - begun
        yield spent, best.update(lambda X: np.asarray(toolbox.NNOut(X.T, net)).reshape(targets.shape[1], -1).T)


def torch_lm(task: Task, seconds: float) -> Progress:
    """Levenberg-Marquardt of torch-levenberg-marquardt in double precision on the CPU."""
    import torch
    import torch_levenberg_marquardt as tlm

    torch.manual_seed(0)
    inputs, targets = (torch.tensor(values, dtype=torch.float64) for values in task.train)
    layers = (
        torch.nn.Linear(inputs.shape[1], HIDDEN),
        torch.nn.Tanh(),
        torch.nn.Linear(HIDDEN, targets.shape[1]),
    )
    model = torch.nn.Sequential(*layers).double()
    module = tlm.training.LevenbergMarquardtModule(model=model, loss_fn=tlm.loss.MSELoss())
    best, spent = Best(task), 0.0
    while spent < seconds:
        begun = time.perf_counter()
        module.training_step(inputs, targets)
        spent += time.perf_counter() - begun
        with torch.no_grad():
            yield spent, best.update(lambda X: model(torch.tensor(X, dtype=torch.float64)).numpy())


def at(progress: Progress, limits: list[float]) -> list[float]:
    """Return the last error within each limit."""
    errors = [np.nan] * len(limits)
    for taken, error in progress:
        errors = [error if taken <= limit else before for before, limit in zip(errors, limits, strict=True)]
    return errors


def tuned(method, task: Task, candidates: list[dict]) -> dict:
    """Return the settings with the lowest error after 5 s; choosing by the test error favours the method."""
    found = [(at(method(task, 5.0, **settings), [5.0])[0], settings) for settings in candidates]
    return min(found, key=lambda pair: pair[0] if np.isfinite(pair[0]) else np.inf)[1]


def main() -> None:
    """Print a table for each task."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", default="1,10,60")
    parser.add_argument("--recording", nargs=4)
    arguments = parser.parse_args()
    limits = [float(limit) for limit in arguments.seconds.split(",")]
    tasks = [paper()] + ([recording(arguments.recording)] if arguments.recording else [])
    warnings.simplefilter("ignore")
    for task in tasks:
        print(f"\n## {task.name} ({task.unit})", flush=True)
        of_lbfgs = tuned(lbfgs, task, [{"alpha": alpha} for alpha in (0.0, 1e-5, 1e-3)])
        rates = [
            {"learning_rate_init": rate, "batch_size": size, "alpha": 0.0}
            for rate in (3e-3, 1e-2)
            for size in (32, 200)
        ]
        of_adam = tuned(adam, task, rates)
        rows = {
            "NetworkRegressor(method='lm')": lambda: ours(task, limits[-1]),
            "NetworkRegressor(method='br')": lambda: ours(task, limits[-1], method="br"),
            "NetworkRegressor() as it ends by itself": lambda: ours_by_default(task, limits[-1]),
            f"MLPRegressor(solver='lbfgs', {of_lbfgs})": lambda: lbfgs(task, limits[-1], **of_lbfgs),
            f"MLPRegressor(solver='adam', {of_adam})": lambda: adam(task, limits[-1], **of_adam),
            "pyrenn": lambda: pyrenn(task, limits[-1]),
            "torch-levenberg-marquardt": lambda: torch_lm(task, limits[-1]),
        }
        for name, run in rows.items():
            try:
                errors = at(run(), limits)
            except ImportError as missing:
                print(f"{name}: not measured ({missing})")
                continue
            print(
                f"{name}: "
                + ", ".join(f"{limit:g} s {error:.3g}" for limit, error in zip(limits, errors, strict=True)),
                flush=True,
            )


if __name__ == "__main__":
    main()
