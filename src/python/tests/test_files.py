"""Files that the module reads and writes, and the command beside the program of the same profile."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import armcal
from conftest import CORNER_STD_PX, tool_m

ROOT = Path(__file__).parents[3]


def test_a_calibration_is_saved_loaded_and_exported(robot, cal, tmp_path, tags, task, measured):
    folder = cal.save(tmp_path / "result")
    assert folder == tmp_path / "result"
    assert {f.name for f in folder.iterdir()} >= {"calibration.toml", "calibration.covariance.toml", "summary.json", "report.html"}
    loaded = armcal.Calibration.load(folder / "calibration.toml", robot)
    assert np.allclose(loaded.gain, cal.gain, rtol=1e-12) and np.allclose(loaded.covariance, cal.covariance)
    assert loaded.verdict.grade == cal.verdict.grade
    for form in ("urdf", "table", "yaml", "csv", "compact"):
        cal.export(form, tmp_path / form)
        assert (tmp_path / form).stat().st_size > 100
    cal.report(tmp_path / "report.html")
    assert (tmp_path / "report.html").read_text().startswith("<!DOCTYPE html>")
    again = armcal.calibrate(robot, armcal.Views.from_arrays(robot, **measured.arrays()), tags=tags, task=task)
    assert np.array_equal(again.covariance, cal.covariance)


def test_a_recording_gives_the_files_of_the_program(program, tmp_path):
    robot = armcal.Robot.load("titan4")
    recording = armcal.Recording.open(ROOT / "recordings/sample/run.mcap", robot)
    assert len(recording.views()) >= 10
    armcal.calibrate(robot, recording.views()).save(tmp_path / "module")
    command = [program, "calibrate", ROOT / "recordings/sample/run.mcap", "--robot", ROOT / "robots/titan4", "--out", tmp_path / "program"]
    subprocess.run(command, check=True, capture_output=True)
    for name in ("calibration.toml", "calibration.covariance.toml"):
        assert (tmp_path / "module" / name).read_bytes() == (tmp_path / "program" / name).read_bytes(), name


# The module's functions of sine and logarithm are its own, whatever else the process has loaded.
RUN = "import numpy, sys, armcal; armcal.simulate('titan4-quickstart', seed=1, out=sys.argv[1])"


def test_a_run_has_the_bytes_of_the_program(program, tmp_path):
    subprocess.run([sys.executable, "-c", RUN, tmp_path / "module"], check=True)
    command = [sys.executable, "-m", "armcal", "run", "titan4-quickstart", "--seed", "1", "--out", tmp_path / "command"]
    subprocess.run(command, check=True, capture_output=True)
    subprocess.run([program, "run", ROOT / "routines/titan4-quickstart.toml", "--seed", "1", "--out", tmp_path / "program"],
                   check=True, capture_output=True)
    for name in ("calibration.toml", "calibration.covariance.toml", "run.mcap", "truth.mcap", "run.rrd"):
        expected = (tmp_path / "program" / name).read_bytes()
        assert (tmp_path / "module" / name).read_bytes() == expected, name
        assert (tmp_path / "command" / name).read_bytes() == expected, name


def test_exit_codes_and_streams_are_those_of_the_program():
    command = [sys.executable, "-m", "armcal", "calibrate", "no-such-file.mcap", "--robot", "titan4"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 2 and "no-such-file.mcap" in done.stderr and not done.stdout


def test_a_follower_learns_what_a_calibration_does(measured, robot, tags, task, cal):
    follower = armcal.Follower(robot, tags=tags, task=task)
    assert follower.belief is None and follower.n_views == 0 and follower.u95_m(measured.counts[0]) is None
    rng = np.random.default_rng(1)
    for k, counts in enumerate(measured.counts):
        at_s = 1.8e9 + 5.0 * k
        seen = {int(tag): px for view, tag, px in zip(measured.view, measured.tag, measured.corners_px) if view == k}
        for step in range(40):
            follower.push({"t_s": at_s + 0.05 * step, "counts": counts + rng.normal(0, 0.5, 6)})
            if step % 10 == 5:
                noisy = {tag: px + rng.normal(0, CORNER_STD_PX, (4, 2)) for tag, px in seen.items()}
                follower.push({"t_s": at_s + 0.05 * step, "tags": noisy})
        follower.rest(at_s, at_s + 0.05 * step)
    follower.finish()
    assert follower.n_views == len(measured.counts) and follower.belief["views"] == follower.n_views
    datasheet = armcal.Follower(robot, tags=tags)
    for counts in measured.counts[:5]:
        off_m, before_m = (np.linalg.norm(robot.tool_pose(f.angles(counts))[:3, 3] - tool_m(measured.true_angles(counts)))
                           for f in (follower, datasheet))
        assert off_m < follower.u95_m(counts) < 0.003 and off_m < 0.1 * before_m
    begun = armcal.Follower(robot, cal, tags=tags)
    assert begun.n_views == 0


def test_a_run_that_is_not_kept_is_there_as_long_as_its_object():
    run = armcal.simulate("titan4-quickstart", seed=2, set={"capture.poses": 20})
    assert run.summary["status"] == "accepted" and Path(run.recording).is_file()
    folder = run.folder
    del run
    assert not folder.exists()


@pytest.mark.parametrize("prior", [False, True])
def test_a_plan_needs_no_file(prior):
    run = armcal.simulate("titan4-quickstart", seed=3, set={"capture.poses": 12}) if prior else None
    robot = armcal.Robot.load("titan4")
    plan = armcal.plan(robot, armcal.Task([[0.9, 1.1, 0.2]], 0.02), prior=run.calibration if run else None, poses=4)
    assert plan["robot"] == "titan4" and len(plan["pose"]) >= 4
