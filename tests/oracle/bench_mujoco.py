"""Steps per second of MuJoCo on robots/titan4, beside those of armcal's own dynamics; one core, one run, one machine.

MuJoCo gets the same URDF, a step of 2 ms, its `implicitfast` integrator, a spring and a damper at
each joint as stiff as the closed oil columns, gravity, and the drives' torques moving slowly; no shapes, contacts or limits. armcal's
figures come from `cargo bench --bench speed -- "physics:|dynamics:"`: the same arm without water, which is what MuJoCo computes; with the
water (buoyancy, added mass, drag); and, "physics: one second, all effects", with hydraulics and sensors as well.

    target/oracle/bin/python tests/oracle/bench_mujoco.py               MuJoCo alone
    target/oracle/bin/python tests/oracle/bench_mujoco.py --with-armcal both, and their ratio
"""

import argparse
import json
import os
import statistics
import subprocess
import time
from pathlib import Path

import mujoco
import numpy as np

from make_dynamics_golden import Arm, Engine, start

ROOT = Path(__file__).resolve().parents[2]
STEP_S = 0.002
STEPS_A_CALL = 500
ROUNDS = 60
# The standard world's hydraulics: docs/theory/simulation.md.
SUPPLY_PRESSURE_PA = 2.07e7
BULK_MODULUS_PA = 1e9
DEAD_VOLUME_RATIO = 2.0
DAMPING_S = 0.01
ONE_SECOND = "physics: one second, all effects"
ONE_STEP = "dynamics: one step"
DRY_STEP = "dynamics: one step, dry"


def oil_columns(arm):
    """Stiffness (N m/rad) and damping (N m s/rad) of each joint's closed oil column: K = 4 beta D^2/V, V = D range (1 + dead)."""
    displacement = arm.effort / SUPPLY_PRESSURE_PA
    stiffness = 4.0 * BULK_MODULUS_PA * displacement / ((arm.upper - arm.lower) * (1.0 + DEAD_VOLUME_RATIO))
    return stiffness, DAMPING_S * stiffness


def mujoco_steps_per_s(summary=statistics.median):
    """Of the rounds."""
    arm = Arm("titan4")
    engine = Engine(arm)
    model, data = engine.model, engine.data
    stiffness, damping = oil_columns(arm)
    model.opt.timestep = STEP_S
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    rest = start(arm)
    # Constraints stay off (no limits, no contacts); springs and dampers are passive forces, which stay on.
    assert not model.opt.disableflags & (mujoco.mjtDisableBit.mjDSBL_SPRING | mujoco.mjtDisableBit.mjDSBL_DAMPER)
    set_column(model.jnt_stiffness, stiffness)
    set_column(model.dof_damping, damping)
    model.qpos_spring[:] = rest
    data.qpos[:], data.qvel[:] = rest, 0.0
    rates = []
    for k in range(ROUNDS):
        data.qfrc_applied[:] = 0.1 * arm.effort * np.sin(0.3 * k + np.arange(6))
        begin = time.perf_counter()
        mujoco.mj_step(model, data, nstep=STEPS_A_CALL)
        rates.append(STEPS_A_CALL / (time.perf_counter() - begin))
    assert np.isfinite(data.qpos).all() and np.abs(data.qpos - rest).max() < 0.2, data.qpos - rest
    assert np.abs(data.qpos - rest).max() > 1e-4, "the columns must give way"
    return summary(rates)


def set_column(array, values):
    """A figure per joint; the array may hold further coefficients of a polynomial after it."""
    array[:] = 0.0
    if array.ndim == 1:
        array[:] = values
    else:
        array[:, 0] = values


def criterion_estimate_s(target, name):
    """Median time of one iteration, from criterion's file."""
    folder = name.replace(":", "_").replace("/", "_").replace("?", "_").replace("*", "_")
    file = target / "criterion" / folder / "new" / "estimates.json"
    return json.loads(file.read_text())["median"]["point_estimate"] * 1e-9


def armcal(target):
    subprocess.run(["cargo", "bench", "--bench", "speed", "--", "physics:|dynamics:"], cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
    second_s, step_s, dry_s = (criterion_estimate_s(target, name) for name in (ONE_SECOND, ONE_STEP, DRY_STEP))
    return {"armcal_simulated_s_per_s": 1.0 / second_s, "armcal_steps_per_s": 1.0 / step_s, "armcal_dry_steps_per_s": 1.0 / dry_s}


def main():
    parser = argparse.ArgumentParser(description="Speed of MuJoCo on the same arm.")
    parser.add_argument("--with-armcal", action="store_true", help="run armcal's benchmarks as well and print the ratio")
    arguments = parser.parse_args()
    # One core for everything that is timed; children inherit it.
    if hasattr(os, "sched_setaffinity") and not arguments.with_armcal:
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    result = {"mujoco": mujoco.__version__, "step_s": STEP_S, "mujoco_steps_per_s": mujoco_steps_per_s()}
    result["mujoco_simulated_s_per_s"] = result["mujoco_steps_per_s"] * STEP_S
    if arguments.with_armcal:
        target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
        result |= armcal(target)
        result["mujoco_after_steps_per_s"] = mujoco_steps_per_s()
        mean = 0.5 * (result["mujoco_steps_per_s"] + result["mujoco_after_steps_per_s"])
        result["ratio_dry_step_to_mujoco_step"] = result["armcal_dry_steps_per_s"] / mean
        result["ratio_dynamics_step_to_mujoco_step"] = result["armcal_steps_per_s"] / mean
        result["ratio_whole_physics_to_mujoco"] = result["armcal_simulated_s_per_s"] / (mean * STEP_S)
    print(json.dumps({k: float(f"{v:.4g}") if isinstance(v, float) else v for k, v in result.items()}, indent=1))


if __name__ == "__main__":
    main()
