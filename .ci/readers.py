"""Exports networks and other decoders and checks the bundles with the programs that read them. Usage: readers.py PROGRAM FOLDER.

Deviations are relative to the widest range of a coordinate in training or, for a recording, to the range of each target. The
reference is golden.csv of each bundle and, for more samples, the bundle in double precision for NumPy.
"""

import csv
import importlib.util
import json
import os
import pathlib
import re
import subprocess
import sys

import numpy as np

PROGRAM, HOME = sys.argv[1], pathlib.Path(sys.argv[2])
NETWORKS = {
    "paper": "--epochs 60",
    "known": "--preset best --noise 1e-3 --samples 2000 --epochs 60",
    "log": "--inputs log --epochs 40",
    # These amplify rounding errors: in single precision their hidden sums are computed in double precision, and in double
    # precision the limit is the one that the program computes and prints.
    "long": "--epochs 300",
    "sharp": "--preset best --samples 1000 --epochs 100",
}
AMPLIFYING = {"long", "sharp"}
# Other decoders that are exported, as "network:decoder".
LAYERED = ["paper:ridge", "paper:linear", "paper:rbf", "paper:mean", "known:ridge", "known:rbf"]
# Trained on a recording: readings of any sign, targets of very different magnitudes.
OWN = "own"
LAYERED += [f"{OWN}:{decoder}" for decoder in ["ridge", "rbf"]]
LIMITS = {"f64": 1e-12, "f32": 1e-5}
FLAGS = "-std=c99 -O2 -Wall -Wextra -Werror -pedantic -Wconversion".split()
failures = []


def limit_of(network, precision, report):
    usual = LIMITS.get(precision, report["limit"])
    if precision == "f32":
        # The golden readings are in double precision, and rounding them to single precision changes the answers.
        usual += max(report["change_by_rounding_readings"].values())
    if decoder_of(network) == "network":
        return max(usual, report["limit"]) if network in AMPLIFYING and precision == "f64" else usual
    return max(usual, report["limit"])


def file_of(network):
    return network.partition(":")[0]


def decoder_of(network):
    return network.partition(":")[2] or "network"


def stem(network):
    return "network" if decoder_of(network) == "network" else "decoder"


def run(*command, **options):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, **options)
    if done.returncode:
        raise RuntimeError(f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}")
    return done.stdout


class Refused(RuntimeError):
    """The network cannot be exported in this precision."""


def show(network, bundle, reader, deviation, limit, note=""):
    passed = deviation <= limit
    if not passed:
        failures.append(f"{network} {bundle} {reader}")
    verdict = "" if passed else "FAILED"
    print(f"{network:<12} {bundle:<12} {reader:<34} {deviation:8.1e} {limit:8.1e} {note} {verdict}".rstrip(), flush=True)


def export(network, form, precision):
    folder = HOME / file_of(network) / f"{decoder_of(network)}_{form}_{precision}"
    command = [PROGRAM, "export", "--network", HOME / file_of(network) / "network.json", "--format", form]
    command += ["--decoder", decoder_of(network)]
    try:
        report = json.loads(run(*command, "--precision", precision, "--out", folder, "--json"))
    except RuntimeError as error:
        if "cannot resolve the readings" not in str(error):
            raise
        raise Refused(str(error).splitlines()[-1])
    return folder, report


def golden(folder):
    """Returns readings, outputs, and rows if they are arguments."""
    metadata = json.loads((folder / "metadata.json").read_text())
    with open(folder / "golden.csv") as file:
        lines = list(csv.DictReader(file))
    names = list(lines[0])
    table = np.array([[float(line[name]) for name in names] for line in lines])
    columns = lambda what: [names.index(name) for name in metadata[what]["names"]]
    rows = table[:, 0].astype(np.int64) if metadata["takes_row"] else None
    return table[:, columns("inputs")], table[:, columns("outputs")], rows


