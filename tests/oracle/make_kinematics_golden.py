"""Link poses, tool point, camera and Jacobians of the robots by Pinocchio -> tests/golden/kinematics*.json."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pinocchio

ROOT = Path(__file__).resolve().parents[2]
ROBOTS = {
    "robots/titan4": "kinematics.json",
    "robots/kraft-predator": "kinematics-kraft-predator.json",
    "tests/golden/slides": "kinematics-slides.json",
}
N_RANDOM = 49
SEED = 20240117


def pose(transform):
    return {
        "position_m": transform.translation.tolist(),
        "rotation_matrix_rows": transform.rotation.tolist(),
    }


def main():
    for name, out in ROBOTS.items():
        make(name, ROOT / "tests" / "golden" / out)


def make(name, out):
    folder = ROOT / name
    robot = tomllib.loads((folder / "robot.toml").read_text())
    model = pinocchio.buildModelFromUrdf(str(folder / robot["urdf"]))
    tool_link = model.getFrameId(robot["tool"]["link"])
    tool_in_link = pinocchio.SE3(np.eye(3), np.array(robot["tool"]["point_m"]))
    parent = model.frames[tool_link].parentJoint
    tool_frame = model.addFrame(
        pinocchio.Frame(
            "tool_point", parent, tool_link, model.frames[tool_link].placement * tool_in_link, pinocchio.FrameType.OP_FRAME
        )
    )
    data = model.createData()
    joints = [s["joint"] for s in robot["joint_sensor"]]
    assert joints == [model.names[i] for i in range(1, model.njoints)]

    continuous = [model.joints[i].nq == 2 for i in range(1, model.njoints)]
    lower = [(-np.pi if c else model.lowerPositionLimit[model.joints[i + 1].idx_q]) for i, c in enumerate(continuous)]
    upper = [(np.pi if c else model.upperPositionLimit[model.joints[i + 1].idx_q]) for i, c in enumerate(continuous)]
    rng = np.random.default_rng(SEED)
    angles = [np.zeros(6)] + [rng.uniform(lower, upper) for _ in range(N_RANDOM)]
    links = [f.name for f in model.frames if f.type == pinocchio.FrameType.BODY]

    cases = []
    for theta in angles:
        q = np.concatenate([[np.cos(t), np.sin(t)] if c else [t] for t, c in zip(theta, continuous)])
        pinocchio.computeJointJacobians(model, data, q)
        pinocchio.framesForwardKinematics(model, data, q)
        jacobian = pinocchio.getFrameJacobian(model, data, tool_frame, pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        cases.append(
            {
                "joint_angles_rad": theta.tolist(),
                "base_from_link": {link: pose(data.oMf[model.getFrameId(link)]) for link in links},
                "tool_point_in_base_m": data.oMf[tool_frame].translation.tolist(),
                "base_from_camera": pose(data.oMf[model.getFrameId(robot["camera"]["link"])]),
                "tool_point_jacobian_rows": jacobian.tolist(),
            }
        )

    golden = {
        "what": f"Forward kinematics and geometric Jacobian of {name}/{robot['urdf']}. Base frame throughout. Jacobian: 6 x n_joints, "
        "rows vx vy vz (m per rad) then wx wy wz (rad per rad; of slides per m), of the tool point, in axes parallel to the base frame.",
        "tool": "pinocchio",
        "tool_version": pinocchio.__version__,
        "seed": SEED,
        "joint_names": joints,
        "tool_link": robot["tool"]["link"],
        "tool_point_in_link_m": robot["tool"]["point_m"],
        "cases": cases,
    }
    out.write_text(dump(golden))
    print(f"{out.relative_to(ROOT)}: {len(cases)} joint vectors")


def dump(golden):
    """One case per line, so that differences stay readable."""
    head = {k: v for k, v in golden.items() if k != "cases"}
    lines = ",\n".join("  " + json.dumps(c) for c in golden["cases"])
    return json.dumps(head, indent=1)[:-2] + ',\n "cases": [\n' + lines + "\n ]\n}\n"


if __name__ == "__main__":
    main()
