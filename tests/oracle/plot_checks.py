"""Draws the checks of docs/theory/physics.md: runs the tests, reads the lines that begin with `plot`, writes docs/results/checks/*.png.

    target/oracle/bin/python tests/oracle/plot_checks.py               # runs cargo test
    target/oracle/bin/python tests/oracle/plot_checks.py LOG [LOG..]   # reads what the tests printed before

A line is `plot NAME FIGURES..`: one point of the series NAME. Dots are what armcal gives, lines the closed form or the oracle.
"""

import math
import re
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
CHECKS = ROOT / "docs" / "results" / "checks"
TESTS = [
    ["--lib", "--", "sim::dynamics", "sim::physics", "sim::hydraulics", "sim::sensors"],
    ["--test", "main", "--", "oracle::steps"],
]
BLUE, ORANGE, GREEN, RED, GREY = "#0060a8", "#d97700", "#2a8a3c", "#b02a2a", "#707070"
PALETTE = [BLUE, ORANGE, GREEN, RED, "#7a4fa0", "#00858a"]

Series = dict[str, np.ndarray]


def logs() -> list[str]:
    if len(sys.argv) > 1:
        return [Path(name).read_text(errors="replace") for name in sys.argv[1:]]
    found = []
    for test in TESTS:
        command = ["cargo", "test", "--release", *test, "--nocapture"]
        print(" ".join(command), file=sys.stderr)
        run = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        if run.returncode != 0:
            sys.exit(f"{' '.join(command)} failed:\n{run.stderr[-3000:]}")
        found.append(run.stderr)
    return found


def read() -> Series:
    """Points by series; tests run side by side, so that lines of different series alternate."""
    points = defaultdict(list)
    for log in logs():
        for line in re.finditer(r"(?:^|\.\.\. )plot (\S+) (.+)$", log, re.MULTILINE):
            points[line[1]].append([float(figure) for figure in line[2].split()])
    if not points:
        sys.exit("no line begins with `plot`")
    return {name: np.array(rows) for name, rows in points.items()}


def of(series: Series, name: str) -> np.ndarray:
    """The columns of a series."""
    if name not in series:
        sys.exit(f"no series {name}; there are {', '.join(sorted(series))}")
    return series[name].T


def picture(columns: int = 1, rows: int = 1, height: float = 5.6) -> tuple[plt.Figure, list[plt.Axes]]:
    figure, axes = plt.subplots(rows, columns, figsize=(10, height), squeeze=False)
    return figure, list(axes.flat)


def write(figure: plt.Figure, name: str) -> None:
    figure.tight_layout()
    CHECKS.mkdir(parents=True, exist_ok=True)
    path = CHECKS / f"{name}.png"
    figure.set_dpi(100)
    figure.canvas.draw()
    # A palette: a third of the bytes.
    Image.fromarray(np.asarray(figure.canvas.buffer_rgba())[:, :, :3]).quantize(256, kmeans=2).save(path, optimize=True)
    plt.close(figure)
    size = path.stat().st_size
    print(f"{path.relative_to(ROOT)}: {size} bytes")
    if size >= 100_000:
        sys.exit(f"{path} is larger than 100 kB")


def convergence(series: Series) -> None:
    figure, (left, right) = picture(2)
    motions = [
        ("titan4/falling/rad", "Titan 4 falls"),
        ("titan4/shaken-base/rad", "Titan 4, shaken base"),
        ("titan4/from-rest/angle/rad", "Titan 4 on a free vehicle, joints"),
        ("titan4/from-rest/base-turn/rad", "the same, vehicle's turn"),
        ("pendulum", "pendulum, shaken base"),
        ("valve", "hydraulic joint, one stroke"),
    ]
    for k, (name, label) in enumerate(motions):
        step, error = of(series, f"convergence/{name}")
        left.loglog(1e3 * step, error, "os^vDP"[k] + "-", color=PALETTE[k], lw=0.8, ms=5, label=label)
    for k, robot in enumerate(("titan4", "kraft-predator")):
        for flight, marker in (("from-rest", "o"), ("drifting", "s")):
            step, error = of(series, f"convergence/{robot}/{flight}/momentum")
            right.loglog(1e3 * step, error, marker + "-", color=PALETTE[k], lw=0.8, ms=5,
                         label=f"{robot}, {flight.replace('-', ' ')}")
    for axes, error_label, at in ((left, "error of an angle, rad", 3e-6), (right, "largest error of the momentum, SI", 1e-4)):
        steps = np.array([0.5, 4.0])
        axes.loglog(steps, at * (steps / 0.5) ** 2, "--", color=GREY, label="slope 2")
        axes.set_xlabel("step, ms")
        axes.set_ylabel(error_label)
        axes.set_xticks([0.5, 1, 2, 4], ["0.5", "1", "2", "4"])
        axes.minorticks_off()
        axes.legend(fontsize=8)
    left.set_title("motions")
    right.set_title("momentum of arm and free vehicle")
    write(figure, "convergence")