def deviation(folder, answers, expected):
    metadata = json.loads((folder / "metadata.json").read_text())
    width = np.array(metadata["output_ranges"] if "output_ranges" in metadata else metadata["output_range_mm"])
    return float(np.max(np.abs(np.asarray(answers, dtype=float) - expected) / width))


def check_onnx(network, precision):
    import onnx
    import onnxruntime

    folder, report = export(network, "onnx", precision)
    limit = limit_of(network, precision, report)
    path = folder / f"{stem(network)}.onnx"
    model = onnx.load(path)
    onnx.checker.check_model(model, full_check=True)
    names = {entry.key: entry.value for entry in model.metadata_props}
    if file_of(network) == OWN:
        assert json.loads(names["outputs"]) == {"names": ["force", "torque"], "units": ["N", "N·m"]}, names
        assert "torque (N·m)" in model.graph.output[0].doc_string
    else:
        assert names["array"] == "10×10_5×30" and json.loads(names["geometry"])["height_mm"] == 5, names
    session = onnxruntime.InferenceSession(path)
    readings, expected, rows = golden(folder)
    kind = np.float32 if precision == "f32" else np.float64
    taken, given = session.get_inputs()[0].name, session.get_outputs()[0].name
    assert (taken, given) == (("readings", "targets") if file_of(network) == OWN else ("resistances_ohm", "coordinates_mm"))
    inputs = {taken: readings.astype(kind)}
    if rows is not None:
        inputs["row"] = rows
    coordinates, outside = session.run([given, "readings_outside"], inputs)
    show(network, f"onnx {precision}", f"onnxruntime {onnxruntime.__version__}", deviation(folder, coordinates, expected), limit)
    assert outside.shape == (len(readings),), outside.shape
    # Invalid readings give NaN.
    bad = {**inputs, taken: inputs[taken].copy()}
    bad[taken][0, 3] = np.nan if decoder_of(network) == "mean" else np.inf if file_of(network) == OWN else -1
    answers = session.run([given], bad)[0]
    assert np.isnan(answers[0]).all() and not np.isnan(answers[1:]).any()
    if rows is not None:
        answers = session.run([given], {**inputs, "row": np.where(rows == 1, 0, rows)})[0]
        assert np.isnan(answers[rows == 1]).all() and not np.isnan(answers[rows != 1]).any()
    # emx-onnx-cgen 1.3.5 and 1.4.0 miscompile graphs of Gaussians; onnxruntime agrees on these up to rounding.
    if decoder_of(network) == "network":
        check_onnx_to_c(network, precision, limit, folder, inputs, coordinates)


def check_onnx_to_c(network, precision, limit, folder, inputs, coordinates):
    """Checks C code that an independent compiler generates from the same graph."""
    if importlib.util.find_spec("emx_onnx_cgen") is None:
        print(f"{network:<12} onnx {precision}     emx-onnx-cgen is not installed: not checked")
        return
    import ctypes
    import onnx

    # The compiler needs a fixed batch size: that of the golden vectors.
    model = onnx.load(folder / f"{stem(network)}.onnx")
    for value in [*model.graph.input, *model.graph.output]:
        value.type.tensor_type.shape.dim[0].dim_value = len(coordinates)
    onnx.save(model, folder / "fixed_batch.onnx")
    source, library = folder / "emx.c", folder / "emx.so"
    try:
        run(sys.executable, "-m", "emx_onnx_cgen", "compile", folder / "fixed_batch.onnx", source, "--model-name", "emx")
        run("gcc", "-O2", "-shared", "-fPIC", source, "-lm", "-o", library)
    except RuntimeError as error:
        print(f"{network:<12} onnx {precision}     emx-onnx-cgen cannot compile it: {str(error).splitlines()[-1]}")
        return
    declaration = re.search(r"void emx\(([^;{]*)\)", source.read_text()).group(1)
    answers, outside = np.zeros_like(coordinates), np.zeros(len(coordinates), np.int64)
    output = model.graph.output[0].name
    arrays = {output: answers, "readings_outside": outside, **inputs}
    names = re.findall(r"(\w+)(?:\[[^\]]*\])+\s*(?:,|$)", declaration)
    pointers = [np.ascontiguousarray(arrays[name]).ctypes.data_as(ctypes.c_void_p) for name in names]
    ctypes.CDLL(str(library)).emx(*pointers)
    _, expected, _ = golden(folder)
    show(network, f"onnx {precision}", "emx-onnx-cgen, gcc", deviation(folder, answers, expected), limit)


