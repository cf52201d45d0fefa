"""Times and memory of two builds of armcal side by side, each command by turns in one run -> Markdown on stdout.

    python3 benches/ratios.py BEFORE NOW [ROUNDS] [--seeds 1..24] [--only NAME ...] [--benches BEFORE NOW]

Three rounds, from the root of the repository. --seeds: those of the campaign. --only: beginnings of commands' names. --benches: both builds'
`speed`, of which the parts in PARTS are timed.

BEFORE and NOW are programs, built alike. Seconds of a processor (user and system, all threads), of the clock, and the most memory: the
least of the rounds, for other load on the machine only adds. The recordings that both read are made by BEFORE. Unix.
"""

import argparse
import datetime
import os
import re
import subprocess
import tempfile
import time
from pathlib import Path

QUICKSTART = "routines/titan4-quickstart.toml"
# Benchmarks of `speed`; the estimate of criterion's.
PARTS = ["detect: eight tags, 1224 x 1024", "render: one image, half resolution", "dynamics: one step", "physics: one second, all effects"]
MICROSECONDS = {"ns": 1e-3, "µs": 1.0, "ms": 1e3, "s": 1e6}
# Refused and missed runs cost as much as others do.
ENDINGS = (0, 3, 4)


def commands(folder, seeds):
    """The words after the program by name; {out} is a fresh folder of each call."""
    run = ["run", QUICKSTART, "--out", "{out}/run"]
    calibrate = ["--robot", "robots/titan4", "--out", "{out}/calibrated"]
    return {
        "run, rapier's multibody": run,
        "run, own equations (featherstone)": [*run, "--set", "world.physics.engine=featherstone"],
        "run, images rendered": ["run", "routines/titan4-rendered.toml", "--out", "{out}/run"],
        f"campaign, seeds {seeds}, two threads": ["campaign", QUICKSTART, "--seeds", seeds, "--threads", "2", "--out", "{out}/rows.csv"],
        "plan": ["plan", QUICKSTART, "--out", "{out}/plan"],
        "calibrate, 30 views": ["calibrate", f"{folder}/30/run.mcap", *calibrate],
        "calibrate, 300 views": ["calibrate", f"{folder}/300/run.mcap", *calibrate],
        "replay": ["replay", f"{folder}/30/run.mcap", "--save", "{out}/run.rrd"],
    }


def record(program, folder):
    """The recordings that are read; 300 views are drawn and planned once."""
    sets = {"30": [], "300": ["--set", "capture.poses=300", "--set", "capture.criterion=random", "--set", "capture.replan_every=0"]}
    for name, words in sets.items():
        run = [program, "run", QUICKSTART, "--out", f"{folder}/{name}", *words]
        subprocess.run(run, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def measured(program, words):
    """Processor s, clock s, most memory MB."""
    with tempfile.TemporaryDirectory() as out:
        call = [program, *(word.replace("{out}", out) for word in words)]
        began = time.monotonic()
        process = subprocess.Popen(call, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        said = process.stderr.read()
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode not in ENDINGS:
        raise RuntimeError(f"{' '.join(call)}: {said.decode()}")
    return used.ru_utime + used.ru_stime, time.monotonic() - began, used.ru_maxrss / 1024


def timed(bench, part):
    """A benchmark's time, us."""
    words = [bench, "--bench", "--warm-up-time", "1", "--measurement-time", "3", "--noplot", f"^{re.escape(part)}$"]
    with tempfile.TemporaryDirectory() as home:
        said = subprocess.run(words, check=True, capture_output=True, text=True, env={**os.environ, "CRITERION_HOME": home}).stdout
    _, value, unit = re.search(r"time:\s+\[\S+ \S+ ((\S+) (\S+)) ", said).groups()
    return float(value) * MICROSECONDS[unit]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before", type=lambda text: str(Path(text).resolve()))
    parser.add_argument("now", type=lambda text: str(Path(text).resolve()))
    parser.add_argument("rounds", nargs="?", type=int, default=3)
    parser.add_argument("--seeds", default="1..24")
    parser.add_argument("--only", nargs="+", default=[""])
    parser.add_argument("--benches", nargs=2, default=[], type=lambda text: str(Path(text).resolve()))
    args = parser.parse_args()
    model = next((line.split(":", 1)[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")), "")
    print(f"{datetime.date.today()}, {os.cpu_count()} cores, {model}; load {os.getloadavg()[0]:.1f} at the start.\n")
    print("| command | processor s, before | now | ratio | clock s, before | now | ratio | memory MB, before | now |")
    print("|---|--:|--:|--:|--:|--:|--:|--:|--:|", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        chosen = {name: words for name, words in commands(folder, args.seeds).items() if name.startswith(tuple(args.only))}
        if any(word.startswith(folder) for words in chosen.values() for word in words):
            record(args.before, folder)
        for name, words in chosen.items():
            rounds = [[measured(program, words) for program in (args.before, args.now)] for _ in range(args.rounds)]
            before, now = ([min(figures) for figures in zip(*calls)] for calls in zip(*rounds))
            cells = [f"{b:.2f} | {n:.2f} | {n / b:.2f}" for b, n in zip(before[:2], now[:2])]
            print(f"| {name} | {' | '.join(cells)} | {before[2]:.0f} | {now[2]:.0f} |", flush=True)
    if args.benches:
        print("\n| part | us, before | now | ratio |\n|---|--:|--:|--:|", flush=True)
    for part in PARTS if args.benches else []:
        rounds = [[timed(bench, part) for bench in args.benches] for _ in range(args.rounds)]
        before, now = (min(times) for times in zip(*rounds))
        print(f"| {part} | {before:.2f} | {now:.2f} | {now / before:.2f} |", flush=True)


if __name__ == "__main__":
    main()
