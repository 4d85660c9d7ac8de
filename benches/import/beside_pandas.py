"""Time and memory of reading a table of 1 000 000 rows and 30 columns, compared with pandas. Usage: beside_pandas.py PROGRAM FOLDER.

The file of 312 MB is made in FOLDER and removed again.
"""

import os
import pathlib
import random
import subprocess
import sys
import time

PROGRAM, PATH = sys.argv[1], pathlib.Path(sys.argv[2]) / "beside_pandas.csv"
ROWS, COLUMNS, BLOCK, REPEATS = 1_000_000, 30, 10_000, 3
PANDAS = f"import pandas; pandas.read_csv({str(PATH)!r})"


def measured(command):
    """Returns wall-clock and processor time in seconds, and the peak memory in MB."""
    begun = time.monotonic()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"failed: {command}")
    return time.monotonic() - begun, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1e3


random.seed(0)
number = lambda: f"{random.uniform(-100, 100):.6f}"
block = "".join(",".join(number() for _ in range(COLUMNS)) + "\n" for _ in range(BLOCK))
try:
    with open(PATH, "w") as file:
        file.write(",".join(f"x{column + 1}" for column in range(COLUMNS)) + "\n")
        for _ in range(ROWS // BLOCK):
            file.write(block)
    print(f"file {PATH.stat().st_size / 1e6:.0f} MB, array {8e-6 * ROWS * COLUMNS:.0f} MB")
    for _ in range(REPEATS):
        ours = [PROGRAM, "inspect", "--data", str(PATH), "--json"]
        for name, command in [("inspect", ours), ("pandas", [sys.executable, "-c", PANDAS])]:
            seconds, of_processor, megabytes = measured(command)
            print(f"{name:<8} {seconds:5.1f} s, {of_processor:4.1f} s of processor time, {megabytes:4.0f} MB", flush=True)
finally:
    PATH.unlink(missing_ok=True)
