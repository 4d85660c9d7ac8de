"""Network files, exports and recordings, compared with those of the program."""

import json
import pickle
import sys

import numpy as np
import onnxruntime
import pandas as pd
import pytest
from conftest import program

from decoupler import NetworkRegressor, import_recording, load_network, read_recording

NAMES = ["a", "b", "c"]
TARGETS = ["force", "angle"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("recording")


@pytest.fixture(scope="module")
def recorded(folder):
    """Training and test samples, also as CSV files."""
    random = np.random.default_rng(1)
    X = random.uniform(1.0, 3.0, size=(260, 3))
    y = np.column_stack([np.tanh(X[:, 0] - X[:, 1]), X[:, 2] ** 2])
    table = pd.DataFrame(np.column_stack([X, y, np.arange(260) // 20]), columns=[*NAMES, *TARGETS, "press"])
    table[:200].to_csv(folder / "train.csv", index=False)
    table[200:].to_csv(folder / "test.csv", index=False)
    return table[:200], table[200:]


def trained(folder, *settings):
    columns = ["--inputs", "a,b,c", "--targets", "force,angle"]
    files = ["--data", "train.csv", "--test-data", "test.csv"]
    done = program("train", *files, *columns, *settings, "--out", "network.json", "--json", cwd=folder)
    assert done.returncode == 0, done.stderr
    network = load_network(folder / "network.json")
    (folder / "network.json").unlink()
    return network


@pytest.mark.parametrize(
    ("parameters", "settings"),
    [
        ({}, ["--epochs", "1000", "--method", "lm"]),
        (
            {"hidden": 5, "starts": 3, "random_state": 7, "epochs": 25},
            ["--hidden", "5", "--starts", "3", "--seed", "7", "--epochs", "25", "--method", "lm"],
        ),
        (
            {"method": "br", "epochs": 20, "scaling": "whiten"},
            ["--method", "br", "--epochs", "20", "--scaling", "whiten"],
        ),
        (
            {"split": "group", "epochs": 20, "random_state": 3, "combine": "mean", "starts": 2},
            [
                "--group",
                "press",
                "--split",
                "group",
                "--epochs",
                "20",
                "--seed",
                "3",
                "--method",
                "lm",
                "--set",
                "combine=mean",
                "--starts",
                "2",
            ],
        ),
        (
            {"begin": "ridge", "epochs": 20, "method_settings": {"mu_decrease": 0.5}},
            ["--set", "begin=ridge", "--epochs", "20", "--method", "lm", "--set", "mu-decrease=0.5"],
        ),
    ],
    ids=lambda value: "" if isinstance(value, list) else str(value),
)
def test_the_same_seed_gives_the_bits_of_the_program(folder, recorded, parameters, settings):
    train, test = recorded
    file = trained(folder, *settings)
    model = NetworkRegressor(**{"random_state": 0, **parameters})
    model.fit(train[NAMES], train[TARGETS], groups=train["press"])
    assert model.network_.networks == file.networks
    np.testing.assert_array_equal(model.predict(test[NAMES]), file.predict(test[NAMES].to_numpy()))
    assert file.inputs == model.network_.inputs == NAMES
    assert file.targets == model.network_.targets == TARGETS
    history = file.metadata["training"]["history"]
    assert history["training_mse"] == list(model.loss_curve_)


def test_the_simulated_run_of_the_program_has_the_same_bits(folder, small):
    sizes = [
        "--samples",
        "200",
        "--set",
        "validation-samples=40",
        "--set",
        "test-samples=40",
        "--seed",
        "3",
    ]
    done = program(
        "train",
        "--array",
        "4x4_2x12",
        *sizes,
        "--hidden",
        "4",
        "--epochs",
        "15",
        "--decoder",
        "mean",
        "--out",
        "array.json",
        cwd=folder,
    )
    assert done.returncode == 0, done.stderr
    file = load_network(folder / "array.json")
    model = NetworkRegressor(4, epochs=15, inputs="resistance", random_state=3)
    model.fit(small.train.X, small.train.y, validation=small.validation)
    assert model.network_.networks == file.networks
    assert file.metadata["source"] == "4×4_2×12"
    assert file.inputs[:2] == ["r_1", "r_2"] and file.target_units[0] == "mm"
    restored = pickle.loads(pickle.dumps(file))
    np.testing.assert_array_equal(restored.predict(small.test.X), file.predict(small.test.X))
    assert restored.metadata == file.metadata
    file.save(folder / "copy.json")
    assert (folder / "copy.json").read_text() == (folder / "array.json").read_text()


@pytest.mark.parametrize("precision", ["f64", "f32"])
def test_onnx_files_agree_with_the_network(tmp_path, curve, precision):
    X, y = curve
    model = NetworkRegressor(5, epochs=20, random_state=0).fit(X, y)
    exported = model.export(tmp_path / "onnx", precision=precision)
    assert (exported.deviation or 0.0) <= exported.limit
    (graph,) = (tmp_path / "onnx").glob("*.onnx")
    session = onnxruntime.InferenceSession(str(graph))
    (readings,) = session.get_inputs()
    dtype = np.float64 if precision == "f64" else np.float32
    answers, outside = session.run(None, {readings.name: X.astype(dtype)})
    assert not outside.any()
    tolerance = 1e-12 if precision == "f64" else 1e-5
    np.testing.assert_allclose(answers, model.predict(X), atol=tolerance)


def test_numpy_files_agree_with_the_network(tmp_path, curve):
    X, y = curve
    model = NetworkRegressor(5, epochs=20, random_state=0).fit(X, y)
    model.export(tmp_path / "numpy_files", format="numpy")
    metadata = json.loads((tmp_path / "numpy_files" / "metadata.json").read_text())
    assert metadata["errors"] == []
    sys.path.insert(0, str(tmp_path / "numpy_files"))
    try:
        import decode
    finally:
        sys.path.pop(0)
    answers, _ = decode.decode(X)
    np.testing.assert_allclose(answers, model.predict(X), atol=1e-12)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"format": "keras"}, "'keras' is not a format: give onnx, c99"),
        ({"precision": "f16"}, "'f16' is not a precision"),
        ({"format": "matlab", "precision": "f32"}, "matlab has no precision f32"),
        ({"format": "json"}, "'json' is not a format"),
    ],
)
def test_exports_that_are_not_possible_leave_nothing_behind(tmp_path, curve, arguments, message):
    model = NetworkRegressor(epochs=2, random_state=0).fit(*curve)
    with pytest.raises(ValueError, match=message):
        model.export(tmp_path / "bundle", **arguments)
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "taken").write_text("notes")
    with pytest.raises(ValueError, match="taken"):
        model.export(tmp_path / "taken")


