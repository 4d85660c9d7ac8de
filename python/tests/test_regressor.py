"""Estimators: forms of samples, seeds, copies, threads and interruptions."""

import itertools
import pickle
import signal
import subprocess
import sys
import textwrap
from concurrent.futures import ThreadPoolExecutor

import joblib
import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.exceptions import ConvergenceWarning, NotFittedError
from sklearn.model_selection import GridSearchCV, cross_val_score

from decoupler import FuzzyDecoder, NetworkRegressor, RadialBasisDecoder, RidgeDecoder, _native
from decoupler._regressor import SETTINGS

ALL = [
    NetworkRegressor(hidden=4, epochs=20, random_state=5),
    RidgeDecoder(),
    RadialBasisDecoder(random_state=5),
    FuzzyDecoder(random_state=5),
]


def read_only(values):
    values = values.copy()
    values.flags.writeable = False
    return values


@pytest.mark.parametrize("model", ALL, ids=lambda model: type(model).__name__)
class TestAllEstimators:
    def test_forms_of_the_same_samples_give_the_same_answers(self, model, curve):
        X, y = curve
        expected = clone(model).fit(X, y).predict(X)
        assert expected.shape == y.shape
        for form in (np.asfortranarray, read_only, np.ndarray.tolist, pd.DataFrame):
            np.testing.assert_array_equal(clone(model).fit(form(X), form(y)).predict(X), expected)
        strided = np.repeat(X, 2, axis=0)[::2]
        np.testing.assert_array_equal(clone(model).fit(strided, y).predict(strided), expected)

    def test_single_precision_is_converted_exactly(self, model, curve):
        X, y = (values.astype(np.float32) for values in curve)
        in_double = clone(model).fit(X.astype(float), y.astype(float)).predict(X.astype(float))
        np.testing.assert_array_equal(clone(model).fit(X, y).predict(X), in_double)

    def test_a_single_target_has_the_shape_of_y(self, model, curve):
        X, y = curve
        flat = clone(model).fit(X, y[:, 0])
        column = clone(model).fit(X, y[:, :1])
        assert flat.predict(X).shape == (300,)
        assert column.predict(X).shape == (300, 1)
        np.testing.assert_array_equal(flat.predict(X), column.predict(X)[:, 0])

    def test_refits_and_copies_have_the_same_bits(self, model, curve):
        X, y = curve
        fitted = clone(model).fit(X, y)
        expected = fitted.predict(X)
        restored = pickle.loads(pickle.dumps(fitted))
        np.testing.assert_array_equal(restored.predict(X), expected)
        np.testing.assert_array_equal(fitted.fit(X, y).predict(X), expected)

    def test_samples_are_decoded_alike_alone_and_together(self, model, curve):
        X, y = curve
        fitted = clone(model).fit(X, y)
        alone = np.vstack([fitted.predict(sample[np.newaxis]) for sample in X[:20]])
        np.testing.assert_array_equal(alone, fitted.predict(X)[:20])

    def test_each_row_wire_has_a_decoder_of_its_own(self, model, curve):
        X, y = curve
        wires = np.arange(300) % 3 * 2  # 0, 2 and 4
        together = clone(model).set_params(rows=0).fit(np.column_stack([wires, X]), y)
        answers = together.predict(np.column_stack([wires, X]))
        apart = clone(model).fit(X[wires == 2], y[wires == 2]).predict(X[wires == 2])
        if isinstance(model, NetworkRegressor | RidgeDecoder):
            assert np.abs(answers[wires == 2] - apart).max() < 1.0
        named = pd.DataFrame(np.column_stack([X, wires]), columns=["a", "b", "c", "wire"])
        by_name = clone(model).set_params(rows="wire").fit(named, y)
        np.testing.assert_array_equal(by_name.predict(named), answers)
        with pytest.raises(ValueError, match="row-wire 3 "):
            together.predict(np.column_stack([np.full(300, 3), X]))

    def test_not_fitted(self, model, curve):
        with pytest.raises(NotFittedError):
            clone(model).predict(curve[0])

    def test_values_that_are_not_finite_are_named(self, model, curve):
        X, y = curve
        fitted = clone(model).fit(X, y)
        broken = X.copy()
        broken[7, 1] = np.nan
        with pytest.raises(ValueError, match="NaN"):
            clone(model).fit(broken, y)
        with pytest.raises(ValueError, match="NaN"):
            fitted.predict(broken)
        with pytest.raises(ValueError, match="resistance"):
            clone(model).set_params(inputs="resistance").fit(X, y)


def test_known_row_wires_are_trained_apart(small):
    train, test = small.train, small.test
    model = NetworkRegressor(hidden=4, epochs=30, rows=-1, random_state=0)
    answers = model.fit(train.with_rows(), train.y).predict(test.with_rows())
    assert model.network_.row_wires == [0, 1, 2, 3]
    shared = NetworkRegressor(hidden=4, epochs=30, random_state=0).fit(train.X, train.y)
    z = slice(2, None, 3)
    own, common = (np.abs(a - test.y)[:, z].mean() for a in (answers, shared.predict(test.X)))
    assert own < common


