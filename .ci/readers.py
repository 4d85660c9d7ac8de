"""Exports decoders in every format and precision and runs the printed programs. Usage: readers.py PROGRAM FOLDER.

Deviations are relative to the widest range of a coordinate in training or, for a recording, to the range of each target. The
reference is the program itself: its `decode` on 3000 readings that it simulated, or on a recording with groups, pauses and a
clock that starts again, and the golden answers of each bundle.
"""

import csv
import importlib.util
import json
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
    # These amplify rounding errors, and say so.
    "long": "--epochs 300",
    "sharp": "--preset best --samples 1000 --epochs 100",
}
# Other decoders that are exported, as "network:decoder".
OTHERS = ["paper:ridge", "paper:linear", "paper:rbf", "paper:mean", "known:ridge", "known:rbf", "own:ridge", "own:rbf"]
# Trained on recordings: readings of any sign, targets of very different magnitudes; a history with groups, pauses and row-wires.
RECORDINGS = ["own", "past", "pastrows"]
FLAGS = "-std=c99 -O2 -Wall -Wextra -Werror -pedantic -Wconversion".split()
failures = []


def file_of(name):
    return name.partition(":")[0]


def decoder_of(name):
    return name.partition(":")[2] or "network"


def run(*command, **options):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, **options)
    if done.returncode:
        raise RuntimeError(f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}")
    return done.stdout


def show(name, bundle, reader, found, limit, note=""):
    passed = found <= limit
    if not passed:
        failures.append(f"{name} {bundle} {reader}")
    print(f"{name:<12} {bundle:<14} {reader:<22} {found:8.1e} {limit:8.1e} {note} {'' if passed else 'FAILED'}".rstrip(), flush=True)


class Bundle:
    """A bundle with its golden readings."""

    def __init__(self, name, form, precision):
        self.name, self.form, self.precision = name, form, precision
        self.folder = HOME / file_of(name) / f"{decoder_of(name)}_{form}_{precision}"
        command = [PROGRAM, "export", "--network", HOME / file_of(name) / "network.json", "--format", form]
        command += ["--decoder", decoder_of(name), "--precision", precision, "--out", self.folder, "--json"]
        self.report = json.loads(run(*command))
        self.metadata = json.loads((self.folder / "metadata.json").read_text())
        self.scale = np.array(self.metadata.get("output_ranges", self.metadata.get("output_range_mm")))
        with open(self.folder / "golden.csv") as file:
            lines = list(csv.DictReader(file))
        column = lambda key: np.array([float(line[key]) for line in lines])
        read = lambda part: np.column_stack([column(key) for key in self.metadata[part]["names"]])
        self.has_history = bool(self.metadata.get("memory"))
        rows = column("row").astype(np.int64) if self.metadata["takes_row"] else None
        series = (column("new_series"), column("time_s")) if self.has_history else (None, None)
        self.golden = Samples(read("inputs"), rows, *series, read("outputs"))

    @property
    def prefix(self):
        return next(self.folder.glob("*_decode.h")).stem[: -len("_decode")]

    def check(self, reader, answer, samples):
        """Compares `answer`, a function of Samples, with the golden answers and those of the program."""
        limit = self.report["limit"]
        for what, given in [("golden", self.golden), ("caller", samples)]:
            if given is None:
                continue
            answers = np.asarray(answer(given), dtype=float)
            found = float(np.max(np.abs(answers - given.expected) / self.scale))
            bounds = self.report.get("error_bounds", [])
            note = ", ".join(f"{bound['bound']:.2g} {bound['unit']}" for bound in bounds)
            show(self.name, f"{self.form} {self.precision}", f"{reader}, {what}", found, limit, note)


class Samples:
    """Readings with row numbers, the series that begin, times, and the expected targets."""

    def __init__(self, readings, rows, new, times, expected):
        self.readings, self.rows, self.new, self.times, self.expected = readings, rows, new, times, expected


