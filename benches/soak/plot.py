"""Draws the table of `.ci/soak` as a picture: python plot.py soak.csv soak.svg (needs matplotlib)."""

import csv
import sys

import matplotlib

matplotlib.use("svg")
matplotlib.rcParams.update({"svg.hashsalt": "soak", "font.size": 9, "axes.spines.top": False, "axes.spines.right": False})
from matplotlib import pyplot  # noqa: E402

COLOUR = "#3b6fb5"
SECOND = "#c46a1b"


def main(table: str, picture: str) -> None:
    with open(table, newline="") as lines:
        rows = [{name: float(cell) for name, cell in row.items()} for row in csv.DictReader(lines)]
    minutes = [row["seconds"] / 60 for row in rows]
    figure, (memory, response, frame, counts) = pyplot.subplots(4, 1, sharex=True, figsize=(7.2, 6.8), layout="constrained")
    memory.plot(minutes, [row["memory_mb"] for row in rows], color=COLOUR)
    memory.set_ylabel("resident memory, MB")
    response.plot(minutes, [row["response_ms"] for row in rows], ".", color=COLOUR, markersize=4)
    response.set_ylabel("key to picture, ms")
    frame.plot(minutes, [row["frame_ms"] for row in rows], color=COLOUR, label="median")
    frame.plot(minutes, [row["frame_p95_ms"] for row in rows], color=SECOND, linestyle="--", label="95 % within")
    frame.set_ylabel("between frames, ms")
    frame.legend(frameon=False, ncols=2, loc="center right")
    counts.plot(minutes, [row["threads"] for row in rows], color=COLOUR, label="threads")
    counts.plot(minutes, [row["descriptors"] for row in rows], color=SECOND, linestyle="--", label="open files")
    counts.set_ylabel("number")
    counts.legend(frameon=False, ncols=2, loc="lower right")
    counts.set_xlabel("minutes of training, pressing, live decoding and saving")
    for axes in (memory, response, frame, counts):
        axes.set_ylim(bottom=0)
        axes.grid(alpha=0.3)
    figure.savefig(picture, metadata={"Date": None})


if __name__ == "__main__":
    main(*sys.argv[1:])
