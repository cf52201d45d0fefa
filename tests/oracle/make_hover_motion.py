"""A made-up vehicle hovering in swell -> routines/motion/hover.csv.

SYNTHETIC: no vehicle was recorded. Swell moves every axis by 30 sinusoids from a JONSWAP spectrum (peak period 9 s, gamma 3.3; Hasselmann et
al. 1973) with random phases, as a depth of some metres below the surface leaves it (periods under 4 s left out); the station keeping
wanders in x, y and yaw by slow sinusoids of 50 to 200 s. The standard deviations below are met exactly over the ten minutes.
"""

from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
SEED = 20240120
DURATION_S, RATE_HZ = 600.0, 5.0
PEAK_PERIOD_S, GAMMA = 9.0, 3.3
N_SWELL, N_WANDER = 30, 8
DEG = np.pi / 180.0
# Standard deviations: swell, wander. m, then rad; assumed, for a calm hover.
AXES = {
    "x_m": (0.03, 0.04),
    "y_m": (0.03, 0.04),
    "z_m": (0.05, 0.0),
    "roll_rad": (1.0 * DEG, 0.0),
    "pitch_rad": (1.0 * DEG, 0.0),
    "yaw_rad": (0.3 * DEG, 2.0 * DEG),
}


def jonswap(frequency_hz):
    """Shape only; the scale comes after."""
    peak = 1.0 / PEAK_PERIOD_S
    width = np.where(frequency_hz <= peak, 0.07, 0.09)
    growth = np.exp(-((frequency_hz - peak) ** 2) / (2.0 * (width * peak) ** 2))
    return frequency_hz**-5.0 * np.exp(-1.25 * (peak / frequency_hz) ** 4) * GAMMA**growth


def series(times, frequency_hz, weight, rng, rms):
    phase = rng.uniform(0.0, 2.0 * np.pi, frequency_hz.size)
    x = (np.sqrt(weight)[:, None] * np.sin(2.0 * np.pi * frequency_hz[:, None] * times + phase[:, None])).sum(axis=0)
    x -= x.mean()
    return x * rms / x.std()


def main():
    rng = np.random.default_rng(SEED)
    times = np.arange(int(DURATION_S * RATE_HZ) + 1) / RATE_HZ
    edges = np.linspace(1.0 / 16.0, 1.0 / 4.0, N_SWELL + 1)
    swell = edges[:-1] + rng.uniform(0.0, 1.0, N_SWELL) * np.diff(edges)
    wander = 1.0 / np.exp(rng.uniform(np.log(50.0), np.log(200.0), N_WANDER))
    columns = []
    for name, (by_swell, by_wander) in AXES.items():
        x = series(times, swell, jonswap(swell), rng, by_swell)
        if by_wander > 0.0:
            x = x + series(times, wander, np.ones(N_WANDER), rng, by_wander)
        columns.append(x)
    lines = ["# Synthetic: a hover in swell made by tests/oracle/make_hover_motion.py, no recording of a vehicle."]
    lines.append(",".join(["time_s", *AXES]))
    for row in zip(times, *columns):
        lines.append(f"{row[0]:.1f}," + ",".join(f"{v:.5f}" for v in row[1:4]) + "," + ",".join(f"{v:.6f}" for v in row[4:]))
    out = ROOT / "routines" / "motion" / "hover.csv"
    out.parent.mkdir(exist_ok=True)
    out.write_text("\n".join(lines) + "\n")
    print(f"{out.relative_to(ROOT)}: {times.size} samples, {out.stat().st_size // 1000} kB")
    for name, x in zip(AXES, columns):
        print(f"  {name}: {x.std():.4f} rms, largest {np.abs(x).max():.4f}")


if __name__ == "__main__":
    main()
