"""Live decoding over a pseudo-terminal pair.

Usage: follow.py PROGRAM [SECONDS [ROWS]], where PROGRAM is the release build; SECONDS is the duration of the steady rate,
600 by default; ROWS is the number of row-wires in a line: 10, a whole frame of 300 resistances, by default, or 1. Trains the
network of the 10x10_5x30 array with 12 hidden nodes and prints Markdown tables: a steady 1000 lines per second, the same
with garbage in every tenth line, and the maximum rate of the terminal, also with a reader of the answers that is slower than
the program.
"""

import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
import tty

PROGRAM = pathlib.Path(sys.argv[1]).resolve()
SECONDS = float(sys.argv[2]) if len(sys.argv) > 2 else 600.0
ROWS = int(sys.argv[3]) if len(sys.argv) > 3 else 10
RATE = 1000


def resident_kib(process):
    return int(re.search(r"VmRSS:\s+(\d+)", pathlib.Path(f"/proc/{process.pid}/status").read_text())[1])


class Decoder:
    """The program at one end of a pseudo-terminal, and its answers."""

    def __init__(self, network, max_per_second=None):
        self.max_per_second = max_per_second
        self.master, slave = os.openpty()
        tty.setraw(self.master)
        tty.setraw(slave)
        command = [PROGRAM, "decode", "--network", network, "--follow", "--data", f"{os.ttyname(slave)}:115200"]
        # A shell makes its background processes ignore interrupts.
        listens = lambda: signal.signal(signal.SIGINT, signal.default_int_handler)
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, preexec_fn=listens)
        self.answers, self.last = 0, time.monotonic()
        self.warnings = []
        self.slave = slave
        threading.Thread(target=self.count, daemon=True).start()
        threading.Thread(target=self.listen, daemon=True).start()
        time.sleep(1.0)
        # The program may start to read in the middle of a line, so it skips the first line.
        self.send(b"the end of a line\n")

    def count(self):
        while chunk := os.read(self.process.stdout.fileno(), 1 << 16):
            answers = chunk.count(b"\n")
            self.answers += answers
            self.last = time.monotonic()
            if self.max_per_second:
                time.sleep(answers / self.max_per_second)

    def listen(self):
        for line in self.process.stderr:
            self.warnings.append(line.decode().strip())

    def send(self, data):
        view = memoryview(data)
        while view:
            view = view[os.write(self.master, view) :]

    def settle(self):
        """Waits until no more answers come."""
        while time.monotonic() - max(self.last, self.begun) < 1.0:
            time.sleep(0.05)

    def end(self):
        self.process.send_signal(signal.SIGINT)
        self.process.wait(20)
        time.sleep(0.2)
        # The first line of the output is the header.
        return self.answers - 1, [line for line in self.warnings if not line.startswith("warning")][-6:]


def steady(network, lines, seconds, garbage):
    decoder = Decoder(network)
    decoder.begun = time.monotonic()
    memory, sent, bad, late = [], 0, 0, 0.0
    while (due := decoder.begun + sent / RATE) < decoder.begun + seconds:
        late = max(late, time.monotonic() - due)
        while (wait := due - time.monotonic()) > 0:
            time.sleep(wait)
        is_bad = garbage and sent % 10 == 9
        decoder.send(b"12.5,\xff\x00garbage;;1e999,nan\n" if is_bad else lines[sent % len(lines)])
        bad += is_bad
        sent += 1
        if sent % (5 * RATE) == 0:
            memory.append(resident_kib(decoder.process))
    decoder.settle()
    memory.append(resident_kib(decoder.process))
    answered, report = decoder.end()
    name = "garbage in every tenth line" if garbage else "steady"
    print(f"| {name} | {seconds:.0f} | {sent} | {bad} | {answered} | {sent - bad - answered} | {memory[0]} to {memory[-1]} |")
    print(f"<!-- sender at most {1e3 * late:.0f} ms late; {' / '.join(report)} -->", flush=True)


def flood(network, lines, seconds, max_per_second):
    decoder = Decoder(network, max_per_second)
    decoder.begun = time.monotonic()
    block = b"".join(lines)
    memory, sent, gaps, before = [], 0, 0.0, decoder.answers
    while time.monotonic() < decoder.begun + seconds:
        decoder.send(block)
        sent += len(lines)
        gaps = max(gaps, time.monotonic() - decoder.last) if decoder.answers > 1 else 0.0
        memory.append(resident_kib(decoder.process))
    answered = decoder.answers - before
    decoder.settle()
    start, before = time.monotonic(), decoder.answers
    decoder.send(lines[0])
    while decoder.answers == before and time.monotonic() - start < 5:
        time.sleep(0.0005)
    alone = time.monotonic() - start
    memory.append(resident_kib(decoder.process))
    _, report = decoder.end()
    name = f"flood, answers taken at {max_per_second} per second" if max_per_second else "flood"
    print(f"| {name} | {seconds:.0f} | {sent} | {sent / seconds:.0f} | {answered / seconds:.0f} | {1e3 * gaps:.0f} | {1e3 * alone:.1f} | {memory[0]} to {memory[-1]} |")
    print(f"<!-- {' / '.join(report)} -->", flush=True)


with tempfile.TemporaryDirectory() as home:
    network, readings = pathlib.Path(home, "n.json"), pathlib.Path(home, "r.csv")
    quiet = {"check": True, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    subprocess.run([PROGRAM, "train", "--epochs", "60", "--decoder", "mean", "--out", network], **quiet)
    subprocess.run([PROGRAM, "simulate", "--samples", "200", "--seed", "3", "--out", readings], **quiet)
    rows = [line.split(",") for line in readings.read_text().splitlines()]
    columns = [rows[0].index(f"r_{k}") for k in range(1, 31)]
    values = [[f"{float(row[column]):.6f}" for column in columns] for row in rows[1:]]
    frames = [sum(values[row : row + ROWS], []) for row in range(0, len(values), ROWS)]
    lines = [(",".join(frame) + "\n").encode() for frame in frames]
    print("| lines | seconds | sent | bad | answered | lost | resident memory, KiB |\n|---|---|---|---|---|---|---|")
    steady(network, lines, SECONDS, garbage=False)
    steady(network, lines, min(SECONDS, 60.0), garbage=True)
    print("\n| lines | seconds | sent | sent per second | answered per second | longest gap, ms | single line after, ms | resident memory, KiB |")
    print("|---|---|---|---|---|---|---|---|")
    flood(network, lines, min(SECONDS, 30.0), None)
    flood(network, lines, min(SECONDS, 30.0), 2000)
