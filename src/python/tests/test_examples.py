"""The examples as users run them."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np

EXAMPLES = Path(__file__).parents[3] / "examples/python"


def test_the_notebook_ends_in_a_report_of_an_accepted_arm(tmp_path, monkeypatch):
    shutil.copytree(EXAMPLES / "arm", tmp_path / "arm")
    monkeypatch.chdir(tmp_path)
    cells = json.loads((EXAMPLES / "table_to_report.ipynb").read_text())["cells"]
    names = {}
    for cell in cells:
        if cell["cell_type"] == "code":
            exec("".join(cell["source"]), names)
    cal = names["cal"]
    assert cal.status == "accepted" and cal.u95_m.max() < 0.005
    assert (tmp_path / "report.html").is_file() and (tmp_path / "result/calibration.toml").is_file()


def test_a_control_program_and_a_table_in_cpp_give_the_same_angles(tmp_path, cal, robot, measured):
    result = cal.save(tmp_path / "result")
    cal.export("table", tmp_path / "table.csv")
    reading = measured.counts[3]
    command = [sys.executable, EXAMPLES / "apply_calibration.py", robot.folder, result / "calibration.toml"]
    told = subprocess.run(command, input=" ".join(map(str, reading)) + "\n", capture_output=True, text=True, check=True).stdout
    assert f"{np.degrees(cal.angles(reading))[2]:.3f}" in told and "one sigma" in told
    program = tmp_path / "apply_table"
    subprocess.run(["c++", "-std=c++17", "-Wall", "-Werror", "-o", program, EXAMPLES / "apply_table.cpp"], check=True)
    for joint in range(5):
        command = [program, tmp_path / "table.csv", robot.joints[joint], str(reading[joint])]
        told = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        assert abs(float(told.split()[0]) - cal.angles(reading)[joint]) < 1e-4, robot.joints[joint]
    wrong = subprocess.run([program, tmp_path / "table.csv", "j9", "1"], capture_output=True, text=True)
    assert wrong.returncode == 2 and "j9" in wrong.stderr
