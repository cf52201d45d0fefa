"""FIGAROH (PyPI) and armcal on recordings of real arms, held out in the measures of docs/reference/real-arms.md -> a table.

    arms.py ARMCAL DATA

DATA has franka_114.mcap and franka_nominal.urdf (github PhilNad/robot-arm-kinematic-calibration), ur10/ur10_23.mcap and
ur10/ur10_nominal.urdf (github thanhndv212/figaroh-plus): /joint_states in radians, and on /tf one pose of the board in the camera's
frame for each pose of the arm. Each fifth of the poses is held out in turn.

FIGAROH gets the pose of the camera in the board's frame, the frames of board and camera free, and its defaults beside: weights of 1 mm
and 10 mrad, samples more than 5 cm off left out. armcal gets what is written here of mount, board and links. Times: of the processor,
one fit; armcal's is the whole command with its cross-validation and report.
"""

import contextlib
import io
import json
import logging
import resource
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "tests/oracle"))
from compare_real_arms import read  # noqa: E402
from real_arms import ARMS, prepare  # noqa: E402

import matplotlib  # noqa: E402

matplotlib.use("Agg")
import pinocchio as pin  # noqa: E402
import yaml  # noqa: E402
from figaroh.calibration.base_calibration import BaseCalibration  # noqa: E402
from figaroh.calibration.calibration_tools import calc_updated_fkm  # noqa: E402
from figaroh.tools.robot import Robot  # noqa: E402

N_FOLDS = 5
# What a user would choose among: the level of its calibration, and how parameters are chosen.
WAYS = [
    ("joint offsets", "joint_offset", "structural"),
    ("all links, structural", "full_params", "structural"),
    ("all links, excitation", "full_params", "excitation"),
    ("all links, map", "full_params", "map"),
    ("all links, map_cv", "full_params", "map_cv"),
]


class Calibration(BaseCalibration):
    """Its documented recipe: residuals by the log map, weighted."""

    def cost_function(self, var):
        predicted = calc_updated_fkm(self.model, self.data, var, self.q_measured, self.calib_config)
        return self.apply_measurement_weighting(self._compute_logmap_residuals(self.PEE_measured, predicted))


def write_inputs(folder, rows, tool, level, method):
    """A table and a configuration as FIGAROH reads them; rows of joint readings by name and board_from_camera."""
    names = sorted(rows[0][0])
    header = ["x1", "y1", "z1", "phix1", "phiy1", "phiz1"] + names
    lines = [",".join(header)]
    for readings, board_from_camera in rows:
        pose = list(board_from_camera[:3, 3]) + list(pin.rpy.matrixToRpy(board_from_camera[:3, :3]))
        lines.append(",".join(repr(float(v)) for v in pose + [readings[name] for name in names]))
    (folder / "data.csv").write_text("\n".join(lines) + "\n")
    config = {
        "robot": {"name": "arm"},
        "tasks": {
            "calibration": {
                "enabled": True,
                "type": "kinematic_calibration",
                "parameters": {"calibration_level": level, "estimation": {"method": method}},
                "kinematics": {"base_frame": "universe", "tool_frame": tool},
                "measurements": {"markers": [{"measurable_dof": [True] * 6}]},
                "data": {"source_file": str(folder / "data.csv"), "number_of_samples": len(rows)},
            }
        },
    }
    (folder / "config.yaml").write_text(yaml.safe_dump(config))
    return folder / "config.yaml"


# Nobody knows where the board is, nor where the camera sits.
FREE = {"known_baseframe": False, "known_tipframe": False}


def fitted(urdf, tool, rows, way, settings):
    """A fit of one way (level, method), with settings of FIGAROH beside its defaults."""
    with tempfile.TemporaryDirectory() as folder:
        config = write_inputs(Path(folder), rows, tool, *way)
        calibration = Calibration(Robot(str(urdf), package_dirs=[]), str(config))
        calibration.calib_config.update(settings)
        calibration.initialize()
        calibration.solve(enable_logging=False)
    return calibration


