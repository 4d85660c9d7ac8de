"""Cross-validates recordings of few, noisy samples next to scikit-learn's ridge. Usage: measured.py PROGRAM FOLDER.

R² is over all samples, each predicted by a model fitted without its fold, and averaged over seeds: with 20 samples in random
folds, R² varies by 0.1 from seed to seed (standard deviation), so the mean of fewer seeds could not resolve a margin of 0.03.
scikit-learn's ridge has standardised inputs and a penalty chosen by its own cross-validation.
"""

import json
import pathlib
import subprocess
import sys

import numpy as np
from sklearn.datasets import load_diabetes, load_linnerud
from sklearn.linear_model import RidgeCV
from sklearn.metrics import r2_score
from sklearn.model_selection import KFold, cross_val_predict
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

PROGRAM, HOME = sys.argv[1], pathlib.Path(sys.argv[2])
FOLDS, SEEDS, MARGIN = 10, 20, 0.03
failures = []


def sklearn_ridge(inputs, targets):
    model = make_pipeline(StandardScaler(), RidgeCV(np.logspace(-3, 4, 30)))
    folds = (KFold(FOLDS, shuffle=True, random_state=seed) for seed in range(SEEDS))
    answers = (cross_val_predict(model, inputs, targets, cv=split) for split in folds)
    return np.mean([r2_score(targets, answer, multioutput="raw_values") for answer in answers], axis=0)


def cross_validated(path, inputs, targets, seed):
    columns = ["--inputs", f"x1..x{inputs}", "--targets", ",".join(f"y{target + 1}" for target in range(targets))]
    command = [PROGRAM, "train", "--data", path, *columns, "--split", "random", "--folds", FOLDS, "--seed", seed, "--json"]
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(done.stderr)
    return json.loads(done.stdout)


print(f"{'set':<10} {'target':<7} {'network':>8} {'ridge':>8} {'mean':>8} {'named':>8} {'sklearn':>8}  named as better")
for name, load in [("diabetes", load_diabetes), ("linnerud", load_linnerud)]:
    data = load()
    targets = data.target.reshape(len(data.target), -1)
    path = HOME / f"{name}.csv"
    names = [f"x{k + 1}" for k in range(data.data.shape[1])] + [f"y{k + 1}" for k in range(targets.shape[1])]
    table = np.hstack([data.data, targets])
    np.savetxt(path, table, delimiter=",", fmt="%.17g", comments="", header=",".join(names))
    limit = sklearn_ridge(data.data, targets)
    reports = [cross_validated(path, data.data.shape[1], targets.shape[1], seed) for seed in range(SEEDS)]
    for target in range(targets.shape[1]):
        of = lambda report, row: (report["targets"] if row == "network" else report["baselines"][row])[target]["r2"]
        means = {row: np.mean([of(report, row) for report in reports]) for row in ["network", "ridge", "mean"]}
        # The model that the program names as better; it reports networks that are no better than ridge.
        better = [report["better"][target] for report in reports]
        row_of = {"training mean": "mean"}
        named = np.mean([of(report, row_of.get(row, row)) for report, row in zip(reports, better)])
        words = ", ".join(f"{better.count(row)} x {row}" for row in sorted(set(better)))
        print(f"{name:<10} y{target + 1:<6} {means['network']:8.3f} {means['ridge']:8.3f} {means['mean']:8.3f} {named:8.3f} {limit[target]:8.3f}  {words}")
        if named < limit[target] - MARGIN:
            failures.append(f"{name} y{target + 1}: {named:.3f} is below scikit-learn's ridge, {limit[target]:.3f}")
        if means["network"] < limit[target] - MARGIN:
            failures.append(f"{name} y{target + 1}: the network has {means['network']:.3f}, scikit-learn's ridge {limit[target]:.3f}")
        # If the readings predict nothing, the network can be better than ridge by chance; then a warning says so.
        no_better, nothing = f"no better than ridge for y{target + 1} ", f"explains almost nothing of y{target + 1} "
        hardly, uncertain = f"little better than ridge for y{target + 1} ", f"uncertain how much of y{target + 1} the network explains"
        is_said = [any(words in report_said for words in [no_better, hardly, nothing, uncertain])
                   for report_said in ("\n".join(report["warnings"]) for report in reports)]
        if not all(is_said):
            failures.append(f"{name} y{target + 1}: {is_said.count(False)} of {SEEDS} seeds do not warn that the network is no better than ridge")
if failures:
    sys.exit("failed: " + "; ".join(failures))
