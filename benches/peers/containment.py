"""Real recordings: how many cross-validated views lie within armcal's 95 % regions, its noise included -> a table.

    containment.py ARMCAL DATA

DATA as for arms.py, and positioner/measurements.yaml of industrial_calibration's example. p: of an exact binomial test of the count
against 95 %, both sides.
"""

import math
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from real_arms import ARMS, calibrated, positioner  # noqa: E402

SHARE = 0.95


def p_value(within, views):
    """Probability of a count that is as improbable, or more."""
    chances = [math.comb(views, k) * SHARE**k * (1 - SHARE) ** (views - k) for k in range(views + 1)]
    return min(1.0, sum(chance for chance in chances if chance <= chances[within] * (1 + 1e-9)))


def main(armcal, data):
    data = Path(data)
    summaries = [(arm[0], lambda arm=arm: calibrated(armcal, data, arm)) for arm in ARMS]
    summaries.append(("positioner, 205 poses", lambda: positioner(armcal, data / "positioner/measurements.yaml")))
    total = [0, 0]
    print("| recording | verdict | views | within 95 % | p |\n|---|---|--:|--:|--:|")
    for name, summary in summaries:
        summary = summary()
        found = summary["held_out"]["within_95"]
        total = [total[0] + found["within"], total[1] + found["views"]]
        print(f"| {name} | {summary['verdict']['grade']} | {found['views']} | {found['within']} | {p_value(found['within'], found['views']):.3f} |", flush=True)
    print(f"| all | | {total[1]} | {total[0]} | {p_value(*total):.3f} |")


if __name__ == "__main__":
    main(*sys.argv[1:])