def pose_of(six):
    """Of x, y, z and angles about the fixed axes."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = pin.rpy.rpyToMatrix(*six[3:]), six[:3]
    return matrix


def predicted(calibration, rows):
    """board_from_camera of rows that the fit has not seen."""
    q = np.tile(np.asarray(calibration.calib_config["q0"], float), (len(rows), 1))
    for k, (readings, _) in enumerate(rows):
        for joint in calibration.calib_config["actJoint_idx"]:
            q[k, calibration.model.joints[joint].idx_q] = readings[calibration.model.names[joint]]
    config = dict(calibration.calib_config, NbSample=len(rows))
    flat = calc_updated_fkm(calibration.model, calibration.data, calibration.LM_result.x, q, config)
    return [pose_of(column) for column in flat.reshape(6, len(rows)).T]


def errors_mm(measured, found):
    """The camera seen from the board, the board seen from the camera."""
    camera = np.linalg.norm(measured[:3, 3] - found[:3, 3])
    board = np.linalg.norm(np.linalg.inv(measured)[:3, 3] - np.linalg.inv(found)[:3, 3])
    return 1e3 * camera, 1e3 * board


def held_out(urdf, rows, tool, level, method):
    errors, parameters = [], 0
    for fold in range(N_FOLDS):
        train = [row for k, row in enumerate(rows) if k % N_FOLDS != fold]
        test = [row for k, row in enumerate(rows) if k % N_FOLDS == fold]
        calibration = fitted(urdf, tool, train, (level, method), FREE)
        parameters = max(parameters, len(calibration.LM_result.x))
        errors += [errors_mm(row[1], found) for row, found in zip(test, predicted(calibration, test))]
    return np.array(errors), parameters


def row(name, what, errors, more):
    mean, rms = errors.mean(axis=0), np.sqrt((errors ** 2).mean(axis=0))
    print(f"| {name} | {what} | {mean[0]:.2f} | {mean[1]:.2f} | {rms[1]:.2f} | {more} |", flush=True)


def figaroh_rows(name, rows, urdf, tool):
    for what, level, method in WAYS:
        began = time.process_time()
        try:
            with contextlib.redirect_stdout(io.StringIO()):
                errors, parameters = held_out(urdf, rows, tool, level, method)
        except Exception as error:  # noqa: BLE001 whatever it is, the row says so
            print(f"| {name} | FIGAROH, {what} | - | - | - | {type(error).__name__}: {str(error)[:80]} | |", flush=True)
            continue
        row(name, f"FIGAROH, {what}", errors, f"{parameters} | {(time.process_time() - began) / N_FOLDS:.1f}")


def armcal_row(armcal, data, arm):
    name, recording, *_ = arm
    run = lambda *words: subprocess.run([armcal, *map(str, words)], check=True, capture_output=True)
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        prepare(armcal, data, arm, folder)
        run("inspect", data / recording, "--robot", folder / "robot", "--write-input", folder / "map.toml")
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        run("calibrate", data / recording, "--robot", folder / "robot", "--input", folder / "map.toml", "--tag-map", folder / "tags.toml",
            "--out", folder / "out")
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        held = json.loads((folder / "out/summary.json").read_text())["held_out"]
    figures = " | ".join(f"{1e3 * held[key]:.2f}" for key in ("camera_mean_m", "mean_m", "rms_m"))
    print(f"| {name} | armcal | {figures} | | {after.ru_utime - before.ru_utime:.1f} |", flush=True)


def main(armcal, data):
    logging.disable(logging.CRITICAL)
    warnings.simplefilter("ignore")
    data = Path(data)
    print("| arm | fit | camera from the board, mean, mm | board from the camera, mean, mm | rms, mm | parameters | s |")
    print("|---|---|--:|--:|--:|--:|--:|", flush=True)
    for arm in ARMS:
        name, recording, urdf, tool, *_ = arm
        readings, seen = read(data / recording)
        figaroh_rows(name, list(zip(readings, np.linalg.inv(seen))), data / urdf, tool)
        armcal_row(armcal, data, arm)


if __name__ == "__main__":
    main(*sys.argv[1:])