def test_files_that_are_no_networks_are_refused(tmp_path, curve):
    with pytest.raises(ValueError, match=r"cannot read .*missing\.json"):
        load_network(tmp_path / "missing.json")
    (tmp_path / "other.json").write_text('{"format": "decoupler recipe", "version": 1}')
    with pytest.raises(ValueError, match="not a network file"):
        load_network(tmp_path / "other.json")
    with pytest.raises(ValueError, match="X has 2 readings per sample, the network reads 3"):
        model = NetworkRegressor(epochs=2, random_state=0).fit(*curve)
        model.network_.predict(np.zeros((5, 2)))


RECIPE = {
    "format": "decoupler recipe",
    "version": 1,
    "program": "by hand",
    "source": {
        "recording": {
            "import": {"data": "train.csv", "inputs": ["a..c"], "targets": TARGETS},
            "division": {"by": "time", "test_fraction": 0.25, "validation_fraction": 0.2},
        }
    },
}


def test_a_recording_is_imported_with_the_division_of_the_program(folder, recorded):
    train, _ = recorded
    (folder / "recipe.json").write_text(json.dumps(RECIPE))
    recording = import_recording(folder / "recipe.json")
    np.testing.assert_array_equal(recording.all.X, train[NAMES])
    np.testing.assert_array_equal(recording.all.y, train[TARGETS])
    assert (recording.inputs, recording.targets) == (NAMES, TARGETS)
    sizes = [len(part.X) for part in (recording.train, recording.validation, recording.test)]
    assert sizes == [120, 30, 50]
    np.testing.assert_array_equal(recording.test.X, train[NAMES][150:])
    with pytest.raises(ValueError, match="cannot read"):
        import_recording(folder / "none.json")
    read = read_recording(folder / "train.csv", inputs=["a..c"], targets=TARGETS, test_fraction=0.25)
    for part in ("train", "validation", "test"):
        found, expected = getattr(read, part), getattr(recording, part)
        np.testing.assert_array_equal(found.X, expected.X)
        np.testing.assert_array_equal(found.y, expected.y)
    halves = read_recording([folder / "train.csv"] * 2, inputs=["a"], targets=TARGETS[:1], where=["b>2"])
    large = train[NAMES[1]] > 2
    assert len(halves.all.X) == 2 * large.sum()
    with pytest.raises(ValueError, match="no column"):
        read_recording(folder / "train.csv", inputs=["z"], targets=TARGETS)
    (folder / "recipe.json").write_text(json.dumps(RECIPE).replace("train.csv", "none.csv"))
    with pytest.raises(ValueError, match=r"none\.csv"):
        import_recording(folder / "recipe.json")


