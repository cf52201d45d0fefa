"""The exports of a calibration as Pinocchio and yourdfpy read them -> tests/golden/export/poses.json.

Runs the program (target/release/armcal, or the path given) on tests/golden/export/calibration.toml and compares with docs/reference/files.md,
carried out here: counts to angles, link corrections and camera mount on Pinocchio's model of the drawing.
"""

import csv
import json
import subprocess
import sys
import tempfile
import tomllib
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pinocchio
import yaml
import yourdfpy

ROOT = Path(__file__).resolve().parents[2]
OUT = ROOT / "tests" / "golden" / "export"
ROBOT = ROOT / "robots" / "titan4"
N_COMPARED = 1000
N_WRITTEN = 50
SEED = 20240331
L = 1.25


def export(program, form):
    command = [program, "export", OUT / "calibration.toml", "--as", form, "--robot", ROBOT]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def sensors(robot, model, calibration):
    """Datasheet and correction of each joint."""
    found = []
    for k, (spec, joint) in enumerate(zip(robot["joint_sensor"], calibration["joint"])):
        assert spec["joint"] == joint["name"] == model.names[k + 1]
        is_endless = model.joints[k + 1].nq == 2
        at = model.joints[k + 1].idx_q
        lower, upper = (-np.pi, np.pi) if is_endless else (model.lowerPositionLimit[at], model.upperPositionLimit[at])
        scale = np.degrees(spec["scale_counts_per_deg"])
        center = 0.0 if is_endless else 0.5 * (lower + upper)
        assert abs(center - joint["center_rad"]) < 1e-12
        found.append(
            {
                "name": joint["name"],
                "is_endless": is_endless,
                "scale": scale,
                "wrap": spec["wrap_counts"],
                "center": center,
                "center_counts": spec["offset_counts"] + scale * center,
                "half_rad": 0.5 * (upper - lower),
                "joint": joint,
            }
        )
    return found


def angle(sensor, counts, with_terms):
    """The equation of docs/reference/files.md at the reference's conditions."""
    joint = sensor["joint"]
    wrap = sensor["wrap"]
    travel = (counts - sensor["center_counts"] + 0.5 * wrap) % wrap - 0.5 * wrap
    theta = sensor["center"] + joint["offset_rad"] + joint["gain_rad_per_count"] * travel
    terms = joint.get("terms", {})
    if with_terms and "nonlinearity_rad" in terms:
        x = np.clip(travel / sensor["scale"] / terms["half_range_rad"], -1.0, 1.0)
        for h, a in enumerate(terms["nonlinearity_rad"], 1):
            theta += a * np.sin(np.pi * h * (x + L) / (2 * L)) / np.sqrt(L)
    return theta


def corrected(model, calibration):
    """The drawing's model with the link corrections."""
    for link in calibration["link"]:
        joint = model.getJointId(link["joint"])
        drawn = model.jointPlacements[joint]
        turn = pinocchio.exp3(np.array(link["turn_rad"]))
        model.jointPlacements[joint] = pinocchio.SE3(turn @ drawn.rotation, drawn.translation + link["shift_m"])
    return model


def poses(model, angles):
    q = np.concatenate(
        [[np.cos(t), np.sin(t)] if model.joints[i + 1].nq == 2 else [t] for i, t in enumerate(angles)]
    )
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, q)
    return data


def tool(robot, model, data):
    frame = data.oMf[model.getFrameId(robot["tool"]["link"])]
    return frame.act(np.array(robot["tool"]["point_m"]))


def documented_camera(robot, drawing, data, calibration):
    mount = calibration["camera_mount"]
    w, x, y, z = mount["quaternion_wxyz"]
    turn = pinocchio.Quaternion(w, x, y, z).normalized().matrix()
    joint = drawing.frames[drawing.getFrameId(robot["camera"]["link"])].parentJoint
    return data.oMi[joint] * pinocchio.SE3(turn, np.array(mount["position_m"]))


def rows(text):
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    table = {}
    for row in csv.DictReader(lines):
        table.setdefault(row["joint"], []).append((float(row["counts"]), float(row["angle_rad"])))
    return {name: np.array(points) for name, points in table.items()}


def interpolated(sensor, points, counts):
    low, high = points[0, 0], points[-1, 0]
    turns = np.ceil((low - counts) / sensor["wrap"])
    counts = counts + turns * sensor["wrap"]
    assert low <= counts <= high, (sensor["name"], counts)
    return np.interp(counts, points[:, 0], points[:, 1])


def transmissions(text):
    found = {}
    for one in ET.fromstring(text).iter("transmission"):
        assert one.find("plugin").text == "transmission_interface/SimpleTransmission"
        joint = one.find("joint")
        found[joint.get("name")] = [float(joint.find(key).text) for key in ("mechanical_reduction", "offset")]
    return found


def check_types(value):
    """ROS takes lists of one type, and numbers with a point for doubles; PyYAML reads `1e-7` as text."""
    if isinstance(value, dict):
        for item in value.values():
            check_types(item)
    elif isinstance(value, list):
        assert value and len({type(item) for item in value}) == 1 and isinstance(value[0], (str, float)), value
    else:
        assert isinstance(value, (str, float, int)), value


