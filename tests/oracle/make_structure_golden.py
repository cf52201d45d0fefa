"""An arm whose joints give between drive and link, by MuJoCo -> tests/golden/structure.csv.

Two links swing in a vertical plane about y. Each joint is two hinges in series: the drive (spring and damper toward a moving
rest) turns a shaft that weighs next to nothing, and the shaft (a spring alone) turns the link. armcal has shafts without mass:
the script halves the shafts' inertia and its own step twice, extrapolates both to nothing, and stops where the two
extrapolations differ by more than a microradian.
"""

from math import cos, pi, sin
from pathlib import Path

import mujoco
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
LENGTH_M = [0.8, 0.6]
MASS_KG = [25.0, 15.0]
CENTER_M = [0.4, 0.35]
INERTIA_KG_M2 = [1.5, 0.6]
DRIVE_N_M_RAD = [4e4, 1.5e4]
DAMPING_N_M_S_RAD = [400.0, 150.0]
SHAFT_RAD_PER_NM = [2e-5, 6e-5]
REST_RAD = [0.3, -0.6]
SWING_RAD = [0.25, -0.35]
PERIOD_S = 1.2
DURATION_S = 1.5
SAMPLE_S = 0.05
GRAVITY_M_S2 = 9.80665


def model(shaft_inertia, step):
    def body(j, inner):
        place = f"{LENGTH_M[j - 1]} 0 0" if j else "0 0 0"
        i = INERTIA_KG_M2[j]
        return f"""
<body name="shaft{j}" pos="{place}">
 <inertial pos="0 0 0" mass="1e-9" diaginertia="1e-9 1e-9 1e-9"/>
 <joint name="drive{j}" axis="0 1 0" stiffness="{DRIVE_N_M_RAD[j]}" damping="{DAMPING_N_M_S_RAD[j]}" springref="0" armature="{shaft_inertia}"/>
 <body name="link{j}">
  <inertial pos="{CENTER_M[j]} 0 0" mass="{MASS_KG[j]}" diaginertia="{i} {i} {i}"/>
  <joint name="shaft{j}" axis="0 1 0" stiffness="{1 / SHAFT_RAD_PER_NM[j]}"/>
  {inner}
 </body>
</body>"""

    xml = f"""<mujoco><compiler angle="radian"/><option timestep="{step}" gravity="0 0 -{GRAVITY_M_S2}" integrator="implicitfast"/>
<worldbody>{body(0, body(1, ""))}</worldbody></mujoco>"""
    return mujoco.MjModel.from_xml_string(xml)


def rest(j, t):
    """Of the drive, and its rate: it swings once and stays."""
    turn = 2 * pi / PERIOD_S
    if t >= PERIOD_S:
        return REST_RAD[j], 0.0
    return REST_RAD[j] + SWING_RAD[j] * (1 - cos(turn * t)) / 2, SWING_RAD[j] * turn * sin(turn * t) / 2


def balance():
    """Link and shaft angles at rest under gravity."""
    angles = np.array(REST_RAD)
    for _ in range(200):
        a, b = angles[0], angles[0] + angles[1]
        far = GRAVITY_M_S2 * MASS_KG[1] * CENTER_M[1] * cos(b)
        near = GRAVITY_M_S2 * (MASS_KG[0] * CENTER_M[0] + MASS_KG[1] * LENGTH_M[0]) * cos(a) + far
        load = np.array([near, far])
        angles = REST_RAD + load * (1 / np.array(DRIVE_N_M_RAD) + SHAFT_RAD_PER_NM)
    return angles, REST_RAD + load / DRIVE_N_M_RAD


def swing(shaft_inertia, step):
    m = model(shaft_inertia, step)
    d = mujoco.MjData(m)
    links, shafts = balance()
    d.qpos[:] = [shafts[0], links[0] - shafts[0], shafts[1], links[1] - shafts[1]]
    samples = []
    every = round(SAMPLE_S / step)
    for i in range(round(DURATION_S / step) + 1):
        if i % every == 0:
            samples.append([i * step, d.qpos[0] + d.qpos[1], d.qpos[2] + d.qpos[3], d.qpos[0], d.qpos[2]])
        for j in range(2):
            at, rate = rest(j, (i + 0.5) * step)
            d.qfrc_applied[2 * j] = DRIVE_N_M_RAD[j] * at + DAMPING_N_M_S_RAD[j] * rate
        mujoco.mj_step(m, d)
    return np.array(samples)


def main():
    # Both errors are of first order: extrapolated to no inertia and no step.
    coarse, fine, finest = (swing(2e-4 / n, 8e-6 / n) for n in (1, 2, 4))
    first, golden = 2 * fine - coarse, 2 * finest - fine
    left = np.abs(golden - first).max()
    print(f"halving inertia and step: {np.abs(finest - fine).max():.1e} rad, after extrapolation {left:.1e} rad")
    assert left < 1e-6, "the shafts weigh too much"
    out = ROOT / "tests" / "golden" / "structure.csv"
    head = f"# MuJoCo {mujoco.__version__}, make_structure_golden.py: time s; angles of links, then of shafts, rad\n"
    rows = "".join(",".join(f"{v:.10f}" for v in row) + "\n" for row in golden)
    out.write_text(head + "time_s,link_0,link_1,shaft_0,shaft_1\n" + rows)
    print(f"{out.relative_to(ROOT)}: {len(golden)} rows, links swing by {np.ptp(golden[:, 1]):.3f}, {np.ptp(golden[:, 2]):.3f} rad")


if __name__ == "__main__":
    main()
