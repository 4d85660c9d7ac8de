"""Memory of the program while its window is minimised and a network trains: 10×32_5×96, 32 hidden nodes.

    python3 benches/interface/minimised.py target/release/decoupler [minutes]

Also needs wmctrl.
"""

import json
import os
import sys
import time

from screen import Window, shell


def main():
    binary = sys.argv[1]
    seconds = 60 * float(sys.argv[2] if len(sys.argv) > 2 else 10)
    kept = kept_at_closing(binary)
    draft = kept["draft"]
    draft["sensor"]["scale"] = "10×32_5×96"
    draft["hidden"] = 32
    draft["training"]["stopping"].update(epochs=100_000, max_fail=100_000, min_gradient=0.0)
    with Window(binary, lambda folder: keep(folder, kept)) as window:
        print_memory(window, "before the training")
        shell("xdotool", "key", "ctrl+Return")
        time.sleep(20)
        shell("xdotool", "search", "--onlyvisible", "--name", "^Decoupler$", "windowminimize")
        begun = time.monotonic()
        while (passed := time.monotonic() - begun) < seconds:
            print_memory(window, f"minimised for {passed:.0f} s")
            time.sleep(seconds / 10)
        print_memory(window, f"minimised for {passed:.0f} s")


def kept_at_closing(binary):
    """Returns the settings that the window saves when it is closed after the first start."""
    with Window(binary) as window:
        shell("wmctrl", "-c", "Decoupler")
        window.program.wait(10)
        with open(kept_file(window.scratch.name)) as file:
            return json.load(file)


def keep(folder, kept):
    os.makedirs(os.path.dirname(kept_file(folder)))
    with open(kept_file(folder), "w") as file:
        json.dump(kept, file)


def kept_file(folder):
    return f"{folder}/decoupler/window.json"


def print_memory(window, when):
    with open(f"/proc/{window.program.pid}/status") as file:
        status = dict(line.split(":", 1) for line in file)
    resident, own = (int(status[name].split()[0]) / 1024 for name in ("VmRSS", "RssAnon"))
    print(f"{when}: {resident:.0f} MiB resident, {own:.0f} MiB of them its own", flush=True)


if __name__ == "__main__":
    main()
