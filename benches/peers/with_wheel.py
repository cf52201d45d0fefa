"""The example of GTSAM's bundle (gtsam_bundle.py) and FIGAROH's of the UR10e (arms.py), written with armcal's wheel -> Markdown on stdout.

    with_wheel.py RECORDING DATA

RECORDING: a folder that `armcal run routines/titan4-quickstart.toml` made. DATA: as for arms.py. Same data, results side by side; lines are
those of each fit with its reading of the data, without blanks and comments.
"""

import contextlib
import inspect
import io
import logging
import sys
import tempfile
import time
import warnings
from pathlib import Path

import armcal
import numpy as np
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).parents[2] / "tests/oracle"))
ROOT = Path(__file__).resolve().parents[2]


def titan_by_armcal(drawing, views):
    """The views that gtsam_bundle.py takes, as arrays."""
    robot = armcal.Robot.load(ROOT / "robots/titan4")
    per_rad = [np.degrees(sensor["scale_counts_per_deg"]) for sensor in drawing.sensors]
    offset = [sensor["offset_counts"] for sensor in drawing.sensors]
    angles = np.array([drawing.center + view.travel for view in views])
    seen = [(k, tag, corners) for k, view in enumerate(views) for tag, corners in view.corners.items()]
    counts = np.zeros((len(views), len(robot.joints))) + 32768.0
    counts[:, :len(per_rad)] = offset + angles * per_rad
    view, tag, corners = zip(*seen)
    return armcal.calibrate(robot, armcal.Views.from_arrays(robot, counts=counts, view=view, tag=tag, corners_px=corners))


def ur10e_by_armcal(folder, robot):
    """FIGAROH's table: the camera in the board's frame (rotation Rz Ry Rx), and six joints."""
    rows = np.loadtxt(folder / "ur10/calibration.csv", delimiter=",", skiprows=1)
    board_from_camera = np.tile(np.eye(4), (len(rows), 1, 1))
    board_from_camera[:, :3, :3] = Rotation.from_euler("xyz", rows[:, 3:6]).as_matrix()
    board_from_camera[:, :3, 3] = rows[:, :3]
    board = np.array([[[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, -0.9], [0, 0, 0, 1.0]]])
    tags = armcal.TagMap.from_poses("base_link", [0], board, size_m=0.2, position_std_m=0.1, rotation_std_rad=0.05)
    n = np.arange(len(rows))
    views = armcal.Views.from_arrays(robot, angles_rad=rows[:, 6:12], view=n, tag=0 * n, poses=np.linalg.inv(board_from_camera))
    return armcal.calibrate(robot, views, tags=tags)


def lines(*parts):
    """Lines of code."""
    text = "\n".join(inspect.getsource(part) for part in parts)
    return sum(bool(line.strip()) and not line.strip().startswith(("#", '"""')) for line in text.splitlines())


def titan_rows(recording):
    """Tool errors at the rests after the run, by both."""
    import gtsam_bundle
    from recordings import Drawing, read, tool_errors_mm

    drawing = Drawing(ROOT / "robots/titan4")
    views, rests = read(recording, drawing)
    began = time.process_time()
    bundle = gtsam_bundle.Bundle(drawing, views, True).solve()
    yield "GTSAM", lines(gtsam_bundle.Bundle), tool_errors_mm(rests, bundle.tool), time.process_time() - began
    began = time.process_time()
    cal = titan_by_armcal(drawing, views)
    seconds = time.process_time() - began
    counts = np.array([(drawing.center + rest.travel) * [np.degrees(s["scale_counts_per_deg"]) for s in drawing.sensors] for rest in rests])
    counts = np.hstack([counts + [s["offset_counts"] for s in drawing.sensors], np.full((len(rests), 1), 32768.0)])
    tools = cal.tool_pose(counts)[:, :3, 3]
    yield "armcal", lines(titan_by_armcal), 1e3 * np.linalg.norm(tools - [rest.tool_m for rest in rests], axis=1), seconds


def ur10e_rows(data):
    """Camera in the board's frame, each fifth of the poses held out in turn, by both."""
    import arms

    level, method = arms.WAYS[1][1:]
    readings, seen = arms.read(data / "ur10/ur10_23.mcap")
    began = time.process_time()
    with contextlib.redirect_stdout(io.StringIO()):
        errors, _ = arms.held_out(data / "ur10/ur10_nominal.urdf", list(zip(readings, np.linalg.inv(seen))), "wrist_3_link", level, method)
    n_lines = lines(arms.Calibration, arms.write_inputs, arms.fitted, arms.predicted, arms.pose_of, arms.held_out)
    yield "FIGAROH", n_lines, errors[:, 0], time.process_time() - began
    with tempfile.TemporaryDirectory() as folder:
        arms.prepare(Path(sys.executable).with_name("armcal"), data, arms.ARMS[1], Path(folder))
        robot = armcal.Robot.load(Path(folder) / "robot")
    began = time.process_time()
    cal = ur10e_by_armcal(data, robot)
    yield "armcal", lines(ur10e_by_armcal), np.array([1e3 * cal.held_out["camera_mean_m"]]), time.process_time() - began


def main(recording, data):
    logging.disable(logging.CRITICAL)
    warnings.simplefilter("ignore")
    print("| data | tool | lines | error, mean, mm | largest, mm | s |\n|---|---|--:|--:|--:|--:|")
    rows = [("quickstart: tool", row) for row in titan_rows(Path(recording))] + [("UR10e: camera, held out", row) for row in ur10e_rows(Path(data))]
    for name, (tool, n, errors, seconds) in rows:
        largest = f"{errors.max():.2f}" if len(errors) > 1 else ""
        print(f"| {name} | {tool} | {n} | {errors.mean():.2f} | {largest} | {seconds:.1f} |", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
