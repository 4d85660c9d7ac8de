"""A window on its own screen, controlled and watched by `press.py` and `experiments.py`.

Needs Xvfb, openbox, xdotool and python3-xlib. The screen is read from Xvfb's own frame buffer, which does not slow the
window down.
"""

import mmap
import os
import subprocess
import tempfile
import time

from Xlib import X, display
from Xlib.ext import xtest

WIDTH, HEIGHT = 1440, 900
DISPLAY = ":87"


class Window:
    """The program in a window that fills its own screen, with its own folder for settings and runs."""

    def __init__(self, binary, prepare=lambda folder: None):
        self.scratch = tempfile.TemporaryDirectory()
        self.started = []
        folder = self.scratch.name
        prepare(folder)
        self.start("Xvfb", DISPLAY, "-screen", "0", f"{WIDTH}x{HEIGHT}x24", "-fbdir", folder)
        time.sleep(1.5)
        os.environ["DISPLAY"] = DISPLAY
        self.start("openbox")
        time.sleep(1)
        self.screen = Screen(f"{folder}/Xvfb_screen0")
        self.display = display.Display(DISPLAY)
        home = {name: folder for name in ("HOME", "XDG_DATA_HOME", "XDG_CONFIG_HOME")}
        environment = {**os.environ, **home, "LIBGL_ALWAYS_SOFTWARE": "1"}
        environment.pop("WAYLAND_DISPLAY", None)
        begun = time.perf_counter()
        self.program = self.start(binary, env=environment)
        middle = (0, WIDTH, 300, 600)
        while len(set(self.screen.pixels(middle)[::401])) < 4 and time.perf_counter() - begun < 60:
            time.sleep(0.002)
        print(f"first frame on the screen after {1e3 * (time.perf_counter() - begun):.0f} ms")
        time.sleep(3)
        window = shell("xdotool", "search", "--onlyvisible", "--name", "^Decoupler$").split()[0]
        shell("xdotool", "windowsize", window, str(WIDTH), str(HEIGHT), "windowmove", window, "0", "0")
        shell("xdotool", "windowactivate", window, "key", "Escape")
        time.sleep(2)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for process in reversed(self.started):
            process.kill()
            process.wait()

    def start(self, *command, **options):
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        self.started.append(subprocess.Popen(command, **quiet, **options))
        return self.started[-1]

    def move(self, place):
        xtest.fake_input(self.display, X.MotionNotify, x=place[0], y=place[1])
        self.display.flush()

    def press(self):
        xtest.fake_input(self.display, X.ButtonPress, 1)
        self.display.flush()

    def release(self):
        xtest.fake_input(self.display, X.ButtonRelease, 1)
        self.display.flush()

    def click(self):
        self.press()
        time.sleep(0.2)
        self.release()
        time.sleep(0.2)

    def processor_ms(self):
        """Returns the processor time of the program's first thread, which draws the window, since its start."""
        process = self.program.pid
        with open(f"/proc/{process}/task/{process}/schedstat") as file:
            return 1e-6 * int(file.read().split()[0])

    def changes(self, seconds):
        """Counts how often the screen changes."""
        whole, count = (0, WIDTH, 0, HEIGHT), 0
        before, end = self.screen.pixels(whole), time.perf_counter() + seconds
        while time.perf_counter() < end:
            now = self.screen.pixels(whole)
            count += now != before
            before = now
            time.sleep(0.02)
        return count

    def until_changed(self, area, before, what):
        """Returns the time until the pixels of an area differ from `before`."""
        begun = time.perf_counter()
        while time.perf_counter() - begun < 2:
            if self.screen.pixels(area) != before:
                return time.perf_counter() - begun
        raise SystemExit(f"{what} never appeared: has the layout of the window changed?")

    def save_picture(self):
        """Saves the screen to the file that the environment variable PICTURE names, if it is set."""
        if picture := os.environ.get("PICTURE"):
            shell("import", "-window", "root", picture)


def shell(*command):
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout


def quantiles(times):
    times = sorted(times)
    quantile = lambda share: 1e3 * times[int(share * (len(times) - 1))]
    return f"p50 {quantile(0.5):.0f}, p95 {quantile(0.95):.0f}, max {quantile(1.0):.0f}"


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
