"""industrial_calibration (github ros-industrial) and armcal on the two of its data sets that a real robot made -> a table.

    industrial.py ARMCAL EXAMPLES HAND_EYE KINEMATIC

EXAMPLES: that repository's folder `examples`. HAND_EYE, KINEMATIC: programs with its library; README.md says how to build them. KINEMATIC
is its own example as it is. HAND_EYE is hand_eye.cpp beside this file: its `optimize`, fed with corners on stdin, for its own example
opens windows and finds its corners itself. Both tools get the same corners, by OpenCV.

Hand and eye: a ChArUco board on a robot's flange before a standing camera, 16 images. The data have the flange's poses and no joints. So
armcal, which is no tool for that, gets a drawing of six made-up joints that are those poses: three slides, three turns, gains and offsets
known to a millionth, for it refuses an arm without any joint to calibrate. Measured is how far corners are from where camera and board put
them, each fifth of the images held out in turn.

Kinematic: a two-axis positioner with a target before a standing camera, 205 poses. Their program prints how far the target is from where
its result has it, over the poses that it was fitted to; armcal says the same held out, each fifth in turn, which is harder.
"""

import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np
import yaml
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).parent))
from real_arms import positioner  # noqa: E402

N_FOLDS = 5
GUESS_STD_M, GUESS_STD_RAD = 0.1, 0.1
JOINTS = [("x", "prismatic", "1 0 0"), ("y", "prismatic", "0 1 0"), ("z", "prismatic", "0 0 1"), ("rz", "revolute", "0 0 1"),
          ("ry", "revolute", "0 1 0"), ("rx", "revolute", "1 0 0")]
SENSOR = """
[[joint_sensor]]
joint = "{name}"
kind = "encoder"
offset_counts = 0.0
{scale}
wrap_counts = 1e6
gain_std = 1e-6
offset_std_{unit} = 1e-6
gain_bound = 1e-5
offset_bound_{unit} = 1e-5
noise_std_counts = 1e-7
linearity_std_{unit} = 0.0
max_rate_{unit}_s = 0.5
"""


def board_of(spec):
    finder = spec["target_finder"]
    size = finder["cols"], finder["rows"]
    dictionary = cv2.aruco.getPredefinedDictionary(finder["dictionary"])
    return cv2.aruco.CharucoBoard(size, finder["chessboard_dim"], finder["aruco_marker_dim"], dictionary)


def images(folder, spec):
    """(flange's pose as x y z qx qy qz qw, corners by number) of each image that shows the board."""
    detector, out = cv2.aruco.CharucoDetector(board_of(spec)), []
    for row in spec["data"]:
        corners, ids, _, _ = detector.detectBoard(cv2.imread(str(folder / row["image"]), cv2.IMREAD_GRAYSCALE))
        at = yaml.safe_load((folder / row["pose"]).read_text())
        if ids is not None and len(ids) >= 6:
            seen = dict(zip(ids.ravel().tolist(), np.asarray(corners).reshape(-1, 2)))
            out.append(([at[key] for key in ("x", "y", "z", "qx", "qy", "qz", "qw")], seen))
    return out


def numbers(pose):
    return [pose[key] for key in ("x", "y", "z", "qx", "qy", "qz", "qw")]


def matrix(seven):
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = Rotation.from_quat(seven[3:]).as_matrix(), seven[:3]
    return out


def board_guess(spec):
    """Their guess of the board on the flange, for OpenCV's axes: theirs begin at the lower left and look the other way."""
    height = spec["target_finder"]["rows"] * spec["target_finder"]["chessboard_dim"]
    at = matrix(numbers(spec["target_mount_to_target_guess"])) @ matrix([0.0, height, 0.0, 1.0, 0.0, 0.0, 0.0])
    return [float(v) for v in (*at[:3, 3], *Rotation.from_matrix(at[:3, :3]).as_quat())]