def check_onnx(bundle, samples):
    import onnx
    import onnxruntime

    path = next(bundle.folder.glob("*.onnx"))
    model = onnx.load(path)
    onnx.checker.check_model(model, full_check=True)
    assert {"outputs", "decoder", "verification"} <= {entry.key for entry in model.metadata_props}
    session = onnxruntime.InferenceSession(path)
    kind = np.float32 if bundle.precision == "f32" else np.float64
    taken, given = session.get_inputs()[0].name, session.get_outputs()[0].name

    def inputs(part, some):
        every = {taken: part.readings[some].astype(kind)}
        if part.rows is not None:
            every["row"] = part.rows[some]
        return every

    def answer(part):
        if not bundle.has_history:
            return session.run([given], inputs(part, slice(None)))[0]
        shape = next(value.shape for value in session.get_inputs() if value.name == "state")
        states, found = {}, []
        for k, series in enumerate(series_of(part)):
            every = {**inputs(part, slice(k, k + 1)), "time_s": part.times[k].reshape(1, 1), "state": states.get(series, np.zeros(shape))}
            targets, states[series] = session.run([given, "next_state"], every)
            found.append(targets[0])
        return np.array(found)

    bundle.check(f"onnxruntime {onnxruntime.__version__}", answer, samples)
    if bundle.has_history:
        return
    # Invalid readings and rows give NaN.
    bad = inputs(bundle.golden, slice(None))
    bad[taken][0, -1] = np.inf
    answers = session.run([given], bad)[0]
    assert np.isnan(answers[0]).all() and not np.isnan(answers[1:]).any()
    if bundle.golden.rows is not None:
        rows = bundle.golden.rows
        answers = session.run([given], {**inputs(bundle.golden, slice(None)), "row": np.where(rows == 1, 0, rows)})[0]
        assert np.isnan(answers[rows == 1]).all() and not np.isnan(answers[rows != 1]).any()


def series_of(part):
    """A key for the state that each sample continues: its series and row-wire."""
    starts = np.cumsum(part.new).astype(int) if part.new.dtype == float else part.new
    rows = np.zeros(len(starts), int) if part.rows is None else part.rows
    return list(zip(starts.tolist(), rows.tolist()))


def main_in_c(bundle):
    """A program that reads lines of (state, time, row, readings) and prints the targets."""
    name, upper = bundle.prefix, bundle.prefix.upper()
    header = (bundle.folder / f"{name}_decode.h").read_text()
    targets = re.search(r"\w+ (\w+)\[\w+_OUTPUTS\];", header).group(1)
    kind = re.search(r"const (\w+) \w+\[\w+_CHANNELS\]", header).group(1)
    row = "row, " if bundle.metadata["takes_row"] else ""
    call = f"{name}_step(&states[state], {row}time_s, readings, &answer)" if bundle.has_history else f"{name}_decode({row}readings, &answer)"
    states = f"static {name}_state states[1000];" if bundle.has_history else ""
    start = f"for (int k = 0; k < 1000; ++k) {{ {name}_start(&states[k]); }}" if bundle.has_history else ""
    return f"""#include "{name}_decode.h"
#include <stdio.h>
{states}
int main(void)
{{
    {name}_answer answer;
    double time_s, reading;
    int state, row;
    {kind} readings[{upper}_CHANNELS];
    {start}
    while (scanf("%d %lf %d", &state, &time_s, &row) == 3) {{
        (void)state;
        (void)row;
        for (int i = 0; i < {upper}_CHANNELS; ++i) {{
            if (scanf("%lf", &reading) != 1) {{ return 1; }}
            readings[i] = ({kind})reading;
        }}
        if ({call} != {upper}_OK) {{ return 2; }}
        for (int k = 0; k < {upper}_OUTPUTS; ++k) {{ printf("%.17g ", (double)answer.{targets}[k]); }}
        puts("");
    }}
    return 0;
}}
"""