def check_c(network, precision):
    try:
        folder, report = export(network, "c99", precision)
    except Refused:
        raise
    except RuntimeError as error:
        if precision != "fixed16":
            raise
        print(f"{network:<12} c99 {precision}  refused: {str(error).splitlines()[-1]}")
        return
    limit = limit_of(network, precision, report)
    sources = sorted(folder.glob("*.c"))
    for compiler in ["gcc", "clang"]:
        for optimisation in ["-O0", "-O2"]:
            run(compiler, *FLAGS, optimisation, *sources, "-lm", "-o", folder / "selftest")
            found = re.search(r"largest deviation: (\S+)", run(folder / "selftest"))
            note = ""
            if "error_bound_mm" in report:
                note = f"bound {report['error_bound_mm']:.2g} mm"
            elif "error_bounds" in report:
                note = "bounds " + ", ".join(f"{bound['bound']:.2g} {bound['unit']}" for bound in report["error_bounds"])
            show(network, f"c99 {precision}", f"{compiler} {optimisation}", float(found.group(1)), limit, note)
    run("g++" if precision != "fixed16" else "gcc", "-fsyntax-only", "-x", "c++", folder / next(folder.glob("*.h")).name)
    symbols = run("gcc", *FLAGS, "-c", next(folder.glob("*_decode.c")), "-o", folder / "decode.o") + run("nm", folder / "decode.o")
    assert not re.search(r" [dDbBC] ", symbols), f"mutable global data:\n{symbols}"
    assert not re.search(r"malloc|calloc", symbols), symbols
    if precision == "fixed16":
        # The decoder has no floating-point code, so that it needs no library on processors without a floating-point unit.
        assert not re.search(r"\b(float|double)\b", next(folder.glob("*_decode.c")).read_text())


def check_octave(network):
    folder, report = export(network, "matlab", "f64")
    readings, expected, rows = golden(folder)
    np.savetxt(folder / "readings.txt", readings, fmt="%.17g")
    row = ""
    if rows is not None:
        np.savetxt(folder / "rows.txt", rows, fmt="%d")
        row = ", load('rows.txt')"
    function = next(folder.glob("*.m")).stem
    script = f"[c, o] = {function}(load('readings.txt'){row}); dlmwrite('answers.txt', [c o], 'precision', '%.17g');"
    run("octave-cli", "--no-gui", "--quiet", "--eval", script, cwd=folder)
    answers = np.loadtxt(folder / "answers.txt", delimiter=",", ndmin=2)
    show(network, "matlab f64", "GNU Octave", deviation(folder, answers[:, :-1], expected), limit_of(network, "f64", report))
    value = "Inf" if file_of(network) == OWN or decoder_of(network) == "mean" else "-1"
    bad = f"try, {function}({value} * ones(1, {readings.shape[1]}){', 1' if row else ''}); disp('accepted'), catch e, disp(e.message), end"
    assert "finite numbers" in run("octave-cli", "--no-gui", "--quiet", "--eval", bad, cwd=folder)