def their_hand_eye(program, spec, views, corners):
    """base_from_camera and flange_from_board of their `optimize`."""
    lens = [spec["intrinsics"][key] for key in ("fx", "fy", "cx", "cy")]
    lines = [lens, numbers(spec["camera_mount_to_camera_guess"]), board_guess(spec), [len(views)]]
    for at, seen in views:
        lines += [at, [len(seen)]] + [[*seen[i], *corners[i]] for i in seen]
    text = "\n".join(" ".join(repr(float(v)) if not isinstance(v, int) else str(v) for v in line) for line in lines)
    said = subprocess.run([program], input=text, capture_output=True, text=True, check=True).stdout.split()
    values = [float(word) for word in said]
    return matrix(values[:7]), matrix(values[7:14])


def pixels(spec, base_from_camera, flange_from_board, view, corners):
    at, seen = view
    points = np.array([corners[i] for i in seen])
    place = np.linalg.inv(base_from_camera) @ matrix(at) @ flange_from_board
    points = points @ place[:3, :3].T + place[:3, 3]
    k = spec["intrinsics"]
    seen_at = np.array(list(seen.values()))
    return points[:, :2] / points[:, 2:] * [k["fx"], k["fy"]] + [k["cx"], k["cy"]] - seen_at


def theirs_held_out(program, spec, views, corners):
    out, everything = [], range(len(views))
    for fold in range(N_FOLDS):
        found = their_hand_eye(program, spec, [views[k] for k in everything if k % N_FOLDS != fold], corners)
        out += [pixels(spec, *found, views[k], corners) for k in everything if k % N_FOLDS == fold]
    fitted = their_hand_eye(program, spec, views, corners)
    inside = [pixels(spec, *fitted, view, corners) for view in views]
    rms = lambda rows: np.sqrt((np.concatenate(rows) ** 2).sum(axis=1).mean())
    return rms(inside), rms(out)


def write_arm(folder, spec, size):
    """A drawing whose joints are the flange's pose."""
    links = ["base_link"] + [f"after_{name}" for name, *_ in JOINTS[:-1]] + ["flange"]
    urdf = ['<robot name="flange">'] + [f'<link name="{link}"/>' for link in links]
    for (name, kind, axis), parent, child in zip(JOINTS, links, links[1:]):
        urdf.append(f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>'
                    '<limit lower="-4" upper="4" effort="1" velocity="1"/></joint>')
    (folder / "arm.urdf").write_text("\n".join(urdf + ["</robot>"]))
    k, camera = spec["intrinsics"], numbers(spec["camera_mount_to_camera_guess"])
    text = ['version = 1\nkind = "robot"\nname = "flange"\nurdf = "arm.urdf"\nbase_link = "base_link"\n[tool]\nlink = "flange"\npoint_m = [0.0, 0.0, 0.0]']
    for name, kind, _ in JOINTS:
        slides = kind == "prismatic"
        scale = "scale_counts_per_mm = 0.001" if slides else f"scale_counts_per_deg = {np.pi / 180!r}"
        text.append(SENSOR.format(name=name, scale=scale, unit="m" if slides else "rad"))
    x, y, z, w = np.array(camera[3:]) / np.linalg.norm(camera[3:])
    text.append(f"""[camera]
name = "standing"
link = "base_link"
position_m = {camera[:3]}
quaternion_wxyz = {[float(v) for v in (w, x, y, z)]}
mount_std_m = {GUESS_STD_M}
mount_std_rad = {GUESS_STD_RAD}
model = "pinhole"
resolution_px = {list(size)}
focal_px = [{k['fx']}, {k['fy']}]
center_px = [{k['cx']}, {k['cy']}]
focal_std = 0.0
center_std_px = 0.0
distortion = []
corner_std_px = 0.3
[geometry]
link_position_std_m = 0.0
link_rotation_std_rad = 0.0
tool_position_std_m = 0.0
""")
    (folder / "robot.toml").write_text("\n".join(text))