def check_c(bundle, samples):
    name = bundle.prefix
    source = (bundle.folder / f"{name}_decode.c").read_text()
    header = (bundle.folder / f"{name}_decode.h").read_text()
    units = (1.0, 1.0)
    if bundle.precision == "fixed16":
        # The decoder has no floating-point code, so that it needs no library on processors without a floating-point unit.
        assert not re.search(r"\b(float|double)\b", source)
        listed = [re.search(rf"{part}_UNITS {{ (.*) }}", header) for part in ["READING", "TARGET"]]
        if all(listed):
            units = tuple(np.array([float(unit) for unit in found.group(1).split(",")]) for found in listed)
        else:
            decimals = {"nanoohm": 1e-9, "microohm": 1e-6, "milliohm": 1e-3, "ohm": 1.0}
            units = (decimals[re.search(r"resistances_(\w+)\[", header).group(1)], 1e-6)
    (bundle.folder / "stream.c").write_text(main_in_c(bundle))
    for compiler, level in [("gcc", "-O2"), ("clang", "-O0")]:
        run(compiler, *FLAGS, level, *[bundle.folder / f"{name}_{part}.c" for part in ["decode", "selftest"]], "-lm", "-o", bundle.folder / "selftest")
        run(bundle.folder / "selftest")
        run(compiler, *FLAGS, level, bundle.folder / "stream.c", bundle.folder / f"{name}_decode.c", "-lm", "-o", bundle.folder / "stream")

        def answer(part):
            count = len(part.readings)
            readings = np.round(part.readings / units[0]) if bundle.precision == "fixed16" else part.readings
            keys = {}
            states = [keys.setdefault(key, len(keys)) for key in series_of(part)] if bundle.has_history else [0] * count
            times = part.times if bundle.has_history else np.zeros(count)
            rows = np.ones(count, int) if part.rows is None else part.rows
            lines = (f"{s} {t:.17g} {r} " + " ".join(f"{x:.17g}" for x in line) for s, t, r, line in zip(states, times, rows, readings))
            text = run(bundle.folder / "stream", input="\n".join(lines))
            return np.array([[float(word) for word in line.split()] for line in text.splitlines()]) * units[1]

        bundle.check(f"{compiler} {level}", answer, samples if bundle.precision != "fixed16" else None)
    run("g++", "-fsyntax-only", "-x", "c++", bundle.folder / f"{name}_decode.h")
    run("gcc", *FLAGS, "-c", bundle.folder / f"{name}_decode.c", "-o", bundle.folder / "decode.o")
    symbols = run("nm", bundle.folder / "decode.o")
    assert not re.search(r" [dDbBC] ", symbols), f"mutable global data:\n{symbols}"
    assert not re.search(r"malloc|calloc", symbols), symbols


def check_octave(bundle, samples):
    function = next(bundle.folder.glob("*.m")).stem

    def answer(part):
        row = ", rows" if part.rows is not None else ""
        np.savetxt(bundle.folder / "readings.txt", part.readings, fmt="%.17g")
        np.savetxt(bundle.folder / "rows.txt", np.ones(1) if part.rows is None else part.rows, fmt="%d")
        load = "r = load('readings.txt'); rows = load('rows.txt'); "
        if bundle.has_history:
            keys = {}
            states = np.array([keys.setdefault(key, len(keys) + 1) for key in series_of(part)])
            np.savetxt(bundle.folder / "series.txt", np.column_stack([states, part.times]), fmt="%.17g")
            # Each series in two calls, the second from the state of the first.
            call = f"[a, ~, s] = {function}(r(of, :), t(of, 2), s{row + '(of)' if row else ''});"
            if not bundle_has_outside(bundle):
                call = call.replace("~, ", "")
            script = (
                load + f"t = load('series.txt'); all = zeros(size(r, 1), {part.expected.shape[1]}); "
                "for k = 1:max(t(:, 1)), s = []; mine = find(t(:, 1) == k); half = ceil(numel(mine) / 2); "
                f"for of = {{mine(1:half), mine(half + 1:end)}}, of = of{{1}}; {call} all(of, :) = a; end, end; "
            )
        else:
            script = load + f"all = {function}(r{row}); "
        run("octave-cli", "--no-gui", "--quiet", "--eval", script + "dlmwrite('answers.txt', all, 'precision', '%.17g');", cwd=bundle.folder)
        return np.loadtxt(bundle.folder / "answers.txt", delimiter=",", ndmin=2).reshape(part.expected.shape)

    bundle.check("GNU Octave", answer, samples)
    if not bundle.has_history:
        bad = f"try, {function}(Inf * ones(1, {bundle.golden.readings.shape[1]}){', 1' if bundle.metadata['takes_row'] else ''}); disp('accepted'), catch e, disp(e.message), end"
        assert "finite numbers" in run("octave-cli", "--no-gui", "--quiet", "--eval", bad, cwd=bundle.folder)