def sphere(series: Series) -> None:
    figure, (left, right) = picture(2)
    time, velocity, exact, terminal = of(series, "sphere")
    left.plot(time, exact, "-", color=GREY, label="vt tanh(a t / vt)")
    left.plot(time, velocity, "o", color=BLUE, ms=4, label="sphere of 60 kg, radius 0.2 m")
    left.axhline(terminal[0], ls="--", color=ORANGE, lw=1, label=f"vt = {terminal[0]:.3f} m/s")
    left.set_ylabel("velocity downwards, m/s")
    right.plot(time, 1e6 * (velocity - exact), "o-", color=BLUE, ms=4, lw=0.8)
    right.set_ylabel("difference from the closed form, µm/s")
    for axes in (left, right):
        axes.set_xlabel("time, s")
    left.legend(loc="lower right")
    left.set_title("a sphere sinks from rest")
    right.set_title("difference at a step of 2 ms")
    write(figure, "sphere")


def vehicle(series: Series) -> None:
    figure, (left, right) = picture(2)
    time, turn, exact, joint = of(series, "light-vehicle")
    left.plot(time, exact, "-", color=GREY, label="vehicle: -(20/30)(1 - cos t)")
    left.plot(time, turn, "o", color=BLUE, ms=4, label="vehicle, 30 kg m²")
    left.plot(time, 20.0 / 8.0 * (1.0 - np.cos(time)) - exact, "--", color=GREY, label="joint: 20 (1/8 + 1/30)(1 - cos t)")
    left.plot(time, joint, "s", color=ORANGE, ms=3, label="joint of a bar, 8 kg m²")
    left.set_title("one joint turns a free vehicle")
    for k, (robot, label) in enumerate((("titan4", "Titan 4"), ("kraft-predator", "Kraft Predator"))):
        time, turn, exact = of(series, f"rocking/{robot}/from-rest")
        right.plot(time, exact, "-", color=GREY, label="Pinocchio and DOP853" if k == 0 else None)
        right.plot(time, turn, "o", color=PALETTE[k], ms=4, label=f"{label} on 400 kg, 2 ms")
    right.set_title("an arm rocks a light vehicle")
    left.set_ylabel("angle, rad")
    right.set_ylabel("turn of the vehicle from its start, rad")
    for axes in (left, right):
        axes.set_xlabel("time, s")
        axes.legend(fontsize=9)
    write(figure, "rocked_vehicle")


def conservation(series: Series) -> None:
    figure, (left, right) = picture(2)
    time, _, own = of(series, "momentum/wet/0.002")
    left.semilogy(time, own, "-", color=GREY, label="the arm's own")
    for k, step in enumerate(("0.004", "0.002", "0.001")):
        time, rest, _ = of(series, f"momentum/wet/{step}")
        left.semilogy(time, rest, "o", color=PALETTE[k], ms=3, label=f"of all, {1e3 * float(step):.0f} ms")
        time, gained, kinetic = of(series, f"energy/{step}")
        right.plot(time, 1e3 * gained / kinetic.max(), "o-", color=PALETTE[k], ms=3, lw=0.8, label=f"{1e3 * float(step):.0f} ms")
    left.set_ylabel("angular momentum, kg m²/s")
    left.set_title("arm and free vehicle in still water")
    left.legend(fontsize=9, ncols=2)
    right.axhline(0.0, color=GREY, lw=1)
    right.set_ylabel("energy gained over the peak of motion, 1e-3")
    right.set_title("undamped fall and swing of the Titan 4")
    right.legend()
    for axes in (left, right):
        axes.set_xlabel("time, s")
    write(figure, "conservation")