def write_views(folder, spec, views):
    lines = ["t,x,y,z,rz,ry,rx,corner,u,v"]
    for k, (at, seen) in enumerate(views):
        rx, ry, rz = Rotation.from_quat(at[3:]).as_euler("xyz")
        joints = [*at[:3], rz, ry, rx]
        lines += [",".join(repr(float(v)) for v in [10.0 * k, *joints]) + f",{i},{uv[0]!r},{uv[1]!r}" for i, uv in
                  ((i, [float(c) for c in uv]) for i, uv in seen.items())]
    (folder / "views.csv").write_text("\n".join(lines) + "\n")
    (folder / "map.toml").write_text("""version = 1
kind = "input"
[table]
time = { column = "t", unit = "s" }
[joint_sensors]
unit = "rad"
[tags]
child_frame = "board"
use = "board_corners"
[tags.columns]
id = "corner"
pixel = ["u", "v"]
""")
    finder, board = spec["target_finder"], board_guess(spec)
    x, y, z, w = np.array(board[3:]) / np.linalg.norm(board[3:])
    (folder / "board.toml").write_text(f"""version = 1
kind = "tag_map"
frame = "flange"
[[tag]]
name = "board"
squares = [{finder['cols']}, {finder['rows']}]
square_m = {finder['chessboard_dim']}
position_m = {board[:3]}
quaternion_wxyz = {[float(v) for v in (w, x, y, z)]}
position_std_m = {[GUESS_STD_M] * 3}
rotation_std_rad = {[GUESS_STD_RAD] * 3}
""")


def armcal_hand_eye(armcal, spec, views, size):
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        write_arm(folder, spec, size)
        write_views(folder, spec, views)
        words = [armcal, "calibrate", folder / "views.csv", "--robot", folder, "--input", folder / "map.toml", "--tag-map", folder / "board.toml",
                 "--out", folder / "out"]
        run = subprocess.run(words, capture_output=True, text=True)
        if run.returncode not in (0, 3, 4):
            raise RuntimeError(run.stderr.strip()[-400:])
        return json.loads((folder / "out/summary.json").read_text())


def hand_eye(armcal, examples, program):
    folder = examples / "data/test_set_charuco"
    spec = yaml.safe_load((folder / "cal_data.yaml").read_text())
    views = images(folder, spec)
    corners = board_of(spec).getChessboardCorners().astype(float)
    size = cv2.imread(str(folder / spec["data"][0]["image"]), cv2.IMREAD_GRAYSCALE).shape[::-1]
    inside, outside = theirs_held_out(program, spec, views, corners)
    print(f"| hand and eye, {len(views)} images | industrial_calibration | {inside:.2f} px rms | {outside:.2f} px rms |")
    summary = armcal_hand_eye(armcal, spec, views, size)
    print(f"| | armcal, {summary['status']} | {summary['calibration']['residual_rms_px']:.2f} px rms | {summary['held_out']['rms_px']:.2f} px rms |",
          flush=True)


def kinematic(armcal, examples, program):
    said = subprocess.run([program], capture_output=True, text=True, check=True).stdout
    mm = [1e3 * float(v) for v in re.findall(r"Position Difference Mean: (\S+)", said)]
    print(f"| positioner, 205 poses | industrial_calibration, joints and links | {mm[0]:.3f} mm mean | |")
    print(f"| | industrial_calibration, camera and target alone | {mm[1]:.3f} mm mean | |", flush=True)
    summary = positioner(armcal, examples / "data/kinematic_calibration/measurements.yaml")
    held, status = 1e3 * summary["held_out"]["mean_m"], summary["status"]
    print(f"| | armcal, {status} | | {held:.3f} mm mean |", flush=True)


def main(armcal, examples, hand_eye_program, kinematic_program):
    examples = Path(examples)
    print("| data | fit | fitted | held out |\n|---|---|--:|--:|")
    hand_eye(armcal, examples, hand_eye_program)
    kinematic(armcal, examples, kinematic_program)


if __name__ == "__main__":
    main(*sys.argv[1:])