def bundle_has_outside(bundle):
    return "readings_outside" in next(bundle.folder.glob("*.m")).read_text()


def check_numpy(bundle, samples):
    spec = importlib.util.spec_from_file_location(f"decode_{abs(hash(bundle.folder))}", bundle.folder / "decode.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)

    def answer(part):
        if not bundle.has_history:
            answers = module.decode(part.readings, *([] if part.rows is None else [part.rows]))
            return answers[0] if isinstance(answers, tuple) else answers
        states, found = {}, []
        for k, series in enumerate(series_of(part)):
            row = [] if part.rows is None else [part.rows[k]]
            *answers, states[series] = module.decode(part.readings[k : k + 1], part.times[k], states.get(series), *row)
            assert answers[0].dtype == (np.float32 if bundle.precision == "f32" else np.float64)
            found.append(answers[0][0])
        return np.array(found)

    bundle.check(f"NumPy {np.__version__}", answer, samples)
    if not bundle.has_history:
        try:
            module.decode(bundle.golden.readings * np.inf, *([] if bundle.golden.rows is None else [bundle.golden.rows]))
        except ValueError:
            return
        failures.append(f"{bundle.name} numpy {bundle.precision}: invalid readings are accepted")


def train_on_own_data():
    """Trains on a recording whose names contain characters that end a comment or a cell."""
    rng = np.random.default_rng(0)
    force, torque = rng.uniform(-2e3, 2e3, 500), rng.uniform(-1e-3, 1e-3, 500)
    readings = [force + 1e5 * torque, 1e4 * torque - force / 500, force * torque, 5 + rng.normal(0, 0.1, 500)]
    names = ["hall, a (µT)", "b */ x", 'c """ y', "d"]
    path = HOME / "own" / "readings.csv"
    with open(path, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([*names, "force (N)", "torque (N·m)"])
        writer.writerows(np.column_stack([*readings, force, torque]).tolist())
    recipe = {"data": "readings.csv", "inputs": ["hall, a", *names[1:]], "targets": ["force", "torque"]}
    document = {"format": "decoupler recipe", "version": 1, "program": "", "source": {"recording": {"import": recipe}}}
    (HOME / "own" / "recipe.json").write_text(json.dumps(document))
    run(PROGRAM, "train", "--recipe", HOME / "own" / "recipe.json", "--epochs", 40, "--out", HOME / "own" / "network.json", "--json")
    decoded = decoded_columns("own", path, ["force", "torque"])
    return Samples(np.column_stack(readings), None, None, None, decoded)


def decoded_columns(name, path, targets, *options):
    """The answers of the program to a file."""
    out = HOME / name / "decoded.csv"
    run(PROGRAM, "decode", "--network", HOME / name / "network.json", "--data", path, "--out", out, *options)
    with open(out) as file:
        lines = list(csv.DictReader(file))
    find = lambda target: next(key for key in lines[0] if key.split(" (")[0] == target)
    return np.array([[float(line[find(target)]) for target in targets] for line in lines])


def train_on_series(name):
    """A creeping sensor in two interleaved groups, with pauses and a clock that starts again; perhaps of three row-wires."""
    rng = np.random.default_rng(1)
    count = 3000
    steps = rng.uniform(0.005, 0.015, count)
    steps[[700, 1900]] = 30.0
    times = np.cumsum(steps)
    times[1300:] -= times[1300] - 1.0
    group = (np.arange(count) // 3) % 2
    rows = np.arange(count) % 3 + 1 if name == "pastrows" else np.ones(count, int)
    force = np.sin(0.8 * np.cumsum(np.minimum(steps, 0.1))) + np.sin(0.023 * np.arange(count) ** 1.1)
    crept = np.zeros(count)
    for k in range(1, count):
        crept[k] = crept[k - 1] + (1 - np.exp(-min(steps[k], 1.0))) * (force[k] - crept[k - 1])
    readings = np.column_stack([(0.4 + 0.1 * rows) * (force + crept), force - 0.3 * crept**2])
    path = HOME / name / "data.csv"
    columns = np.column_stack([times, group, rows, readings, force])
    np.savetxt(path, columns, delimiter=",", header="t,press,row,a,b,force", comments="", fmt="%.17g")
    arguments = ["--data", path, "--time", "t", "--group", "press", "--inputs", "a,b", "--targets", "force"]
    arguments += ["--history", "0.1s,1s,50", "--lags", "3,0.2s", "--differences"]
    training = ["--hidden", 4, "--starts", 1, "--epochs", 20]
    if name == "pastrows":
        arguments += ["--row-wire", "row"]
        training += ["--rows", "known"]
    recipe = HOME / name / "recipe.json"
    run(PROGRAM, "inspect", *arguments, "--recipe-out", recipe)
    run(PROGRAM, "train", "--recipe", recipe, *training, "--out", HOME / name / "network.json", "--json")
    decoded = decoded_columns(name, path, ["force"])
    return Samples(readings, rows if name == "pastrows" else None, group, times, decoded)


def simulated(name):
    """3000 readings of the scene of a network, with the answers of the program."""
    path = HOME / name / "readings.csv"
    run(PROGRAM, "simulate", "--samples", 3000, "--seed", 9, "--out", path)
    with open(path) as file:
        lines = list(csv.DictReader(file))
    channels = [key for key in lines[0] if re.fullmatch(r"r_\d+", key)]
    readings = np.array([[float(line[key]) for key in channels] for line in lines])
    # One row-wire each, as decode reports it.
    rows = np.array([int(line["row"]) for line in lines]) if "--preset best" in NETWORKS[name] else None
    nodes = sum(key.startswith("z_") for key in lines[0])
    targets = [f"{axis}_{node + 1}" for node in range(nodes) for axis in "xyz"]
    return Samples(readings, rows, None, None, decoded_columns(name, path, targets))


CHECKS = {"onnx": check_onnx, "numpy": check_numpy, "c99": check_c, "matlab": check_octave}


def check_all(name, samples):
    for form, check in CHECKS.items():
        for precision in {"c99": ["f64", "f32", "fixed16"], "matlab": ["f64"]}.get(form, ["f64", "f32"]):
            try:
                bundle = Bundle(name, form, precision)
            except RuntimeError as error:
                reason = str(error).strip().splitlines()[-1]
                expected = ["cannot resolve the readings", "fixed16", "fixed point"]
                if not any(words in reason for words in expected):
                    raise
                print(f"{name:<12} {form} {precision}: refused: {reason}", flush=True)
                continue
            check(bundle, samples)


print(f"{'net':<12} {'bundle':<14} {'reader':<22} {'found':>8} {'limit':>8}")
for network, arguments in [*NETWORKS.items(), *((name, None) for name in RECORDINGS)]:
    (HOME / network).mkdir()
    if network == "own":
        caller = train_on_own_data()
    elif network in RECORDINGS:
        caller = train_on_series(network)
    else:
        run(PROGRAM, "train", *arguments.split(), "--out", HOME / network / "network.json", "--json")
        caller = simulated(network)
    check_all(network, caller)
for network in OTHERS:
    check_all(network, None)
if failures:
    sys.exit("failed: " + ", ".join(failures))
