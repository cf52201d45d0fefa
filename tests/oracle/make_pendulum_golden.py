"""A pendulum on a shaken base by a fourth-order Runge-Kutta of a tiny step -> tests/golden/pendulum.json.

A uniform rod hangs from a hinge (axis y) on a base that moves along x as
    x_base(t) = amplitude * sin(2 pi frequency t + phase).
In the base's frame, with theta from straight down, positive toward +x (the centre of mass at x = c sin theta, z = -c cos theta):
    inertia_about_hinge * theta'' = -mass * c * (gravity * sin theta + x_base'' * cos theta).
At t = 0 the rod is at rest relative to the base. On a base at rest the angle never leaves +-initial angle; shaken, the rod goes over
the top several times. `sensitivity` is d theta(end) / d theta(0): small enough that a good integrator must arrive at the same turn.
"""

import json
from math import cos, pi, sin
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
MASS_KG = 2.0
LENGTH_M = 1.0
COM_TO_HINGE_M = LENGTH_M / 2.0
INERTIA_KG_M2 = MASS_KG * LENGTH_M**2 / 3.0
AMPLITUDE_M = 0.3
FREQUENCY_HZ = 0.5
PHASE_RAD = 0.0
GRAVITY_M_S2 = 9.81
INITIAL_ANGLE_RAD = 0.5
DURATION_S = 10
SAMPLES_PER_S = 10
STEPS_PER_SAMPLE = 2000


def swing(initial_angle_rad, amplitude_m, steps_per_sample):
    omega = 2.0 * pi * FREQUENCY_HZ
    torque_arm = MASS_KG * COM_TO_HINGE_M / INERTIA_KG_M2
    step = 1.0 / (SAMPLES_PER_S * steps_per_sample)

    def acceleration(t, theta):
        base = -amplitude_m * omega**2 * sin(omega * t + PHASE_RAD)
        return -torque_arm * (GRAVITY_M_S2 * sin(theta) + base * cos(theta))

    theta, rate, samples = initial_angle_rad, 0.0, []
    for i in range(DURATION_S * SAMPLES_PER_S * steps_per_sample + 1):
        if i % steps_per_sample == 0:
            samples.append((i * step, theta, rate))
        t = i * step
        k1, l1 = rate, acceleration(t, theta)
        k2, l2 = rate + step / 2 * l1, acceleration(t + step / 2, theta + step / 2 * k1)
        k3, l3 = rate + step / 2 * l2, acceleration(t + step / 2, theta + step / 2 * k2)
        k4, l4 = rate + step * l3, acceleration(t + step, theta + step * k3)
        theta += step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        rate += step / 6 * (l1 + 2 * l2 + 2 * l3 + l4)
    return samples


def main():
    samples = swing(INITIAL_ANGLE_RAD, AMPLITUDE_M, STEPS_PER_SAMPLE)
    coarse = swing(INITIAL_ANGLE_RAD, AMPLITUDE_M, STEPS_PER_SAMPLE // 2)
    nudge = 1e-6
    nudged = swing(INITIAL_ANGLE_RAD + nudge, AMPLITUDE_M, STEPS_PER_SAMPLE // 2)
    still = swing(INITIAL_ANGLE_RAD, 0.0, STEPS_PER_SAMPLE // 10)
    golden = {
        "what": "Uniform rod on a hinge (axis y), base shaken along x: x = amplitude sin(2 pi frequency t + phase). Angle from straight down, "
        "positive toward +x, in the base's frame; at rest relative to the base at the start. No damping.",
        "tool": "make_pendulum_golden.py, Runge-Kutta 4",
        "step_s": 1.0 / (SAMPLES_PER_S * STEPS_PER_SAMPLE),
        "step_halving_difference_rad": abs(samples[-1][1] - coarse[-1][1]),
        "sensitivity_end_to_initial_angle": (nudged[-1][1] - coarse[-1][1]) / nudge,
        "mass_kg": MASS_KG,
        "length_m": LENGTH_M,
        "center_of_mass_to_hinge_m": COM_TO_HINGE_M,
        "inertia_about_hinge_kg_m2": INERTIA_KG_M2,
        "amplitude_m": AMPLITUDE_M,
        "frequency_hz": FREQUENCY_HZ,
        "phase_rad": PHASE_RAD,
        "gravity_m_s2": GRAVITY_M_S2,
        "initial_angle_rad": INITIAL_ANGLE_RAD,
        "initial_rate_rad_s": 0.0,
        "duration_s": float(DURATION_S),
        "end_angle_rad": samples[-1][1],
        "largest_angle_on_still_base_rad": max(abs(s[1]) for s in still),
        "columns": ["time_s", "angle_rad", "rate_rad_s"],
    }
    rows = ",\n".join("  " + json.dumps([round(t, 9), a, r]) for t, a, r in samples)
    out = ROOT / "tests" / "golden" / "pendulum.json"
    out.write_text(json.dumps(golden, indent=1)[:-2] + ',\n "samples": [\n' + rows + "\n ]\n}\n")
    print(f"{out.relative_to(ROOT)}: end {samples[-1][1]:.6f} rad, sensitivity {golden['sensitivity_end_to_initial_angle']:.1f}")


if __name__ == "__main__":
    main()
