"""Pinocchio and MuJoCo on robots/titan4, one core: how many accelerations and steps a second -> a table.

    rigid_bodies.py [SPEED]

Both get the same URDF, fixed base, gravity, no contacts, no limits, no water. Pinocchio's accelerations (articulated bodies, `aba`) are
counted in a batch of its own C++, on one thread, and called one by one from Python; it has no step of its own, so one is written as its
users do: `aba`, then `integrate`. MuJoCo's step (2 ms, `implicitfast`, springs and dampers as tests/oracle/bench_mujoco.py has them) runs
in its C, 500 a call. SPEED: armcal's built benchmark (`cargo bench --bench speed --no-run` says its name); its step has the water too, but for the dry one.
Best of rounds.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pinocchio as pin

sys.path.insert(0, str(Path(__file__).parents[2] / "tests/oracle"))
import bench_mujoco  # noqa: E402
from make_dynamics_golden import Arm, start  # noqa: E402

N, ROUNDS, STEP_S = 20_000, 15, 0.002


def states(arm):
    rng = np.random.default_rng(1)
    theta = rng.uniform(arm.lower, arm.upper, (N, len(arm.lower)))
    q = np.array([arm.q(row) for row in theta]).T
    v = rng.normal(0.0, 0.3, (arm.model.nv, N))
    tau = 0.1 * arm.effort[:, None] * rng.normal(size=(arm.model.nv, N))
    return np.asfortranarray(q), np.asfortranarray(v), np.asfortranarray(tau)


def batch(arm, q, v, tau):
    pool, out = pin.ModelPool(arm.model, 1), np.zeros((arm.model.nv, N), order="F")

    def run():
        pin.abaInParallel(1, pool, q, v, tau, out)
        return N

    run()
    assert np.allclose(out[:, 7], pin.aba(arm.model, arm.data, q[:, 7], v[:, 7], tau[:, 7]), rtol=1e-9)
    return run


def one_by_one(arm, q, v, tau):
    model, data, n = arm.model, arm.data, N // 10
    columns = [(q[:, k].copy(), v[:, k].copy(), tau[:, k].copy()) for k in range(n)]

    def run():
        for a, b, c in columns:
            pin.aba(model, data, a, b, c)
        return n

    return run


def euler(arm):
    model, data, n = arm.model, arm.data, N // 10
    hold = pin.computeGeneralizedGravity(model, data, arm.q(start(arm)))

    def run():
        q, v = arm.q(start(arm)), np.zeros(model.nv)
        for _ in range(n):
            v = v + STEP_S * pin.aba(model, data, q, v, hold)
            q = pin.integrate(model, q, STEP_S * v)
        assert np.isfinite(q).all()
        return n

    return run


def rate(run):
    began = time.process_time()
    return run() / (time.process_time() - began)


def armcal_steps_s(speed):
    """Seconds a step of each of its benchmarks whose name begins so: in water, and dry where it has that."""
    with tempfile.TemporaryDirectory() as folder:
        environment = dict(os.environ, CRITERION_HOME=folder)
        subprocess.run([speed, "--bench", bench_mujoco.ONE_STEP], env=environment, capture_output=True, check=True)
        out = {}
        for file in sorted(Path(folder).rglob("new/sample.json")):
            samples, name = json.loads(file.read_text()), json.loads((file.parent / "benchmark.json").read_text())["full_id"]
            out[name] = min(1e-9 * time / iters for time, iters in zip(samples["times"], samples["iters"]))
    if not out:
        raise SystemExit(f"{speed}: no benchmark `{bench_mujoco.ONE_STEP}`; build it with the simulator (default features)")
    return out


def main(speed=None):
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    arm = Arm("titan4")
    q, v, tau = states(arm)
    runs = {
        "Pinocchio, `aba`, its own batch": batch(arm, q, v, tau),
        "Pinocchio, `aba`, called from Python": one_by_one(arm, q, v, tau),
        "Pinocchio, `aba` and `integrate` from Python, a step of 2 ms": euler(arm),
    }
    best = {name: max(rate(run) for _ in range(ROUNDS)) for name, run in runs.items()}
    best["MuJoCo, a step of 2 ms, in its own loop"] = bench_mujoco.mujoco_steps_per_s(max)
    for name, seconds in (armcal_steps_s(speed) if speed else {}).items():
        best[f"armcal, `{name}`"] = 1.0 / seconds
    print("| what | thousand a second | us each |\n|---|--:|--:|")
    for name, value in best.items():
        print(f"| {name} | {value / 1e3:.0f} | {1e6 / value:.2f} |")


if __name__ == "__main__":
    main(*sys.argv[1:])
