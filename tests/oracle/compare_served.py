"""The same routine and seed directly and through `serve` over ROS 2: views and results side by side, as a table.

usage: compare_served.py ARMCAL ROUTINE OUT [--seeds 1 2 3 4 5] [--factor 1] [--at-once 5] [--run-more WORDS]
ARMCAL is a build with `--features live`. Each pair has a network namespace of its own, for which root or user namespaces
are needed. OUT gets a folder for each seed. Differences are those of gain and offset, in standard deviations of a
difference between two independent calibrations.
"""

import argparse
import json
import re
import subprocess
import tomllib
from concurrent.futures import ThreadPoolExecutor
from math import hypot
from pathlib import Path

NAMESPACE = 'ip link set lo up multicast on && ip route add 239.0.0.0/8 dev lo && exec bash -c "$@"'
SCRIPT = """
$ARMCAL serve $ROUTINE --arm arm.toml --set seed=$SEED --factor $FACTOR --truth truth.mcap 2>serve.log & SERVER=$!
$TIMED $ARMCAL drive $ROUTINE --arm arm.toml --unattended --out served $MORE >served.log 2>&1; CODE=$?
kill -INT $SERVER; wait $SERVER
$ARMCAL run $ROUTINE --seed $SEED --out direct >direct.log 2>&1 && exit $CODE
"""
# Processor seconds and the most memory of what is run, into usage.json.
TIMED = """import json, os, resource, subprocess, sys
code = subprocess.call(sys.argv[1:])
used = resource.getrusage(resource.RUSAGE_CHILDREN)
json.dump({"cpu_s": used.ru_utime + used.ru_stime, "rss_mb": used.ru_maxrss / 1024}, open("usage.json", "w"))
sys.exit(code)
"""


def run_pair(args, seed):
    folder = args.out.resolve() / str(seed)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "arm.toml").write_text('version = 1\nkind = "arm"\nnetworks = ["127.0.0.1"]\n')
    (folder / "timed.py").write_text(TIMED)
    values = {"ARMCAL": args.armcal.resolve(), "ROUTINE": args.routine.resolve(), "SEED": seed, "FACTOR": args.factor,
              "TIMED": "python3 timed.py", "MORE": args.run_more}
    head = "".join(f"{key}={str(value)!r}\n" for key, value in values.items())
    command = ["unshare", "-rn", "--pid", "--fork", "--kill-child", "bash", "-c", NAMESPACE, "netns", head + SCRIPT]
    done = subprocess.run(command, cwd=folder, check=False)
    return folder if done.returncode == 0 else None


def joints(folder):
    with open(folder / "calibration.toml", "rb") as file:
        return {joint["name"]: joint for joint in tomllib.load(file)["joint"]}


def largest_difference(folder):
    a, b = joints(folder / "direct"), joints(folder / "served")
    pairs = [("offset_rad", "offset_std_rad"), ("gain_rad_per_count", "gain_std_rad_per_count")]
    return max(abs(a[name][value] - b[name][value]) / hypot(a[name][std], b[name][std])
               for name in a for value, std in pairs if a[name].get(std) and b[name].get(std))


def row(folder):
    direct, served = (json.loads((folder / kind / "summary.json").read_text()) for kind in ("direct", "served"))
    said = (folder / "served.log").read_text()
    latency = re.search(r"median ([\d.]+) ms, 99 % within ([\d.]+) ms", said)
    usage = json.loads((folder / "usage.json").read_text())
    both = lambda get: f"{get(direct)} / {get(served)}"
    return [folder.name,
            both(lambda s: s["status"]),
            both(lambda s: s["capture"]["views"]),
            both(lambda s: s["capture"]["detections"]),
            both(lambda s: f"{s['calibration']['residual_rms_px']:.3f}"),
            both(lambda s: f"{1e3 * s['calibration']['predicted_tool_error_m']['median']:.2f}"),
            f"{largest_difference(folder):.1f}",
            f"{served['wall_s']:.0f}",
            f"{latency[1]}, {latency[2]}" if latency else "-",
            f"{100 * usage['cpu_s'] / served['wall_s']:.0f}",
            f"{usage['rss_mb']:.0f}"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("armcal", type=Path)
    parser.add_argument("routine", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3, 4, 5])
    parser.add_argument("--factor", type=float, default=1.0)
    parser.add_argument("--at-once", type=int, default=5)
    parser.add_argument("--run-more", default="")
    args = parser.parse_args()
    with ThreadPoolExecutor(args.at_once) as pool:
        folders = list(pool.map(lambda seed: run_pair(args, seed), args.seeds))
    head = ["seed", "status", "views", "tags", "residual px", "predicted tool error mm", "difference sigma",
            "served wall s", "latency ms: median, 99 %", "CPU %", "MB"]
    print("\n".join(f"| {' | '.join(cells)} |" for cells in [head, ["---"] * len(head)]))
    for seed, folder in zip(args.seeds, folders):
        print(f"| {' | '.join(row(folder))} |" if folder else f"| {seed} | failed: see its folder |")


if __name__ == "__main__":
    main()
