"""Draws docs/results/checks/online-growth.png from what `cargo bench --bench growth` printed.

    target/oracle/bin/python tests/oracle/plot_growth.py growth.csv
"""

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

CHECKS = Path(__file__).resolve().parents[2] / "docs" / "results" / "checks"

table = np.genfromtxt(sys.argv[1], delimiter=",", names=True)
figure, (time, memory) = plt.subplots(2, 1, sharex=True, figsize=(7, 5), constrained_layout=True)
time.plot(table["views"], table["ms_a_view"], ".", color="#0060a8", markersize=4)
time.set_ylabel("ms a view")
memory.plot(table["views"], table["memory_mb"], ".", color="#d97700", markersize=4)
memory.set_ylabel("resident memory, MB")
memory.set_xlabel("views taken in")
for axes in (time, memory):
    axes.set_ylim(bottom=0)
    axes.grid(alpha=0.3)
figure.savefig(CHECKS / "online-growth.png", dpi=110)