def test_parameters_are_stored_unchanged_and_settings_reach_the_training(curve):
    X, y = curve
    settings = {"mu_decrease": 0.5}
    model = NetworkRegressor(method_settings=settings, hidden="twelve")
    assert model.method_settings is settings
    assert model.hidden == "twelve"
    usual = NetworkRegressor(epochs=5, random_state=0).fit(X, y)
    other = NetworkRegressor(epochs=5, random_state=0, method_settings=settings).fit(X, y)
    assert (usual.loss_curve_ != other.loss_curve_).any()


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"hidden": 0}, "hidden is 0"),
        ({"hidden": 1.5}, "hidden: '1.5' is not a whole number"),
        ({"hidden": 10_000}, "it must be from 1 to 512"),
        ({"method": "adam"}, "'adam' is not a training method: give lm"),
        ({"method_settings": {"nu": 1}}, "lm has no setting 'nu'; it has mu"),
        ({"method_settings": {"mu": -1}}, "mu"),
        ({"epochs": 0}, "epochs is 0"),
        ({"starts": 101}, "starts is 101"),
        ({"combine": "median"}, "give best or mean"),
        ({"begin": "zeros"}, "give random or ridge"),
        ({"goal": -1.0}, "goal is -1"),
        ({"min_gradient": "small"}, "min gradient: 'small' is not a number"),
        ({"validation_fraction": 1.0}, "validation fraction 1"),
        ({"split": "group"}, "give the group of each sample"),
        ({"split": "rows"}, "give time, group or random"),
        ({"rows": "wire"}, "there is no column 'wire'"),
        ({"rows": 3}, "rows is 3"),
        ({"rows": 0}, "whole numbers"),
        ({"inputs": "volts"}, "give raw, resistance, conductance or log"),
        ({"scaling": "robust"}, "minmax"),
        ({"intervals": "auto"}, "give always or never"),
        ({"random_state": -1}, "random_state is -1"),
        ({"random_state": 2**64}, "random_state is"),
    ],
    ids=lambda value: str(value)[:40],
)
def test_parameters_out_of_range_are_named(curve, parameters, message):
    with pytest.raises(ValueError, match=message):
        NetworkRegressor(**{"epochs": 3, **parameters}).fit(*curve)


def test_curves_have_an_entry_for_the_start_and_each_epoch(curve):
    model = NetworkRegressor(epochs=15, max_fail=1000, random_state=1).fit(*curve)
    assert model.n_iter_ == 15
    assert model.loss_curve_.shape == model.validation_loss_curve_.shape == (16,)
    assert model.loss_curve_[-1] < 0.01 * model.loss_curve_[0]
    assert model.best_epoch_ == np.argmin(model.validation_loss_curve_)
    assert model.stop_reason_ == "all epochs done"
    nothing_held_out = NetworkRegressor(epochs=3, validation_fraction=0.0).fit(*curve)
    assert nothing_held_out.validation_loss_curve_ is None


def test_validation_samples_can_be_given(curve):
    X, y = curve
    by_share = NetworkRegressor(epochs=10, random_state=2).fit(X, y)
    given = NetworkRegressor(epochs=10, random_state=2)
    given.fit(X[:240], y[:240], validation=(X[240:], y[240:]))
    np.testing.assert_array_equal(given.predict(X), by_share.predict(X))


def test_groups_are_held_out_together(curve):
    X, y = curve
    groups = np.repeat([f"press {number}" for number in range(10)], 30)
    model = NetworkRegressor(epochs=5, split="group", random_state=0).fit(X, y, groups=groups)
    again = NetworkRegressor(epochs=5, split="group", random_state=0).fit(X, y, groups=groups)
    np.testing.assert_array_equal(model.loss_curve_, again.loss_curve_)
    with pytest.raises(ValueError, match="groups has shape"):
        model.fit(X, y, groups=groups[1:])


def test_random_states(curve):
    def losses(random_state):
        return NetworkRegressor(epochs=2, random_state=random_state).fit(*curve).loss_curve_[0]

    assert losses(1) == losses(1) == losses(np.int64(1)) != losses(2)
    assert losses(np.random.RandomState(0)) == losses(np.random.RandomState(0))
    assert losses(np.random.default_rng(0)) == losses(np.random.default_rng(0))
    assert losses(None) != losses(None)


def test_intervals_cover_nine_of_ten_samples():
    random = np.random.default_rng(4)
    X = random.uniform(-1.0, 1.0, size=(900, 2))
    y = X[:, 0] ** 2 + 0.1 * random.normal(size=900)
    model = NetworkRegressor(4, epochs=20, intervals="always", random_state=0)
    model.fit(X[:600], y[:600])
    lower, upper = model.predict_interval(X[600:])
    assert lower.shape == upper.shape == (300,)
    assert 0.83 < np.mean((lower <= y[600:]) & (y[600:] <= upper)) < 0.97
    with pytest.raises(ValueError, match='intervals="always"'):
        NetworkRegressor(epochs=2).fit(X, y).predict_interval(X)


