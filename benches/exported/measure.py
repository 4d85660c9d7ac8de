"""Time per frame of 10 row-wires of exported networks, and size and instructions of the fixed-point decoder on ARM.

Usage: measure.py PROGRAM, where PROGRAM is the release build; needs onnxruntime, gcc, for the sizes arm-none-eabi-gcc, and for
the instructions qemu-system-arm as well. Prints Markdown tables.
"""

import csv
import itertools
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time

import numpy as np
import onnxruntime

HERE = pathlib.Path(__file__).parent
PROGRAM = pathlib.Path(sys.argv[1]).resolve()
NETWORKS = {"paper": "--epochs 60", "known": "--preset best --noise 1e-3 --samples 2000 --epochs 60"}


def run(*command):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}")
    return done.stdout


def frame(home, name):
    """Returns the readings of one frame in ohm: 10 x 30."""
    run(PROGRAM, "simulate", "--samples", 10, "--seed", 3, "--out", home / f"{name}.csv")
    with open(home / f"{name}.csv") as file:
        lines = list(csv.DictReader(file))
    return np.array([[float(line[f"r_{k}"]) for k in range(1, 31)] for line in lines])


def time_c(home, name, precision, folder, readings, scale):
    header = next(folder.glob("*_decode.h"))
    prefix = header.name.removesuffix("_decode.h")
    text = header.read_text()
    kind = re.search(r"const (\w+) resistances_\w+\[", text)[1]
    coordinates = re.search(r"\w+ (coordinates_\w+)\[", text)[1]
    (home / "readings.txt").write_text(" ".join(f"{value * scale:.17g}" for value in readings.flat))
    flags = [f'-DHEADER="{header.name}"', f"-DBUNDLE={prefix}", f"-DREADING={kind}", f"-DCOORDINATES={coordinates}"]
    if "int row" in text:
        flags.append("-DTAKES_ROW")
    program = home / f"{name}_{precision}"
    run("gcc", "-std=c99", "-O2", f"-I{folder}", *flags, HERE / "frame.c", folder / f"{prefix}_decode.c", "-lm", "-o", program)
    return float(run(program, home / "readings.txt"))


def time_onnx(folder, readings, precision, takes_row):
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    session = onnxruntime.InferenceSession(folder / "network.onnx", options)
    inputs = {"resistances_ohm": readings.astype(np.float32 if precision == "f32" else np.float64)}
    if takes_row:
        inputs["row"] = np.arange(1, 11)
    best = np.inf
    for _ in range(25):
        start = time.perf_counter()
        for _ in range(200):
            session.run(["coordinates_mm"], inputs)
        best = min(best, (time.perf_counter() - start) / 200)
    return 1e6 * best


def arm_size(folder, cpu):
    """Returns flash of the decoder with the arithmetic that the processor lacks, static memory, and stack of the decoder."""
    source, image = next(folder.glob("*_decode.c")), folder / f"{cpu}.elf"
    prefix = source.name.removesuffix("_decode.c")
    call = f"{prefix}_decode({'1, ' if 'int row' in source.read_text() else ''}(const int32_t *)0x20000000, ({prefix}_answer *)0x20001000)"
    main = folder / "main.c"
    main.write_text(f'#include "{source.stem}.h"\nint main(void)\n{{\n    return {call};\n}}\n')
    flags = [f"-mcpu=cortex-{cpu}", "-mthumb", "-std=c99", "-Os", "-ffunction-sections", "-fstack-usage"]
    link = ["-nostartfiles", "-Wl,--gc-sections,-e,main", "--specs=nosys.specs"]
    run("arm-none-eabi-gcc", *flags, "-c", source, "-o", folder / f"{cpu}.o")
    run("arm-none-eabi-gcc", *flags, *link, main, folder / f"{cpu}.o", "-o", image)
    text, data, bss, *_ = run("arm-none-eabi-size", image).splitlines()[1].split()
    usage = dict(line.split(":")[-1].split("\t")[:2] for line in (folder / f"{cpu}.su").read_text().splitlines())
    own = int(usage.pop(f"{prefix}_decode"))
    return int(text) + int(data), int(data) + int(bss), own + max(map(int, usage.values()), default=0)


