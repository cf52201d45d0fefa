"""A calibration applied in a control program: angles, tool pose and its uncertainty of each reading.

    apply_calibration.py ROBOT CALIBRATION.toml < readings.txt     (a reading a line, a number each joint)
"""

import sys
from pathlib import Path

import numpy as np

import armcal

robot = armcal.Robot.load(sys.argv[1])
cal = armcal.Calibration.load(Path(sys.argv[2]), robot)
if cal.status != "accepted":
    sys.exit(f"do not use it: {cal.refusal}")
for line in sys.stdin:
    counts = np.array(line.split(), dtype=float)
    tool_m = cal.tool_pose(counts)[:3, 3]
    std_m = np.sqrt(np.trace(cal.tool_covariance(counts)))
    print(np.degrees(cal.angles(counts)).round(3), "deg; tool at", tool_m.round(4), f"m, one sigma {1e3 * std_m:.1f} mm")
