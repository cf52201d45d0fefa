"""Draws docs/results/checks/calibration-growth.png and tag-map-growth.png from what `cargo bench --bench batch_growth`
printed, and prints the exponents of the fits in the legends.

    target/oracle/bin/python tests/oracle/plot_batch_growth.py batch-growth.csv
"""

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

CHECKS = Path(__file__).resolve().parents[2] / "docs" / "results" / "checks"
# Below these sizes what does not grow hides what does.
LEAST_VIEWS, LEAST_MAP_VIEWS, LEAST_TAGS = 300, 2000, 64

table = np.genfromtxt(sys.argv[1], delimiter=",", names=True, dtype=None, encoding="utf-8")


def rows(what):
    return table[table["what"] == what]


def exponent(x, y, least):
    chosen = x >= least
    return np.polyfit(np.log(x[chosen]), np.log(y[chosen]), 1)[0]


def draw(axes, x, y, label, least):
    power = exponent(x, y, least)
    axes.loglog(x, y, "o-", markersize=4, label=f"{label}: power {power:.2f}")
    print(f"{label} ({axes.get_ylabel()}): {power:.2f} from {least} on")


def calibrations():
    figure, panels = plt.subplots(2, 2, figsize=(9, 7), sharex="col", constrained_layout=True)
    panels[0, 0].set_ylabel("processor time, s")
    panels[1, 0].set_ylabel("memory, MB")
    panels[1, 0].set_xlabel("views of 8 tags")
    panels[1, 1].set_xlabel("tags, 8 of them in each of 300 views")
    names = {"calibrate": "calibrate", "estimate": "estimate", "least_squares": "least squares"}
    for axes, key in zip(panels[:, 0], ("cpu_s", "memory_mb")):
        for what, label in names.items():
            of = rows(what)
            draw(axes, of["views"], of[key], label, LEAST_VIEWS)
    for axes, key in zip(panels[:, 1], ("cpu_s", "memory_mb")):
        of = rows("estimate_by_tags")
        draw(axes, of["tags"], of[key], "estimate", LEAST_TAGS)
    finish(figure, panels.flat, "calibration-growth.png")


def maps():
    of = rows("tag_map")
    figure, panels = plt.subplots(1, 3, figsize=(12, 4), constrained_layout=True)
    for axes, key, label in zip(panels, ("cpu_s", "memory_mb"), ("processor time, s", "memory, MB")):
        axes.set_ylabel(label)
        draw(axes, of["views"], of[key], label.split(",")[0], LEAST_MAP_VIEWS)
        axes.set_xlabel("images, one tag more for every 20")
    far = panels[2]
    for key, name in (("along", "along the corridor"), ("across", "across it")):
        (line,) = far.loglog(of["tags"], of[f"{key}_std_mm"], "-", label=f"predicted, {name}")
        far.loglog(of["tags"], np.abs(of[f"{key}_mm"]), "o", color=line.get_color(), label=f"error, {name}")
    far.set_ylabel("last tag, mm")
    far.set_xlabel("tags, 0.25 m apart")
    finish(figure, panels, "tag-map-growth.png")


def finish(figure, panels, name):
    for axes in panels:
        axes.grid(alpha=0.3, which="both")
        axes.legend(fontsize=8)
    figure.savefig(CHECKS / name, dpi=90)


calibrations()
maps()
