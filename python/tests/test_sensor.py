"""The sensor model, simulated samples and error figures."""

import json
import pickle

import numpy as np
import pytest
from conftest import program

from decoupler import SensorArray, errors, simulate


@pytest.fixture
def pressed() -> np.ndarray:
    random = np.random.default_rng(0)
    return random.uniform([-0.2, -0.2, 0.0], [0.2, 0.2, 1.0], size=(2, 10, 6, 3))


def test_resistances_are_parallel_connections_of_all_pairs_of_nodes(pressed):
    sensor = SensorArray("10x6_3x18", height_mm=4.0, resistivity_ohm_per_mm=50.0)
    found = sensor.resistances(pressed)
    nodes = sensor.positions(pressed)
    assert found.shape == (2, 10, 18)
    # The nodes of column-wire k are at x = 14 + 5 j, y = 1 + k, z = 0.
    k, j = np.arange(18), np.arange(3)
    columns = np.stack(np.broadcast_arrays(14.0 + 5.0 * j, 1.0 + k[:, None], 0.0), axis=-1)
    distances = np.linalg.norm(nodes[:, :, None, :, None] - columns[:, None], axis=-1)
    expected = 50.0 / (1.0 / distances).sum(axis=(-2, -1))
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_the_jacobian_is_the_derivative_of_the_resistances(pressed):
    sensor = SensorArray("10x6_3x18")
    jacobian = sensor.jacobian(pressed)
    assert jacobian.shape == (2, 10, 18, 6, 3)
    step = np.zeros_like(pressed)
    step[:, :, 4, 2] = 1e-5
    difference = sensor.resistances(pressed + step) - sensor.resistances(pressed - step)
    np.testing.assert_allclose(jacobian[..., 4, 2], difference / 2e-5, rtol=1e-6)


def test_identifiability_is_that_of_the_logarithmic_jacobian(pressed):
    sensor = SensorArray("10x6_3x18")
    one = pressed[0]
    found = sensor.identifiability(3, one[3], axes="z", noise=1e-3)
    log_jacobian = sensor.jacobian(one)[3, :, :, 2] / sensor.resistances(one)[3][:, None]
    singular = np.linalg.svd(log_jacobian, compute_uv=False)
    np.testing.assert_allclose(found.singular_values_per_mm, singular, rtol=1e-9)
    assert found.condition == pytest.approx(singular[0] / singular[-1])
    assert found.worst_spread_mm == pytest.approx(1e-3 / singular[-1])
    assert found.worst_pattern.shape == found.sensitivity_per_mm.shape == (6, 3)


def test_arrays_are_values():
    sensor = SensorArray("10x8_4x24", row_pitch_mm=1.5)
    assert (sensor.row_wires, sensor.nodes_per_row) == (10, 8)
    assert (sensor.nodes_per_column, sensor.column_wires) == (4, 24)
    copy = pickle.loads(pickle.dumps(sensor))
    assert copy == sensor != SensorArray("10x8_4x24")
    rest = np.zeros((10, 8, 3))
    np.testing.assert_array_equal(copy.resistances(rest), sensor.resistances(rest))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: SensorArray("ten by six"), "is not an array scale"),
        (lambda: SensorArray("10x0_5x30"), "it must be from 1 to"),
        (lambda: SensorArray(height_mm=0.0), "the height is 0 mm"),
        (lambda: SensorArray(resistivity_ohm_per_mm=-1.0), "the resistance per millimetre"),
        (lambda: SensorArray().resistances(np.zeros((10, 10))), "give"),
        (lambda: SensorArray().resistances(np.full((10, 10, 3), np.nan)), "resistance is NaN"),
        (lambda: SensorArray().identifiability(10), "row 11 does not exist"),
        (lambda: SensorArray().identifiability(-1), "row is -1"),
        (lambda: SensorArray().identifiability(0, np.zeros((9, 3))), "10"),
        (lambda: SensorArray().identifiability(axes="y"), "not a choice of axes"),
        (lambda: SensorArray().identifiability(noise=-1.0), "noise is -1"),
        (lambda: simulate(samples=0), "samples is 0"),
        (lambda: simulate(samples=10**9), "it must be from 1 to 1000000"),
        (lambda: simulate(rows=11), "row 11 does not exist"),
        (lambda: simulate(loading="brick"), "is not a loading"),
        (lambda: simulate(axes="xy"), "is not a choice of axes"),
        (lambda: simulate(noise=2.0), "relative noise is 2"),
        (lambda: simulate(noise_in="none"), "give both, training or test"),
        (lambda: simulate(adc_bits=40), "adc bits is 40: it must be from 1 to 32"),
        (lambda: simulate(preset="worst"), "is not a preset"),
        (lambda: errors([[1.0, 2.0]], [[1.0, 2.0]]), "multiple of 3"),
        (lambda: errors([[1.0, 2.0, 3.0]], [[1.0]]), "one answer for each coordinate"),
        (lambda: errors([[1.0, 2.0, 3.0]], [[1.0, 2.0, 3.0]], stroke_mm=0.0), "stroke_mm"),
        (lambda: errors([["a"] * 3], [[1.0, 2.0, 3.0]]), "y_true is not an array of numbers"),
    ],
)
def test_impossible_values_are_named(make, message):
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.parametrize(
    "scene",
    [{}, {"noise": 1e-3, "drift": 0.01, "adc_bits": 16}, {"axes": "xyz", "loading": "smooth:4"}],
    ids=str,
)
def test_test_samples_are_those_of_the_program(scene):
    data = simulate("10x6_3x18", test_samples=40, samples=10, seed=9, **scene)
    rare = ("drift", "adc_bits")
    words = {name: f"{name.replace('_', '-')}={value}" for name, value in scene.items()}
    arguments = [word for name in words for word in (("--set", words[name]) if name in rare else (f"--{words[name]}",))]
    array = ["--array", "10x6_3x18", "--samples", "40", "--seed", "9"]
    done = program("simulate", *array, *arguments)
    assert done.returncode == 0, done.stderr
    header, *lines = done.stdout.splitlines()
    values = np.array([[float(value) for value in line.split(",")] for line in lines])
    assert header.startswith("snapshot,row,r_1,")
    np.testing.assert_array_equal(values[:, 2:20], data.test.X)
    np.testing.assert_array_equal(values[:, 20:], data.test.y)
    np.testing.assert_array_equal(values[:, 0] - 1, data.test.groups)
    np.testing.assert_array_equal(values[:, 1] - 1, data.test.rows)


def test_errors_are_those_of_the_program(tmp_path, small):
    """The program's network, decoded and measured here, has the errors in its output."""
    file = tmp_path / "network.json"
    sizes = ["--samples", "200", "--set", "validation-samples=40", "--set", "test-samples=40"]
    settings = ["--seed", "3", "--hidden", "4", "--epochs", "15", "--decoder", "mean"]
    done = program("train", "--array", "4x4_2x12", *sizes, *settings, "--out", file, "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    from decoupler import load_network

    network = load_network(file)
    scores = network.metadata["scores"]["network"]["nodes"]
    found = errors(
        small.test.y,
        network.predict(small.test.X),
        stroke_mm=small.stroke_mm,
        rows=small.test.rows,
        groups=small.test.groups,
    )
    for figure in ("z_percent", "x_percent", "z_mm", "z_full_scale_percent", "worst_mm"):
        assert getattr(found, figure) == pytest.approx(scores[figure], rel=1e-9)
    worst = scores["worst_node"]
    assert found.worst_node == (worst["snapshot"], worst["row"], worst["node"])
    assert json.loads(done.stdout)