def hydraulics(series: Series) -> None:
    figure, (left, middle, right) = picture(3)
    for k, lag in enumerate(("0.02", "0.05", "0.08")):
        time, spool = of(series, f"spool/{lag}")
        fine = np.linspace(0.0, time.max(), 200)
        left.plot(fine, 0.7 * (1.0 - np.exp(-fine / float(lag))), "-", color=GREY, lw=1)
        left.plot(time, spool, "o", color=PALETTE[k], ms=3, label=f"T = {1e3 * float(lag):.0f} ms")
    left.plot([], [], "-", color=GREY, label="0.7 (1 - exp(-t/T))")
    left.set_xlabel("time, s")
    left.set_ylabel("spool, share of its stroke")
    left.set_title("a step of the command")
    for joint, label in enumerate(("2000 N m", "4000 N m", "2000 N m, fast")):
        flow, rate, exact, asked = of(series, f"pump/{joint}")
        enough = flow[0] * asked[0] / exact[0]
        middle.plot([0.0, enough, flow[-1]], [0.0, asked[0], asked[0]], "-", color=GREY, lw=1)
        middle.plot(flow, rate, ["o", "s", "^"][joint], color=PALETTE[joint], ms=[8, 4, 5][joint], label=label)
    middle.plot([], [], "-", color=GREY, label="min(1, pump's / asked) rate")
    middle.set_xlabel("pump's flow, L/min")
    middle.set_ylim(0.0, 1.8)
    middle.set_ylabel("rate, rad/s")
    middle.set_title("three joints share a pump")
    for k, (name, leakage, torque) in enumerate((("0.005/-1200", 5e-3, -1200), ("0.00005/800", 5e-5, 800))):
        time, angle = of(series, f"leak/{name}")
        right.loglog(time, leakage * abs(torque) / 2000.0 * time, "-", color=GREY, lw=1)
        right.loglog(time, np.abs(angle), "o", color=PALETTE[k], ms=4, label=f"{leakage:.0e} rad/s, {torque} N m")
    right.plot([], [], "-", color=GREY, label="leakage τ / τmax · t")
    right.set_xlabel("time, s")
    right.set_xticks([5, 10, 20, 60], ["5", "10", "20", "60"])
    right.minorticks_off()
    right.set_ylim(5e-5, 3.0)
    right.set_ylabel("angle crept, rad")
    right.set_title("a leaky closed valve")
    for axes in (left, middle, right):
        axes.legend(fontsize=8, loc="lower right" if axes is left else "upper left")
    write(figure, "hydraulics")


def friction(series: Series) -> None:
    figure, (left, right) = picture(2)
    for k, rate in enumerate(("0.005", "0.05", "0.15")):
        angle, torque = of(series, f"friction/{rate}")
        sliding = 30.0 + 10.0 * math.exp(-((float(rate) / 0.05) ** 2))
        left.plot(1e3 * angle, torque, "o", color=PALETTE[k], ms=3, label=f"{rate} rad/s, slides at {sliding:.1f} N m")
        for sign in (1.0, -1.0):
            left.plot(sign * np.array([-4.0, -4.0 + (40.0 + sliding) / 40.0]), sign * np.array([-sliding, 40.0]), "-", color=GREY, lw=1)
            left.plot(sign * np.array([-4.0 + (40.0 + sliding) / 40.0, 4.0]), sign * np.array([sliding, sliding]), "-", color=GREY, lw=1)
    left.plot([0.0, 1.0], [0.0, 40.0], "--", color=GREY, lw=1, label="stiction / presliding, 40 N m / 1 mrad")
    left.set_xlabel("angle, mrad")
    left.set_ylabel("torque, N m")
    left.set_ylim(-50, 75)
    left.legend(fontsize=8, loc="upper left")
    left.set_title("friction through breakaway, there and back")
    cases = [
        ("valve/-1200/300", "closed valve, -1200 ± 300 N m"),
        ("friction/39/0", "friction alone, 39 N m"),
        ("friction/20/10", "friction alone, 20 ± 10 N m"),
        ("friction/-20/15", "friction alone, -20 ± 15 N m"),
    ]
    for k, (name, label) in enumerate(cases):
        time, angle = of(series, f"hold/{name}")
        right.plot(time / 60.0, 1e3 * angle, ".", color=PALETTE[k], ms=3)
        time, mean = of(series, f"hold-mean/{name}")
        right.plot(time / 60.0, 1e3 * mean, "s-", color=PALETTE[k], ms=5, lw=1, mec="black", mew=0.5,
                   label=f"{label}: {mean[-1] - mean[0]:+.0e} rad")
    right.set_xlabel("time, min")
    right.set_ylabel("angle, mrad (squares: means of a minute)")
    low, high = right.get_ylim()
    right.set_ylim(low, high + 0.45 * (high - low))
    right.legend(fontsize=8, loc="upper left", title="drift of the mean in 10 min", title_fontsize=8)
    right.set_title("ten minutes under gravity and rocking")
    write(figure, "friction")


