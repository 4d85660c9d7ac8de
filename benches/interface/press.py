"""Time from a press of the mouse on the actual surface until the decoupled surface changes on the screen, and from a
movement of the pointer over the surface until the outline of what would press there is drawn.

    cargo build --release
    python3 benches/interface/press.py target/release/decoupler            # the small network answers, nothing trains
    python3 benches/interface/press.py target/release/decoupler training   # while a network trains

Needs Xvfb, openbox, xdotool and python3-xlib. The screen is read from Xvfb's own frame buffer, so that looking costs the
window nothing. A frame is a change of either card; that of the readings' worker or the training counts too.
"""

import mmap
import os
import random
import subprocess
import sys
import tempfile
import time

from Xlib import X, display
from Xlib.ext import xtest

WIDTH, HEIGHT = 1440, 900
DISPLAY = ":87"
PRESSES = 60
MOVEMENTS = 120
# Size of the pointer, in pixels.
POINTER = 24
# Left, right, top and bottom of what is watched, in pixels.
ACTUAL = (310, 610, 110, 560)
DECOUPLED = (660, 960, 110, 560)
# Where the surface is pressed.
PLACES = [(415, 200), (470, 215), (440, 225), (500, 200)]
# Changes of both cards within this time are of one frame, which is copied row by row.
ONE_FRAME_S = 0.004


def main():
    binary, trains = sys.argv[1], "training" in sys.argv[2:]
    scratch = tempfile.TemporaryDirectory()
    started = []

    def start(*command, **options):
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        started.append(subprocess.Popen(command, **quiet, **options))
        return started[-1]

    try:
        start("Xvfb", DISPLAY, "-screen", "0", f"{WIDTH}x{HEIGHT}x24", "-fbdir", scratch.name)
        time.sleep(1.5)
        os.environ["DISPLAY"] = DISPLAY
        start("openbox")
        time.sleep(1)
        measure(binary, trains, scratch.name, start)
    finally:
        for process in reversed(started):
            process.kill()
            process.wait()


def measure(binary, trains, folder, start):
    screen = Screen(f"{folder}/Xvfb_screen0")
    mouse = display.Display(DISPLAY)
    home = {name: folder for name in ("HOME", "XDG_DATA_HOME", "XDG_CONFIG_HOME")}
    environment = {**os.environ, **home, "LIBGL_ALWAYS_SOFTWARE": "1"}
    environment.pop("WAYLAND_DISPLAY", None)
    begun = time.perf_counter()
    start(binary, env=environment)
    middle = (0, WIDTH, 300, 600)
    while len(set(screen.pixels(middle)[::401])) < 4 and time.perf_counter() - begun < 60:
        time.sleep(0.002)
    print(f"first frame on the screen after {1e3 * (time.perf_counter() - begun):.0f} ms")
    time.sleep(3)
    window = shell("xdotool", "search", "--onlyvisible", "--name", "^Decoupler$").split()[0]
    shell("xdotool", "windowsize", window, str(WIDTH), str(HEIGHT), "windowmove", window, "0", "0")
    shell("xdotool", "windowactivate", window, "key", "Escape")
    time.sleep(2)
    print(f"changes of the screen in 10 s at rest: {changes(screen, 10)}")
    if trains:
        shell("xdotool", "key", "ctrl+Return")
        time.sleep(6)
    hovered = sorted(hover(screen, mouse, PLACES[number % len(PLACES)]) for number in range(MOVEMENTS))
    print(f"pointer to pixel, ms: {quantiles(hovered)}")
    xtest.fake_input(mouse, X.MotionNotify, x=PLACES[0][0], y=PLACES[0][1])
    click(mouse)
    time.sleep(2)
    times, frames = [], []
    for number in range(PRESSES):
        place = PLACES[(number + 1) % len(PLACES)]
        xtest.fake_input(mouse, X.MotionNotify, x=place[0], y=place[1])
        mouse.flush()
        time.sleep(0.3 + 0.1 * random.random())
        taken, seen = press(screen, mouse)
        times.append(taken)
        frames.append(seen)
        xtest.fake_input(mouse, X.ButtonRelease, 1)
        mouse.flush()
    times.sort()
    print(
        f"press to pixel, ms: {quantiles(times)}; "
        + ", ".join(f"{frames.count(n)} in frame {n}" for n in sorted(set(frames)))
    )
    if picture := os.environ.get("PICTURE"):
        shell("import", "-window", "root", picture)


def quantiles(times):
    quantile = lambda share: 1e3 * times[int(share * (len(times) - 1))]
    return f"p50 {quantile(0.5):.0f}, p95 {quantile(0.95):.0f}, max {quantile(1.0):.0f}"


def hover(screen, mouse, place):
    """Moves the pointer to a place of the actual surface; returns the time until the picture there changes, but for the
    pointer's own."""
    xtest.fake_input(mouse, X.MotionNotify, x=ACTUAL[0] + 20, y=ACTUAL[2] - 60)
    mouse.flush()
    time.sleep(0.3 + 0.1 * random.random())
    # Beside the pointer, where the body's outline is drawn.
    area = (ACTUAL[0], place[0] - POINTER, ACTUAL[2], ACTUAL[3])
    actual = screen.pixels(area)
    begun = time.perf_counter()
    xtest.fake_input(mouse, X.MotionNotify, x=place[0], y=place[1])
    mouse.flush()
    while time.perf_counter() - begun < 2:
        if screen.pixels(area) != actual:
            return time.perf_counter() - begun
    raise SystemExit("No outline is drawn under the pointer: is the window laid out otherwise?")


def press(screen, mouse):
    """Presses; returns the time until the decoupled surface changes, and in which frame after the press that is."""
    actual, decoupled = screen.pixels(ACTUAL), screen.pixels(DECOUPLED)
    begun = time.perf_counter()
    xtest.fake_input(mouse, X.ButtonPress, 1)
    mouse.flush()
    frames, changed = 0, None
    while time.perf_counter() - begun < 2:
        now = time.perf_counter()
        is_answered = screen.pixels(DECOUPLED) != decoupled
        other = screen.pixels(ACTUAL)
        if other != actual or is_answered:
            if changed is None or now - changed > ONE_FRAME_S:
                frames += 1
            actual, changed = other, now
        if is_answered:
            return now - begun, frames
    raise SystemExit("The decoupled surface never changed: is the window laid out otherwise?")


def changes(screen, seconds):
    """Counts how often the screen changes."""
    whole, count = (0, WIDTH, 0, HEIGHT), 0
    before, end = screen.pixels(whole), time.perf_counter() + seconds
    while time.perf_counter() < end:
        now = screen.pixels(whole)
        count += now != before
        before = now
        time.sleep(0.02)
    return count


def click(mouse):
    for kind in (X.ButtonPress, X.ButtonRelease):
        xtest.fake_input(mouse, kind, 1)
        mouse.flush()
        time.sleep(0.2)


def shell(*command):
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout


class Screen:
    """Xvfb's frame buffer, in the X window dump format."""

    def __init__(self, path):
        with open(path, "rb") as file:
            self.memory = mmap.mmap(file.fileno(), 0, prot=mmap.PROT_READ)
        word = lambda place: int.from_bytes(self.memory[place : place + 4], "big")
        self.begin = word(0) + 12 * word(76)
        self.line = word(48)

    def pixels(self, area):
        left, right, top, bottom = area
        rows = (self.begin + self.line * y for y in range(top, bottom))
        return b"".join(self.memory[row + 4 * left : row + 4 * right] for row in rows)


main()