def check_numpy(network, precision):
    folder, report = export(network, "numpy", precision)
    readings, expected, rows = golden(folder)
    spec = importlib.util.spec_from_file_location(f"decode_{network.replace(':', '_')}_{precision}", folder / "decode.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    coordinates, _ = module.decode(readings, *([] if rows is None else [rows]))
    assert coordinates.dtype == (np.float32 if precision == "f32" else np.float64)
    show(network, f"numpy {precision}", f"NumPy {np.__version__}", deviation(folder, coordinates, expected), limit_of(network, precision, report))
    try:
        module.decode(readings * np.inf if file_of(network) == OWN or decoder_of(network) == "mean" else -readings, *([] if rows is None else [rows]))
    except ValueError:
        return
    failures.append(f"{network} numpy {precision}: invalid readings are accepted")


def check_json(network):
    folder, _ = export(network, "json", "f64")
    for name, path in [("a", HOME / network / "network.json"), ("b", folder)]:
        run(PROGRAM, "decode", "--network", path, "--input", HOME / network / "readings.csv", "--output", HOME / network / f"{name}.csv")
    assert (HOME / network / "a.csv").read_bytes() == (HOME / network / "b.csv").read_bytes()
    show(network, "json f64", "decode", 0.0, 0.0)


def train_on_own_data():
    """Trains on a recording whose names contain characters that end a comment or a cell."""
    rng = np.random.default_rng(0)
    force, torque = rng.uniform(-2e3, 2e3, 500), rng.uniform(-1e-3, 1e-3, 500)
    readings = [force + 1e5 * torque, 1e4 * torque - force / 500, force * torque, 5 + rng.normal(0, 0.1, 500)]
    names = ["hall, a (µT)", "b */ x", 'c """ y', "d"]
    path = HOME / OWN / "readings.csv"
    with open(path, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([*names, "force (N)", "torque (N·m)"])
        writer.writerows(np.column_stack([*readings, force, torque]).tolist())
    recipe = {"data": "readings.csv", "inputs": ["hall, a", *names[1:]], "targets": ["force", "torque"]}
    document = {"format": "decoupler recipe", "version": 1, "program": "", "source": {"recording": {"import": recipe}}}
    (HOME / OWN / "recipe.json").write_text(json.dumps(document))
    run(PROGRAM, "train", "--recipe", HOME / OWN / "recipe.json", "--epochs", 40, "--out", HOME / OWN / "network.json", "--json")


STREAM = """#include "c99_decode.h"
#include "c99_memory.h"
#include <stdio.h>
int main(void)
{
    c99_memory memory;
    c99_memory_init(&memory);
    double interval_s, readings[C99_READINGS], features[C99_FEATURES], targets[C99_OUTPUTS];
    for (int line = 0; scanf("%lf", &interval_s) == 1; ++line) {
        for (int i = 0; i < C99_READINGS; ++i) {
            if (scanf("%lf", &readings[i]) != 1) { return 1; }
        }
        c99_memory copy = memory;
        c99_memory_step(&copy, readings, interval_s, features);
        memory = copy;
        if (c99_decode(features, targets) != C99_OK) { return 2; }
        printf("%.17g\\n", targets[0]);
    }
    return 0;
}
"""


def check_memory():
    """Decodes 10 000 frames of a creeping sensor with the state of each bundle, stored and continued in the middle."""
    import onnxruntime

    home = HOME / "memory"
    home.mkdir()
    rng = np.random.default_rng(1)
    frames, cut = 10_000, 5_000
    times = np.cumsum(rng.uniform(0.005, 0.015, frames))
    force = np.sin(0.8 * times) + np.sin(0.23 * times**1.1)
    crept = np.zeros(frames)
    for k in range(1, frames):
        crept[k] = crept[k - 1] + (1 - np.exp(-(times[k] - times[k - 1]))) * (force[k] - crept[k - 1])
    readings = np.column_stack([0.5 * (force + crept), force - 0.3 * crept**2])
    np.savetxt(home / "data.csv", np.column_stack([times, readings, force]), delimiter=",", header="t,a,b,force", comments="", fmt="%.17g")
    data = ["--data", home / "data.csv", "--time", "t", "--inputs", "a,b", "--targets", "force"]
    memory = ["--memory", "0.1s,1s,50", "--lags", "3,0.2s", "--differences"]
    run(PROGRAM, "train", *data, *memory, "--hidden", 4, "--starts", 1, "--epochs", 20, "--out", home / "network.json", "--json")
    run(PROGRAM, "decode", "--network", home / "network.json", "--input", home / "data.csv", "--output", home / "decoded.csv")
    with open(home / "decoded.csv") as file:
        expected = np.array([float(line["force"]) for line in csv.DictReader(file)])
    intervals = np.diff(times, prepend=times[0])
    scale = np.ptp(force)
    report = lambda reader, found: show("memory", "f64", reader, float(np.max(np.abs(found - expected)) / scale), LIMITS["f64"])
    folders = {}
    for form in ["c99", "numpy", "onnx", "matlab"]:
        folders[form] = home / form
        run(PROGRAM, "export", "--network", home / "network.json", "--format", form, "--out", folders[form])

    sys.path.insert(0, str(folders["numpy"]))
    decode, state = importlib.import_module("decode"), importlib.import_module("memory").Memory()
    features = []
    for k in range(frames):
        if k == cut:
            state = type(state)(state.state.copy())
        features.append(state.step(readings[k], intervals[k]))
    report(f"NumPy {np.__version__}", decode.decode(np.array(features))[0][:, 0])

    (folders["c99"] / "stream.c").write_text(STREAM)
    sources = [folders["c99"] / name for name in ["stream.c", "c99_decode.c", "c99_memory.c"]]
    run("gcc", *FLAGS, *sources, "-lm", "-o", folders["c99"] / "stream")
    lines = "".join(f"{interval:.17g} {a:.17g} {b:.17g}\n" for interval, (a, b) in zip(intervals, readings))
    report("gcc", np.array(run(folders["c99"] / "stream", input=lines).split(), dtype=float))

    session, kept, found = onnxruntime.InferenceSession(folders["onnx"] / "stream.onnx"), None, []
    shape = next(value.shape for value in session.get_inputs() if value.name == "state")
    kept = np.zeros(shape)
    for k in range(frames):
        if k == cut:
            session = onnxruntime.InferenceSession(folders["onnx"] / "stream.onnx")
        inputs = {"readings": readings[k : k + 1], "interval_s": intervals[k].reshape(1, 1), "state": kept}
        targets, kept = session.run(["targets", "next_state"], inputs)
        found.append(targets[0, 0])
    report(f"onnxruntime {onnxruntime.__version__}", np.array(found))

    np.savetxt(folders["matlab"] / "frames.txt", np.column_stack([intervals, readings]), fmt="%.17g")
    script = (
        f"d = load('frames.txt'); n = {cut}; [f, s] = matlab_memory(d(1:n, 2:end), d(1:n, 1), []); "
        "g = matlab_memory(d(n + 1:end, 2:end), d(n + 1:end, 1), s); "
        "dlmwrite('answers.txt', matlab_decode([f; g]), 'precision', '%.17g');"
    )
    run("octave-cli", "--no-gui", "--quiet", "--eval", script, cwd=folders["matlab"])
    report("GNU Octave", np.loadtxt(folders["matlab"] / "answers.txt"))


def check_layers(network):
    """Checks all formats of a decoder that consists of layers."""
    for precision in ["f64", "f32"]:
        for check, form in [(check_onnx, "onnx"), (check_numpy, "numpy"), (check_c, "c99")]:
            try:
                check(network, precision)
            except Refused as error:
                print(f"{network:<12} {form} {precision}  refused: {error}", flush=True)
    check_octave(network)


print(f"{'net':<12} {'bundle':<12} {'reader':<34} {'found':>8} {'limit':>8}")
for network, arguments in [*NETWORKS.items(), (OWN, None)]:
    (HOME / network).mkdir()
    if network == OWN:
        train_on_own_data()
    else:
        run(PROGRAM, "train", *arguments.split(), "--out", HOME / network / "network.json", "--json")
        run(PROGRAM, "simulate", "--samples", 100, "--seed", 9, "--out", HOME / network / "readings.csv")
    check_layers(network)
    check_c(network, "fixed16")
    check_json(network)
for network in LAYERED:
    check_layers(network)
check_memory()
if failures:
    sys.exit("failed: " + ", ".join(failures))
