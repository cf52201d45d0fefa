"""Coverage of U95 in closed loops: how often the true tool error exceeds it, by stratum, with and without geometry errors.

    coverage.py run ARMCAL FOLDER [--seconds S] [--size 50] [--blocks N] [--first SEED] [--strata NAME,..] [--threads 1]
    coverage.py table FOLDER [--short]

`run` makes blocks of --size seeds for each line of strata.txt in two cases, for which see CASES; FOLDER gets one campaign table a
block. Finished blocks are skipped, a block that was broken off continues, and no block begins after --seconds. The program's hash is
kept in FOLDER, and another program is refused. Run it from the root of the repository; it needs Python 3.11 and nothing else.

`table` prints one line a stratum and case. The share beyond U95 should be 5 %. Its interval is the 99 % percentile bootstrap over
runs, because targets of one run share one calibration; it is empty where no run has a target beyond. PIT: predicted probability of
a smaller error than the true one, over the targets, in ten bins; each holds 10 % where the predicted distribution is right.
"""

import argparse
import csv
import hashlib
import random
import re
import shutil
import subprocess
import time
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
STRATA = Path(__file__).with_name("strata.txt")
SIGMAS = ("link_position_std_m", "link_rotation_std_rad", "tool_position_std_m")
# nominal: the arm is as in the URDF, and the estimator knows it. drawn: it is off by as much as the estimator assumes.
CASES = {"nominal": [], "drawn": ["--set", "world.geometry.error_ratio=1"]}
RESAMPLES = 4000
BINS = 10


def strata():
    """Name: (first seed, blocks of 50 seeds, routine, options)."""
    lines = (line.split() for line in STRATA.read_text().splitlines() if line and not line.startswith("#"))
    return {name: (int(first), int(blocks), routine, options) for name, first, blocks, routine, *options in lines}


def exact_robot(folder, routine, options):
    """A copy of the stratum's robot folder whose robot.toml states no geometry error."""
    named = tomllib.loads((ROOT / routine).read_text())["robot"]
    robot = ROOT / options[options.index("--robot") + 1] if "--robot" in options else (ROOT / routine).parent / named
    robots = folder / "robots"
    if not robots.exists():
        shutil.copytree(ROOT / "robots", robots)
    file = robots / robot.name / "robot.toml"
    text = re.sub(rf"^({'|'.join(SIGMAS)}) *=.*\n", "", file.read_text(), flags=re.M)
    head = "" if re.search(r"^\[geometry\]", text, flags=re.M) else "\n[geometry]\n"
    text = re.sub(r"^\[geometry\]\n", "[geometry]\n" + "".join(f"{key} = 0.0\n" for key in SIGMAS), text + head, flags=re.M)
    file.write_text(text)
    return file.parent


def without_robot(options):
    if "--robot" not in options:
        return options
    at = options.index("--robot")
    return options[:at] + options[at + 2:]


def check_program(armcal, folder):
    found = hashlib.sha256(armcal.read_bytes()).hexdigest()
    kept = folder / "program.sha256"
    if kept.exists() and kept.read_text().strip() != found:
        raise SystemExit(f"{folder}: its blocks are of another program; take that one, or another folder")
    kept.write_text(found + "\n")


