"""Time from a press of the mouse on the actual surface until the decoupled surface changes on the screen, and from a
movement of the pointer over the surface until the outline of the pressing body is drawn there. Without a training, also the
processor time of the window's thread for such a movement, which depends less on the load of the machine than the other times.

    cargo build --release
    python3 benches/interface/press.py target/release/decoupler            # the small network answers, nothing trains
    python3 benches/interface/press.py target/release/decoupler training   # while a network trains

Its requirements are listed in `screen.py`. A frame is a change of either card, including changes by the readings' worker or the
training.
"""

import random
import sys
import time

from screen import Window, quantiles, shell

PRESSES = 60
MOVEMENTS = 120
COSTED_MOVEMENTS = 300
# Size of the pointer, in pixels.
POINTER = 24
# Left, right, top and bottom of the watched areas, in pixels.
ACTUAL = (310, 610, 110, 560)
DECOUPLED = (660, 960, 110, 560)
# Positions where the surface is pressed.
PLACES = [(415, 200), (470, 215), (440, 225), (500, 200)]
# Changes of both cards within this time are of one frame, which is copied row by row.
ONE_FRAME_S = 0.004


def measure(window, trains):
    print(f"changes of the screen in 10 s at rest: {window.changes(10)}")
    if trains:
        shell("xdotool", "key", "ctrl+Return")
        time.sleep(6)
    else:
        print(f"processor time of the window's thread per movement, ms: {cost(window):.1f}")
    hovered = [hover(window, PLACES[number % len(PLACES)]) for number in range(MOVEMENTS)]
    print(f"pointer to pixel, ms: {quantiles(hovered)}")
    window.move(PLACES[0])
    window.click()
    time.sleep(2)
    times, frames = [], []
    for number in range(PRESSES):
        window.move(PLACES[(number + 1) % len(PLACES)])
        time.sleep(0.3 + 0.1 * random.random())
        taken, seen = press(window)
        times.append(taken)
        frames.append(seen)
        window.release()
    print(
        f"press to pixel, ms: {quantiles(times)}; "
        + ", ".join(f"{frames.count(n)} in frame {n}" for n in sorted(set(frames)))
    )
    window.save_picture()


def cost(window):
    """Moves the pointer over the actual surface; returns the mean processor time of the window's thread, in ms."""
    begun = window.processor_ms()
    for number in range(COSTED_MOVEMENTS):
        window.move((PLACES[0][0] + 7 * number % 120, PLACES[0][1] + 3 * number % 60))
        time.sleep(0.05)
    return (window.processor_ms() - begun) / COSTED_MOVEMENTS


def hover(window, place):
    """Moves the pointer to a place of the actual surface; returns the time until the picture there changes, apart from the
    pointer itself."""
    window.move((ACTUAL[0] + 20, ACTUAL[2] - 60))
    time.sleep(0.3 + 0.1 * random.random())
    # Next to the pointer, where the body's outline is drawn.
    area = (ACTUAL[0], place[0] - POINTER, ACTUAL[2], ACTUAL[3])
    before = window.screen.pixels(area)
    window.move(place)
    return window.until_changed(area, before, "The outline under the pointer")


def press(window):
    """Presses; returns the time until the decoupled surface changes, and in which frame after the press that is."""
    screen = window.screen
    actual, decoupled = screen.pixels(ACTUAL), screen.pixels(DECOUPLED)
    begun = time.perf_counter()
    window.press()
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
    raise SystemExit("The decoupled surface never changed: has the layout of the window changed?")


with Window(sys.argv[1]) as window:
    measure(window, "training" in sys.argv[2:])
