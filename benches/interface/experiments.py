"""The window while the experiment of Table 1 trains on all cores: time from a movement of the pointer until a button is
highlighted, frames per second while a column is resized, time from Cancel until Run is enabled again.

    cargo build --release
    python3 benches/interface/experiments.py target/release/decoupler

Its requirements are listed in `screen.py`.
"""

import json
import math
import os
import random
import sys
import time

from screen import Window, quantiles, shell

MOVEMENTS = 60
FRAMES_S = 10.0
CANCELS = 10
# Position where the pointer highlights the button Search, and an area of it next to the pointer: left, right, top and bottom,
# in pixels.
SEARCH = (1334, 42)
SEARCH_EDGE = (1300, 1308, 34, 52)
# Position of the edge of the left column, how far it is dragged, and the headings that move with it, in pixels.
EDGE = (272, 700)
DRAWN = 120
HEADINGS = (280, 1000, 90, 130)
# The button Run, which is watched, and Cancel, which is pressed.
RUN = (16, 130, 410, 432)
CANCEL = (200, 422)


def show_experiments(folder):
    os.makedirs(f"{folder}/decoupler")
    with open(f"{folder}/decoupler/window.json", "w") as file:
        json.dump({"has_toured": True, "view": "Study"}, file)


def measure(window):
    shell("xdotool", "key", "ctrl+Return")
    time.sleep(5)
    print(f"pointer to pixel, ms: {quantiles([hover(window) for _ in range(MOVEMENTS)])}")
    print(f"frames per second while a column is resized: {frames(window) / FRAMES_S:.0f}")
    print(f"Cancel to Run, ms: {quantiles([cancel(window) for _ in range(CANCELS)])}")
    window.save_picture()


def hover(window):
    """Moves the pointer to a button; returns the time until the button is highlighted."""
    window.move((EDGE[0] + 200, EDGE[1]))
    time.sleep(0.2 + 0.1 * random.random())
    before = window.screen.pixels(SEARCH_EDGE)
    window.move(SEARCH)
    return window.until_changed(SEARCH_EDGE, before, "The highlight of the button")


def frames(window):
    """Resizes the left column for `FRAMES_S` seconds; returns how often the headings next to it move."""
    window.move(EDGE)
    time.sleep(0.5)
    window.press()
    begun, count, before = time.perf_counter(), 0, window.screen.pixels(HEADINGS)
    while (now := time.perf_counter() - begun) < FRAMES_S:
        drawn = DRAWN * 0.5 * (1 - math.cos(2 * math.pi * now / 2.0))
        window.move((round(EDGE[0] + drawn), EDGE[1]))
        after = window.screen.pixels(HEADINGS)
        count += after != before
        before = after
        # A mouse reports its position about 200 times per second.
        time.sleep(0.005)
    window.move(EDGE)
    time.sleep(0.5)
    window.release()
    return count


def cancel(window):
    """Presses Cancel; returns the time from its release until Run is enabled again. Then restarts the experiment."""
    window.move(CANCEL)
    time.sleep(1 + random.random())
    before = window.screen.pixels(RUN)
    window.press()
    time.sleep(0.05)
    window.release()
    taken = window.until_changed(RUN, before, "The end of the experiment")
    time.sleep(0.5)
    shell("xdotool", "key", "ctrl+Return")
    time.sleep(2)
    return taken


with Window(sys.argv[1], show_experiments) as window:
    measure(window)
