"""Everything beside the tools that one would take otherwise, on the same data, in one run -> Markdown on stdout.

    python3 -m venv target/oracle && target/oracle/bin/pip install -r tests/oracle/requirements.txt -r benches/peers/requirements.txt
    target/oracle/bin/python benches/peers/peers.py ARMCAL [--data DIR] [--recordings DIR] [--programs DIR] [--tagslam DIR] [--industrial DIR]
        [--speed FILE] [--only PART ...] > peers.md

ARMCAL: the program, built. DATA: recordings of real arms (arms.py says which). RECORDINGS: where simulated ones
are kept, or made. PROGRAMS: the built C++ of benches/peers/Makefile. TAGSLAM:
folder `tests` of github berndpfrommer/tagslam_test. INDUSTRIAL: a checkout of github ros-industrial/industrial_calibration, with hand_eye
and kinematic built in it (README.md). SPEED: the benchmark benches/speed.rs, built with
the default features, for armcal's own step beside Pinocchio's. The part `solvers` leaves target/release/armcal built without the simulator.
Machine, date and versions stand at the top; a part that cannot run says why, and none is left out for its result.

| part | ours beside | what |
|---|---|---|
| arms | FIGAROH | held-out errors on recordings of real arms |
| simulated | FIGAROH, GTSAM | tool error against the truth, on recordings of `armcal run` |
| maps | TagSLAM | TagSLAM's own tests, with the maps that it left there |
| industrial | industrial_calibration | its own example data |
| solvers | Ceres, NLopt | `bundle` and minimum distance, the same numbers |
| detectors | pupil-apriltags, OpenCV | found tags, corner errors, time on `armcal-lab detection`'s images |
| paths | OMPL with coal | RRT-Connect and edge checks on `armcal-lab edges` and `armcal-lab paths` |
| physics | MuJoCo, Pinocchio | steps and accelerations a second of the same arm |
"""

import argparse
import datetime
import os
import platform
import shutil
import subprocess
import sys
import tempfile
from importlib import metadata
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ["figaroh", "gtsam", "pin", "mujoco", "ompl", "pupil-apriltags", "opencv-python-headless", "numpy",
            "scipy"]


def said(*words):
    """First line of what a program says, or why it does not."""
    try:
        run = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True)
        return run.stdout.strip().splitlines()[0]
    except (OSError, subprocess.CalledProcessError, IndexError) as error:
        return f"unknown ({type(error).__name__})"


def version(package):
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed"


def header(armcal):
    model = [line.split(":", 1)[1].strip() for line in Path("/proc/cpuinfo").read_text().splitlines() if line.startswith("model name")]
    print(f"{datetime.date.today()}; {os.cpu_count()} cores, {model[0] if model else platform.machine()}; load {os.getloadavg()[0]:.1f}; "
          f"{platform.platform()}.")
    print(f"{said(str(armcal), '--version')}, commit {said('git', 'rev-parse', '--short=12', 'HEAD')}; {said('rustc', '--version')}; "
          f"Python {platform.python_version()}; " + ", ".join(f"{name} {version(name)}" for name in PACKAGES) + ".")


def run(*words, out=None):
    """A part's program; its tables go where ours go. If it fails, an error with the last line that it said."""
    ended = subprocess.run([str(word) for word in words], cwd=ROOT, stdout=out, stderr=subprocess.PIPE, text=True)
    if ended.returncode:
        last = "".join(ended.stderr.strip().splitlines()[-1:])
        raise RuntimeError(f"{Path(words[0]).name} {words[1]}: exit code {ended.returncode}: {last}")


def arms(args, _):
    if not args.data:
        raise RuntimeError("no --data")
    run(sys.executable, "benches/peers/arms.py", args.armcal, args.data)


def simulated(args, folder):
    run(sys.executable, "benches/peers/simulated.py", args.armcal, args.recordings or folder)


def maps(args, _):
    if not args.tagslam:
        raise RuntimeError("no --tagslam")
    run(sys.executable, "benches/peers/tag_maps.py", args.armcal, args.tagslam)


def industrial(args, _):
    if not args.industrial:
        raise RuntimeError("no --industrial")
    programs = [args.industrial / name for name in ("hand_eye", "kinematic")]
    run(sys.executable, "benches/peers/industrial.py", args.armcal, args.industrial / "examples", *programs)


def solvers(args, _):
    if not args.programs:
        raise RuntimeError("no --programs")
    print("```", flush=True)
    run("cargo", "bench", "--no-default-features", "--bench", "peers", "--", args.programs)
    print("```")


def detectors(args, folder):
    run(args.armcal, "study", "detection", "--repeats", "2", "--images", folder / "images", "--out", folder / "detection", out=subprocess.DEVNULL)
    print("```", flush=True)
    run(sys.executable, "tests/oracle/compare_detectors.py", folder / "images", "--out", folder / "detectors.csv")
    print("```")


def paths(args, folder):
    # As many edges as are compared: the study scans each by brute force.
    run(args.armcal, "study", "edges", "--n", "2000", "--robot", "robots/titan4", "--out", folder / "edges", out=subprocess.DEVNULL)
    run(args.armcal, "study", "paths", "--out", folder / "paths", out=subprocess.DEVNULL)
    run(sys.executable, "tests/oracle/compare_ompl.py", "--edges", folder / "edges/edges-titan4.json", "--paths",
        *sorted((folder / "paths").glob("paths-*.json")))


def physics(args, _):
    run(sys.executable, "benches/peers/rigid_bodies.py", *([args.speed] if args.speed else []))
    print(flush=True)
    print("```", flush=True)
    run(sys.executable, "tests/oracle/bench_mujoco.py", "--with-armcal")
    print("```")


PARTS = [arms, simulated, maps, industrial, solvers, detectors, paths, physics]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("armcal", type=lambda text: Path(text).resolve())
    parser.add_argument("--data", type=lambda text: Path(text).resolve())
    parser.add_argument("--programs", type=lambda text: Path(text).resolve())
    parser.add_argument("--recordings", type=lambda text: Path(text).resolve())
    parser.add_argument("--tagslam", type=lambda text: Path(text).resolve())
    parser.add_argument("--industrial", type=lambda text: Path(text).resolve())
    parser.add_argument("--speed", type=lambda text: Path(text).resolve())
    parser.add_argument("--only", nargs="+", choices=[part.__name__ for part in PARTS])
    args = parser.parse_args()
    print("# Beside other tools\n")
    header(args.armcal)
    with tempfile.TemporaryDirectory() as kept:
        # The part `solvers` builds, and what lies in target/ is another program after that.
        args.armcal = Path(shutil.copy(args.armcal, kept))
        for part in PARTS:
            if args.only and part.__name__ not in args.only:
                continue
            print(f"\n## {part.__name__.capitalize()}\n", flush=True)
            try:
                with tempfile.TemporaryDirectory() as folder:
                    part(args, Path(folder))
            except (RuntimeError, OSError) as error:
                print(f"Not run: {error}", flush=True)


if __name__ == "__main__":
    main()