def run(args):
    folder = args.folder
    folder.mkdir(parents=True, exist_ok=True)
    check_program(args.armcal, folder)
    began = time.monotonic()
    chosen = {name: of for name, of in strata().items() if not args.strata or name in args.strata.split(",")}
    most = args.blocks or max(-(-50 * blocks // args.size) for _, blocks, _, _ in chosen.values())
    for block in range(most):
        for name, (first, blocks, routine, options) in chosen.items():
            if not args.blocks and block * args.size >= 50 * blocks:
                continue
            start = (args.first or first) + block * args.size
            for case, more in CASES.items():
                out = folder / f"{name}-{case}-{block + 1}.csv"
                if out.exists() and not out.with_name(out.name + ".partial").exists():
                    continue
                if args.seconds and time.monotonic() - began >= args.seconds:
                    print(f"time is over before {out}")
                    return
                words = options + more
                if case == "nominal":
                    words = without_robot(options) + ["--robot", exact_robot(folder, routine, options)]
                seeds = f"{start}..{start + args.size - 1}"
                call = [args.armcal, "--quiet", "campaign", routine, *words, "--seeds", seeds, "--threads", str(args.threads), "--out", out]
                # Refused and failed runs are rows; what counts is that the table is whole.
                subprocess.run([str(word) for word in call], cwd=ROOT, stdout=subprocess.DEVNULL, stdin=subprocess.DEVNULL, check=False)
                if not out.exists() or out.with_name(out.name + ".partial").exists():
                    raise SystemExit(f"{out}: broken off")
                print(f"{time.monotonic() - began:8.0f} s  {out}", flush=True)


def targets_of(row):
    """(true error, U95, predicted probability of a larger error) at each target that has both lengths."""
    out = []
    for key in row:
        if key.startswith("u95_m.") and row[key]:
            n = key.removeprefix("u95_m.")
            error, p_larger = row[f"tool_error_after_m.{n}"], row[f"p_larger_error.{n}"]
            if error:
                out.append((float(error), float(row[key]), float(p_larger) if p_larger else None))
    return out


def rows_of(folder, name, case):
    """Rows of finished blocks and of one under way, without a torn last line."""
    rows = []
    for path in sorted(folder.glob(f"{name}-{case}-*.csv")) + sorted(folder.glob(f"{name}-{case}-*.csv.partial")):
        if path.suffix == ".csv" and path.with_name(path.name + ".partial").exists():
            continue
        lines = path.read_text().splitlines(keepends=True)
        rows.extend(csv.DictReader(line for line in lines if line.endswith("\n") and not line.startswith("#")))
    return rows


def quantile(values, share):
    values = sorted(values)
    at = share * (len(values) - 1)
    low = int(at)
    return values[low] + (at - low) * (values[min(low + 1, len(values) - 1)] - values[low])


def interval(runs):
    """99 % bootstrap interval of the share beyond U95; `runs`: (targets beyond, targets) each."""
    rng = random.Random(1)
    shares = []
    for _ in range(RESAMPLES):
        drawn = rng.choices(runs, k=len(runs))
        shares.append(sum(beyond for beyond, _ in drawn) / sum(n for _, n in drawn))
    return quantile(shares, 0.005), quantile(shares, 0.995)


def line(name, case, rows):
    runs = [targets for row in rows if (targets := targets_of(row))]
    every = [target for targets in runs for target in targets]
    if not every:
        return f"| {name} | {case} | {len(rows)} | 0 | - | - | - | - | - | - | - |"
    ratios = [error / u95 for error, u95, _ in every]
    low, high = interval([(sum(error > u95 for error, u95, _ in targets), len(targets)) for targets in runs])
    pits = [1.0 - p for _, _, p in every if p is not None]
    bins = [sum(min(int(BINS * pit), BINS - 1) == k for pit in pits) for k in range(BINS)]
    nees = [float(row["nees_with_priors"]) for row in rows if row.get("nees_with_priors")]
    cells = [name, case, f"{len(rows)} ({len(rows) - len(runs)})", str(len(every)),
             f"{100 * sum(ratio > 1 for ratio in ratios) / len(every):.1f}", f"{100 * low:.1f} to {100 * high:.1f}",
             str(sum(ratio > 3 for ratio in ratios)), f"{quantile(ratios, 0.95):.2f}",
             f"{1e3 * quantile([u95 for _, u95, _ in every], 0.5):.2f}",
             f"{sum(nees) / len(nees):.2f}" if nees else "-",
             " ".join(f"{100 * n / len(pits):.0f}" for n in bins) if pits else "-"]
    return "| " + " | ".join(cells) + " |"


def shares(rows):
    """Runs, per cent of targets beyond U95 with its interval, 95 % of error over U95, and the number beyond 3 U95."""
    runs = [targets for row in rows if (targets := targets_of(row))]
    ratios = [error / u95 for targets in runs for error, u95, _ in targets]
    low, high = interval([(sum(error > u95 for error, u95, _ in targets), len(targets)) for targets in runs])
    beyond = 100 * sum(ratio > 1 for ratio in ratios) / len(ratios)
    return len(runs), f"{beyond:.1f} ({100 * low:.1f} to {100 * high:.1f})", f"{quantile(ratios, 0.95):.2f}", sum(ratio > 3 for ratio in ratios)


def short_table(folder):
    """One line a stratum: nominal, then drawn."""
    print("| stratum | runs | nominal: beyond, % | 95 % of error/U95 | drawn: beyond, % | 95 % of error/U95 |\n|---|--:|--:|--:|--:|--:|")
    rows = {case: {name: rows_of(folder, name, case) for name in strata()} for case in CASES}
    every = {case: [row for of_name in rows[case].values() for row in of_name] for case in CASES}
    for name in [*strata(), "all"]:
        found = [shares(of) for case in CASES if (of := every[case] if name == "all" else rows[case][name])]
        if len(found) == len(CASES):
            cells = [name, ", ".join(str(n) for n, *_ in found), *(cell for _, beyond, ratio, _ in found for cell in (beyond, ratio))]
            print("| " + " | ".join(cells) + " |")
    print(f"\nTargets beyond 3 U95: {sum(shares(every[case])[3] for case in CASES)}")


def table(args):
    if args.short:
        short_table(args.folder)
        return
    print("| stratum | geometry | runs (without result) | targets | beyond U95, % | 99 % interval, % | beyond 3 U95 | error/U95, 95 % of targets "
          "| U95, median, mm | NEES, mean (3) | PIT in ten bins, % |")
    print("|---|---|--:|--:|--:|--:|--:|--:|--:|--:|---|")
    for name in strata():
        for case in CASES:
            if rows := rows_of(args.folder, name, case):
                print(line(name, case, rows))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(required=True)
    of_run = commands.add_parser("run", help="make the blocks that are missing")
    of_run.add_argument("armcal", type=lambda text: Path(text).resolve())
    of_run.add_argument("folder", type=lambda text: Path(text).resolve())
    of_run.add_argument("--seconds", type=float)
    of_run.add_argument("--size", type=int, default=50, help="seeds a block")
    of_run.add_argument("--blocks", type=int, help="blocks of each stratum; as in strata.txt if absent")
    of_run.add_argument("--first", type=int, help="first seed of every stratum, which then share draws; as in strata.txt if absent")
    of_run.add_argument("--strata", help="names, separated by commas; all if absent")
    of_run.add_argument("--threads", type=int, default=1)
    of_run.set_defaults(do=run)
    of_table = commands.add_parser("table", help="print the table of FOLDER")
    of_table.add_argument("folder", type=Path)
    of_table.add_argument("--short", action="store_true", help="one line a stratum")
    of_table.set_defaults(do=table)
    args = parser.parse_args()
    args.do(args)


if __name__ == "__main__":
    main()