def test_a_network_with_a_memory_decodes_consecutive_samples(folder, recorded):
    _, test = recorded
    files = ["--data", "train.csv", "--test-data", "test.csv"]
    columns = ["--inputs", "a,b,c", "--targets", "force,angle", "--lags", "1,2"]
    done = program("inspect", *files, *columns, "--recipe-out", "lags.json", cwd=folder)
    assert done.returncode == 0, done.stderr
    settings = ["--method", "lm", "--epochs", "10", "--hidden", "3"]
    done = program("train", "--recipe", "lags.json", *settings, "--out", "network.json", cwd=folder)
    assert done.returncode == 0, done.stderr
    file = load_network(folder / "network.json")
    (folder / "network.json").unlink()
    answers = file.predict(test[NAMES].to_numpy())
    assert answers.shape == (60, 2)
    # The first sample has no past, so it is not decoded as in the middle of the stream.
    later = file.predict(test[NAMES].to_numpy()[10:])
    assert (later[0] != answers[10]).any() and np.array_equal(later[5:], answers[15:])


def test_a_memory_continues_as_in_the_program(tmp_path):
    """Two groups and three row-wires are interleaved, the sensor pauses, and its clock starts again."""
    random = np.random.default_rng(2)
    sample = np.arange(3000)
    times = np.cumsum(random.uniform(0.02, 0.05, 3000))
    times[1000:] += 60.0
    times[1500:] -= times[1500]
    wires, groups = sample % 3, np.array(["first", "second"])[sample // 3 % 2]
    u = np.sin(0.37 * sample) + np.sin(1.9 * np.sqrt(sample))
    table = pd.DataFrame({"time": times, "press": groups, "row": wires + 1, "u": u, "force": np.roll(u, 6)})
    table.to_csv(tmp_path / "train.csv", index=False)
    columns = ["--time", "time", "--group", "press", "--row-wire", "row", "--inputs", "u", "--targets", "force"]
    past = ["--lags", "2", "--history", "0.5s", "--recipe-out", "recipe.json"]
    training = ["--recipe", "recipe.json", "--hidden", "3", "--epochs", "20", "--out", "network.json"]
    for arguments in [["inspect", "--data", "train.csv", *columns, *past], ["train", *training]]:
        done = program(*arguments, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
    done = program("decode", "--network", "network.json", "--data", "train.csv", "--out", "decoded.csv", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    expected = pd.read_csv(tmp_path / "decoded.csv")["force"]
    network = load_network(tmp_path / "network.json")
    answers = network.predict(u[:, None], rows=wires, times=times, groups=groups)[:, 0]
    np.testing.assert_allclose(answers, expected, rtol=0, atol=1e-12)
    with pytest.raises(ValueError, match="group of each sample"):
        network.predict(u[:, None], groups=groups[1:])


@pytest.mark.parametrize("rows", [None, "wire"])
def test_a_saved_network_is_one_of_the_program(tmp_path, recorded, rows):
    """The program decodes with it and measures the same errors; the recording is found next to it."""
    train, test = (table.assign(wire=table.index % 2) for table in recorded)
    names = NAMES if rows is None else [*NAMES, rows]
    model = NetworkRegressor(4, epochs=15, rows=rows, intervals="always", random_state=0)
    model.fit(train[names], train[TARGETS], groups=train["press"])
    path = tmp_path / "network.json"
    samples = (train[names], train[TARGETS], test[names], test[TARGETS])
    with pytest.raises(ValueError, match="not those of fit"):
        model.save(path, samples[0], 1.0 + samples[1], *samples[2:], groups=train["press"])
    assert list(tmp_path.iterdir()) == []
    model.save(path, *samples, groups=train["press"])
    file = load_network(path)
    assert file.networks == model.network_.networks
    wires = None if rows is None else test["wire"]
    np.testing.assert_array_equal(file.predict(test[NAMES].to_numpy(), rows=wires), model.predict(test[names]))
    errors = file.metadata["scores"]["network"]["targets"]
    truth = test[TARGETS].to_numpy() - model.predict(test[names])
    np.testing.assert_allclose([error["mae"] for error in errors], np.abs(truth).mean(axis=0))
    done = program("export", "--network", "network.json", "--format", "numpy", "--out", "bundle", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    other = NetworkRegressor(epochs=2).fit(train[NAMES], train[TARGETS], validation=(test[NAMES], test[TARGETS]))
    with pytest.raises(ValueError, match="given to fit apart"):
        other.save(path, train[NAMES], train[TARGETS], test[NAMES], test[TARGETS])


def test_the_program_is_on_the_path():
    done = program("--version")
    assert done.returncode == 0 and done.stdout.startswith("decoupler ")
    wrong = program("train", "--hidden", "many")
    assert wrong.returncode == 2 and len(wrong.stderr.splitlines()) == 1