def test_too_few_samples_for_intervals_warn(curve):
    X, y = (values[:8] for values in curve)
    model = NetworkRegressor(2, epochs=3, intervals="always", random_state=0)
    with pytest.warns(ConvergenceWarning, match="no prediction intervals: there are fewer than 9"):
        model.fit(X, y)
    assert model.predict(X).shape == y.shape


def test_an_unsuccessful_training_warns(curve):
    settings = {"learning_rate": 50.0}
    model = NetworkRegressor(method="gd", epochs=20, method_settings=settings, random_state=0)
    with pytest.warns(ConvergenceWarning, match="diverged"):
        model.fit(*curve)
    assert np.isfinite(model.predict(curve[0])).all()


def test_searches_and_cross_validation(curve):
    X, y = curve
    scores = cross_val_score(NetworkRegressor(6, epochs=40, random_state=0), X, y, cv=3, n_jobs=2)
    assert (scores > 0.9).all()
    search = GridSearchCV(NetworkRegressor(epochs=30, random_state=0), {"hidden": [1, 6]}, cv=3).fit(X, y)
    assert search.best_params_ == {"hidden": 6}


def test_the_callback_sees_every_epoch_and_can_end_the_training(curve):
    seen = []

    def callback(epoch, losses):
        seen.append((epoch, losses))
        return epoch == 4

    model = NetworkRegressor(random_state=0, callback=callback).fit(*curve)
    assert [epoch for epoch, _ in seen] == [1, 2, 3, 4]
    assert [losses["training"] for _, losses in seen] == list(model.loss_curve_[1:])
    assert [losses["validation"] for _, losses in seen] == list(model.validation_loss_curve_[1:])
    assert model.stop_reason_ == "stopped by you"


def test_an_exception_of_the_callback_keeps_the_best_network(curve):
    def callback(epoch, losses):
        if epoch == 3:
            raise LookupError("enough")

    model = NetworkRegressor(random_state=0, callback=callback)
    with pytest.raises(LookupError, match="enough"):
        model.fit(*curve)
    assert model.n_iter_ == 3
    three = NetworkRegressor(random_state=0, epochs=3).fit(*curve)
    np.testing.assert_array_equal(model.predict(curve[0]), three.predict(curve[0]))


def test_ctrl_c_ends_the_training_between_two_epochs(curve):
    def callback(epoch, losses):
        if epoch == 3:
            signal.raise_signal(signal.SIGINT)

    model = NetworkRegressor(random_state=0, goal=0.0, min_gradient=0.0, callback=callback)
    with pytest.raises(KeyboardInterrupt):
        model.fit(*curve)
    assert 3 <= model.n_iter_ <= 4
    assert np.isfinite(model.predict(curve[0])).all()


def test_ctrl_c_reaches_a_training_without_a_callback():
    """Without a callback only the check between two epochs can see the signal."""
    script = textwrap.dedent("""
        import signal, sys, threading, numpy as np
        from decoupler import NetworkRegressor
        X = np.random.default_rng(0).normal(size=(2000, 20))
        y = X @ np.random.default_rng(1).normal(size=(20, 6)) + np.sin(3 * X[:, :6])
        model = NetworkRegressor(30, epochs=1_000_000, max_fail=1_000_000, min_gradient=0.0)
        threading.Timer(0.5, signal.raise_signal, [signal.SIGINT]).start()
        try:
            model.fit(X, y)
        except KeyboardInterrupt:
            sys.exit(0 if model.predict(X).shape == y.shape else 2)
        sys.exit(1)
    """)
    assert subprocess.run([sys.executable, "-c", script], timeout=120).returncode == 0


def test_names_and_defaults_are_those_of_the_program():
    defaults = dict(_native.default_settings())
    parameters = NetworkRegressor().get_params()
    for name in SETTINGS:
        assert str(type(parameters[name])(defaults[name])) == str(parameters[name]), name


def fit_one(seed, X, y):
    return NetworkRegressor(5, epochs=15, starts=2, random_state=seed).fit(X, y).loss_curve_


def test_a_hundred_fits_in_threads_and_processes_give_the_same_numbers(curve):
    seeds = range(100)
    expected = [fit_one(seed, *curve) for seed in seeds]
    with ThreadPoolExecutor(8) as pool:
        in_threads = list(pool.map(lambda seed: fit_one(seed, *curve), seeds))
    jobs = [joblib.delayed(fit_one)(seed, *curve) for seed in seeds]
    in_processes = joblib.Parallel(n_jobs=2)(jobs)
    in_forks = joblib.Parallel(n_jobs=2, backend="multiprocessing")(jobs)
    for found in (in_threads, in_processes, in_forks):
        assert all(map(np.array_equal, found, expected))


def test_training_releases_the_interpreter_lock():
    """Two threads see each other's epochs while both train."""
    X = np.random.default_rng(0).normal(size=(3000, 20))
    order = []

    def train(name):
        model = NetworkRegressor(20, epochs=10, callback=lambda epoch, losses: order.append(name), random_state=0)
        model.fit(X, np.sin(X[:, :4]))

    with ThreadPoolExecutor(2) as pool:
        list(pool.map(train, "ab"))
    changes = sum(one != other for one, other in itertools.pairwise(order))
    assert changes > 1