def arm_instructions(folder, cpu, optimisation, readings, scale):
    """Returns the instructions for a row-wire, and the last z_1 in nm, on an emulated processor that takes 1 ns for each."""
    source, image = next(folder.glob("*_decode.c")), folder / f"{cpu}{optimisation}.elf"
    rows = ", ".join("{" + ", ".join(str(round(value * scale)) for value in row) + "}" for row in readings)
    sizes = f"#define ROWS {len(readings)}\n"
    (folder / "readings.h").write_text(f"{sizes}static const int32_t readings[ROWS][{len(readings[0])}] = {{{rows}}};\n")
    flags = [f"-mcpu=cortex-{cpu}", "-mthumb", "-std=c99", optimisation, f"-I{folder}", f'-DHEADER="{source.stem}.h"']
    flags.append(f"-DBUNDLE={source.name.removesuffix('_decode.c')}")
    if "int row" in source.read_text():
        flags.append("-DTAKES_ROW")
    link = ["-nostartfiles", "-ffunction-sections", "-Wl,--gc-sections", f"-Wl,-T,{HERE / 'instructions.ld'}"]
    run("arm-none-eabi-gcc", *flags, *link, "--specs=nosys.specs", HERE / "instructions.c", source, "-o", image)
    machine = ["qemu-system-arm", "-machine", "mps2-an386", "-icount", "shift=0", "-kernel", image]
    quiet = ["-nographic", "-monitor", "none", "-serial", "none", "-semihosting-config", "enable=on,target=native"]
    # Output of the emulated program to its host is on standard error.
    output = subprocess.run([str(part) for part in machine + quiet], capture_output=True, text=True, timeout=300).stderr
    return tuple(map(int, output.split()))


with tempfile.TemporaryDirectory() as home:
    home = pathlib.Path(home)
    times, sizes, instructions = [], [], []
    for name, arguments in NETWORKS.items():
        network = home / f"{name}.json"
        report = json.loads(run(PROGRAM, "train", *arguments.split(), "--decoder", "network", "--out", network, "--json"))
        for decoder, figures in report["decoders"].items():
            times.append((name, f"this program, {decoder}", figures["frame_us"]))
        readings = frame(home, name)
        for form in ["c99", "onnx"]:
            for precision in ["f64", "f32", "fixed16"] if form == "c99" else ["f64", "f32"]:
                folder = home / f"{name}_{form}_{precision}"
                command = [PROGRAM, "export", "--network", network, "--format", form, "--precision", precision]
                run(*command, "--out", folder)
                takes_row = json.loads((folder / "metadata.json").read_text())["takes_row"]
                if form == "onnx":
                    label = f"onnxruntime {onnxruntime.__version__}, {precision}"
                    times.append((name, label, time_onnx(folder, readings, precision, takes_row)))
                    continue
                header = next(folder.glob("*.h")).read_text()
                unit = re.search(r"resistances_(nano|micro|milli)?ohm", header)[1]
                scale = {"nano": 1e9, "micro": 1e6, "milli": 1e3, None: 1.0}[unit]
                times.append((name, f"C, gcc -O2, {precision}", time_c(home, name, precision, folder, readings, scale)))
                if precision == "fixed16" and shutil.which("arm-none-eabi-gcc"):
                    sizes += [(name, f"Cortex-{cpu.upper()}", *arm_size(folder, cpu)) for cpu in ["m0", "m4"]]
                    if shutil.which("qemu-system-arm"):
                        for cpu, optimisation in itertools.product(["m0", "m4"], ["-Os", "-O2"]):
                            counted = arm_instructions(folder, cpu, optimisation, readings, scale)
                            instructions.append((name, f"Cortex-{cpu.upper()}", optimisation, *counted))
    print("| network | decoder | µs per frame |\n|---|---|---|")
    for name, decoder, microseconds in times:
        print(f"| {name} | {decoder} | {microseconds:.2f} |")
    print("\n| network | processor | flash, bytes | static RAM, bytes | stack, bytes |\n|---|---|---|---|---|")
    for row in sizes:
        print("| " + " | ".join(map(str, row)) + " |")
    print("\n| network | processor | compiled with | instructions per row-wire | z_1 of the last row-wire, nm |\n|---|---|---|---|---|")
    for row in instructions:
        print("| " + " | ".join(map(str, row)) + " |")