def potentiometer(series: Series) -> None:
    figure, axes = picture(3, 2, 6.4)
    effects = [
        ("gain", "gain 1 %"),
        ("temperature", "7 K: 0.3 mrad/K, 1e-4 /K"),
        ("nonlinearity", "two harmonics"),
        ("worn-spot", "worn spot, 20 mrad deep"),
        ("play", "play of the shaft, 10 mrad"),
        ("hysteresis", "hysteresis 10 mrad, share 0.5"),
    ]
    for place, (name, title) in zip(axes, effects):
        angle, error, exact = of(series, f"pot/{name}")
        every = 1 if name in ("play", "hysteresis", "worn-spot") else 4
        place.plot(angle, 1e3 * exact, "-", color=GREY, lw=1.2, label="closed form")
        place.plot(angle[::every], 1e3 * error[::every], "o", color=BLUE, ms=3, label="reading")
        place.set_title(title)
        place.set_xlabel("angle, rad")
        place.set_ylabel("error, mrad")
    axes[0].legend(fontsize=8)
    axes[3].set_xlim(-1.5, -0.5)
    write(figure, "potentiometer")


def noise(series: Series) -> None:
    figure, (left, right) = picture(2)
    word, seen, expected = of(series, "noise")
    left.bar(word, seen, width=0.8, color="#a8c8e4", label="100 000 words")
    left.plot(word, expected, "o", color=RED, ms=5, label="normal, cut at the converter's steps")
    at = np.linspace(-6, 6, 300)
    left.plot(at, 1e5 / (1.5 * math.sqrt(2 * math.pi)) * np.exp(-0.5 * ((at - 0.3) / 1.5) ** 2), "-", color=GREY,
              label="its density, 1.5 counts about 0.3")
    left.set_xlabel("word less 30 000, counts (±5: and beyond)")
    left.set_ylabel("words")
    left.set_ylim(0, 36_000)
    left.legend(fontsize=8)
    left.set_title("noise of a reading")
    tau, measured, exact, white, walk = of(series, "allan")
    right.loglog(tau, np.sqrt(exact), "-", color=GREY, label="noise and walk together")
    right.loglog(tau, np.sqrt(white), ":", color=ORANGE, label="noise alone")
    right.loglog(tau, np.sqrt(walk), ":", color=GREEN, label="walk alone, K sqrt(τ/3)")
    right.loglog(tau, np.sqrt(measured), "o", color=BLUE, ms=5, label="16 sensors for 36 h")
    right.set_ylim(0.5 * np.sqrt(exact.min()), 3 * np.sqrt(exact.max()))
    right.set_xlabel("averaging time τ, s")
    right.set_ylabel("Allan deviation, counts (1 count = 0.022 deg)")
    right.legend(fontsize=8)
    right.set_title("noise and drift of the standard sensor")
    write(figure, "noise_and_drift")


def port(series: Series) -> None:
    figure, (axes,) = picture()
    angle, thin, exact, thick = of(series, "port")
    axes.semilogy(np.degrees(angle), exact, "-", color=GREY, label="thin port at the pupil: asin(n sin), lens shorter by n")
    axes.semilogy(np.degrees(angle), thin, "o", color=BLUE, ms=5, label="thin port at the pupil")
    axes.semilogy(np.degrees(angle), thick, "s", color=ORANGE, ms=4, label="port of the standard distance and thickness, point at 1 m")
    axes.set_xlabel("angle off the axis in water, deg")
    axes.set_ylabel("shift of a point from the drawing's lens, px")
    axes.legend()
    axes.set_title("flat port")
    write(figure, "flat_port")


def main() -> None:
    plt.rcParams.update({"font.size": 10, "axes.grid": True, "grid.alpha": 0.3, "axes.titlesize": 11})
    series = read()
    for draw in (convergence, sphere, vehicle, conservation, hydraulics, friction, potentiometer, noise, port):
        draw(series)


if __name__ == "__main__":
    main()