def check_yaml(program, known, calibration):
    """The parameters and the camchain as PyYAML, which ROS launch files and Kalibr use, reads them."""
    parameters = yaml.safe_load(export(program, "ros-parameters"))["/**"]["ros__parameters"]["calibration"]
    check_types(parameters)
    assert parameters["joints"] == [sensor["name"] for sensor in known]
    for sensor in known:
        found, joint = parameters[sensor["name"]], sensor["joint"]
        assert abs(found["center_counts"] - sensor["center_counts"]) < 1e-6
        keys = ["center_rad", "gain_rad_per_count", "offset_rad"]
        assert [found[key] for key in keys] == [joint[key] for key in keys]
        terms = joint.get("terms", {})
        for key, value in found.get("terms", {}).items():
            assert key == "counts_per_rad" or terms[key] == value, key
    camera = yaml.safe_load(export(program, "kalibr"))["cam0"]
    assert all(isinstance(value, float) for key in ("intrinsics", "distortion_coeffs") for value in camera[key])
    pose = np.array(camera["T_link_camera"])
    assert np.abs(pose[:3, 3] - calibration["camera_mount"]["position_m"]).max() < 1e-12
    assert np.abs(pose[:3, :3] @ pose[:3, :3].T - np.eye(3)).max() < 1e-12


def main():
    program = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "target" / "release" / "armcal"
    robot = tomllib.loads((ROBOT / "robot.toml").read_text())
    calibration = tomllib.loads((OUT / "calibration.toml").read_text())
    drawing_model = pinocchio.buildModelFromUrdf(str(ROBOT / robot["urdf"]))
    known = sensors(robot, drawing_model, calibration)
    drawing_model = corrected(drawing_model, calibration)
    camera_link = robot["camera"]["link"]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "calibrated.urdf"
        file.write_text(export(program, "urdf"))
        model = pinocchio.buildModelFromUrdf(str(file))
        by_name = yourdfpy.URDF.load(str(file), load_meshes=False, build_scene_graph=True)
    table, gears = rows(export(program, "table")), transmissions(export(program, "ros2-control"))

    check_yaml(program, known, calibration)
    rng = np.random.default_rng(SEED)
    worst = dict.fromkeys(["tool_m", "camera_m", "camera_rad", "yourdfpy", "transmission_rad", "table_m"], 0.0)
    cases = []
    for _ in range(N_COMPARED):
        travel = [rng.uniform(-s["half_rad"], s["half_rad"]) for s in known]
        counts = [(s["center_counts"] + s["scale"] * t) % s["wrap"] for s, t in zip(known, travel)]
        theta = [angle(s, c, True) for s, c in zip(known, counts)]
        straight = [angle(s, c, False) for s, c in zip(known, counts)]
        geared = [(s["center"] + t) / gears[s["name"]][0] + gears[s["name"]][1] for s, t in zip(known, travel)]
        by_table = [interpolated(s, table[s["name"]], c) for s, c in zip(known, counts)]

        data, drawn = poses(model, theta), poses(drawing_model, theta)
        at, camera = tool(robot, model, data), data.oMf[model.getFrameId(camera_link)]
        expected = documented_camera(robot, drawing_model, drawn, calibration)
        off = expected.actInv(camera)
        by_name.update_cfg(dict(zip([s["name"] for s in known], theta)))
        scene = by_name.get_transform(camera_link, robot["base_link"])
        for key, value in {
            "tool_m": np.linalg.norm(at - tool(robot, drawing_model, drawn)),
            "camera_m": np.linalg.norm(off.translation),
            "camera_rad": np.linalg.norm(pinocchio.log3(off.rotation)),
            "yourdfpy": np.abs(scene - camera.homogeneous).max(),
            "transmission_rad": np.abs(np.subtract(geared, straight)).max(),
            "table_m": np.linalg.norm(tool(robot, model, poses(model, by_table)) - at),
        }.items():
            worst[key] = max(worst[key], float(value))
        cases.append(
            {
                "counts": counts,
                "joint_angles_rad": theta,
                "straight_angles_rad": straight,
                "tool_point_in_base_m": at.tolist(),
                "base_from_camera": {
                    "position_m": camera.translation.tolist(),
                    "rotation_matrix_rows": camera.rotation.tolist(),
                },
            }
        )
    for key, value in worst.items():
        print(f"{key}: {value:.3g} at most, of {N_COMPARED}")
    assert worst["tool_m"] < 1e-6 and worst["camera_m"] < 1e-6 and worst["camera_rad"] < 1e-6
    assert worst["yourdfpy"] < 1e-9 and worst["transmission_rad"] < 1e-9 and worst["table_m"] < 2e-5
    write(cases[:N_WRITTEN], worst, [s["name"] for s in known])


def write(cases, worst, joints):
    golden = {
        "what": "calibration.toml beside this file on robots/titan4: counts to angles by docs/reference/files.md (joint_angles_rad; without terms: "
        "straight_angles_rad), tool point and camera by Pinocchio on the exported URDF. Base frame.",
        "tool": "pinocchio, yourdfpy",
        "tool_version": f"{pinocchio.__version__}, {yourdfpy.__version__}",
        "seed": SEED,
        "compared": N_COMPARED,
        "worst": worst,
        "joint_names": joints,
    }
    lines = ",\n".join("  " + json.dumps(case) for case in cases)
    text = json.dumps(golden, indent=1)[:-2] + ',\n "cases": [\n' + lines + "\n ]\n}\n"
    (OUT / "poses.json").write_text(text)


if __name__ == "__main__":
    main()
