"""Draws docs/results/checks/detection-rate.png and detection-error.png.

From tests/golden/detection.csv (conditions.csv of `armcal-lab detection`) and tests/golden/detectors.csv (compare_detectors.py).
"""

import csv
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

ROOT = Path(__file__).parents[2]
GOLDEN = ROOT / "tests/golden"
OUT = ROOT / "docs/results/checks"
WATERS = ["clear", "coastal", "turbid"]


def read(name):
    with open(GOLDEN / name) as file:
        return list(csv.DictReader(file))


def rates():
    rows = read("detection.csv")
    blurs = sorted({float(row["blur_px"]) for row in rows})
    ranges = sorted({float(row["range_m"]) for row in rows})
    incidences = sorted({float(row["incidence_deg"]) for row in rows})
    figure, axes = plt.subplots(len(blurs), 3, figsize=(10, 5.6), sharex=True, sharey=True, layout="constrained")
    colours = plt.cm.viridis(np.linspace(0, 0.95, len(incidences)))
    for line, blur in zip(axes, blurs):
        for axis, water in zip(line, WATERS):
            for incidence, colour in zip(incidences, colours):
                chosen = [
                    (float(row["range_m"]), float(row["rate"]))
                    for row in rows
                    if (row["water"], float(row["blur_px"]), float(row["incidence_deg"])) == (water, blur, incidence)
                ]
                axis.plot(*zip(*sorted(chosen)), "o-", ms=3, lw=1.2, color=colour, label=f"{incidence:.0f} deg")
            axis.set_title(f"{water}, {'at rest' if blur == 0 else f'{blur:.0f} px of motion'}", fontsize=9)
            axis.grid(alpha=0.3)
    axes[0, 0].legend(fontsize=7, title="incidence", title_fontsize=7)
    for axis in axes[-1]:
        axis.set_xlabel("range, m")
        axis.set_xlim(0, max(ranges) * 1.03)
    for axis in axes[:, 0]:
        axis.set_ylabel("detection rate")
    figure.savefig(OUT / "detection-rate.png", dpi=90)


def errors():
    rows = read("detectors.csv")
    names = list(dict.fromkeys(row["detector"] for row in rows))
    rows = [row for row in rows if row["water"] == "all" and not (row["side_from_px"] == "0" and row["side_to_px"] == "1000")]
    bands = list(dict.fromkeys((row["side_from_px"], row["side_to_px"]) for row in rows))
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.8), layout="constrained")
    width = 0.8 / len(names)
    for n, name in enumerate(names):
        own = {(row["side_from_px"], row["side_to_px"]): row for row in rows if row["detector"] == name}
        x = np.arange(len(bands)) + (n - 0.5 * (len(names) - 1)) * width
        left.bar(x, [float(own[band]["recall"]) for band in bands], width, label=name)
        right.bar(x, [float(own[band]["rms_px"]) for band in bands], width)
    for axis, label in ((left, "recall"), (right, "rms corner error per coordinate, px")):
        axis.set_xticks(range(len(bands)), [f"{a}-{b}" if b != "1000" else f"> {a}" for a, b in bands])
        axis.set_xlabel("shortest side, px")
        axis.set_ylabel(label)
        axis.grid(axis="y", alpha=0.3)
    right.set_yscale("log")
    left.legend(fontsize=7)
    figure.savefig(OUT / "detection-error.png", dpi=90)


if __name__ == "__main__":
    rates()
    errors()
