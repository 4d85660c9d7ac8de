"""Writes `tactile_array.ipynb` from `tactile_array.py`, whose cells begin with `# %%`; `--check` only compares."""

import json
import sys
from pathlib import Path

SCRIPT = Path(__file__).with_name("tactile_array.py")
NOTEBOOK = SCRIPT.with_suffix(".ipynb")


def cell(text: str, number: int) -> dict[str, object]:
    """Return a cell, whose first line says of which kind it is."""
    heading, _, body = text.partition("\n")
    is_markdown = heading.strip() == "[markdown]"
    lines = body.strip().splitlines(keepends=True)
    if is_markdown:
        lines = [line.removeprefix("#").removeprefix(" ") for line in lines]
        return {"cell_type": "markdown", "id": f"cell-{number}", "metadata": {}, "source": lines}
    return {
        "cell_type": "code",
        "execution_count": None,
        "id": f"cell-{number}",
        "metadata": {},
        "outputs": [],
        "source": lines,
    }


def notebook() -> str:
    """Return the text of the notebook."""
    cells = SCRIPT.read_text(encoding="utf-8").split("# %%")[1:]
    document = {
        "cells": [cell(text, number) for number, text in enumerate(cells)],
        "metadata": {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}},
        "nbformat": 4,
        "nbformat_minor": 5,
    }
    return json.dumps(document, indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    if "--check" not in sys.argv:
        NOTEBOOK.write_text(notebook(), encoding="utf-8")
    elif NOTEBOOK.read_text(encoding="utf-8") != notebook():
        sys.exit("the notebook differs from the script: run python/examples/notebook.py")
