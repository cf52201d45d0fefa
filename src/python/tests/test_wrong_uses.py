"""Wrong uses: an exception with a remedy each, no crash and no hang of the interpreter."""

import copy
import os
import pickle
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import armcal

N, M = 5, 8
COUNTS = np.full((N, 6), 32768.0) + np.arange(N)[:, None]
VIEW, TAG = np.arange(M) % N, np.arange(M) // N
SQUARE = np.array([[600.0, 500.0], [680.0, 500.0], [680.0, 420.0], [600.0, 420.0]])
CORNERS = np.tile(SQUARE, (M, 1, 1))
POSES = np.tile(np.eye(4), (2, 1, 1))


def views(robot, **changed):
    arrays = {"counts": COUNTS, "view": VIEW, "tag": TAG, "corners_px": CORNERS} | changed
    return armcal.Views.from_arrays(robot, **{k: v for k, v in arrays.items() if v is not None})


def with_nan(array, at):
    array = np.array(array, dtype=float)
    array[at] = np.nan
    return array


def sheared():
    pose = np.tile(np.eye(4), (M, 1, 1))
    pose[0, 0, 1] = 0.5
    return pose


def tags_of(**changed):
    given = {"frame": "l0", "ids": [0, 1], "poses": POSES, "size_m": 0.15, "position_std_m": 0.001, "rotation_std_rad": 0.001} | changed
    return armcal.TagMap.from_poses(given.pop("frame"), given.pop("ids"), given.pop("poses"), **given)


# Name: what is done, and what the message says to do.
USES = {
    "no counts": (lambda r: views(r, counts=None), "counts or angles_rad"),
    "counts and angles": (lambda r: views(r, angles_rad=COUNTS), "either counts or angles_rad"),
    "five joints": (lambda r: views(r, counts=COUNTS[:, :5]), "a column each for the joints"),
    "one dimension": (lambda r: views(r, counts=COUNTS[0]), "a row each pose"),
    "three dimensions": (lambda r: views(r, counts=COUNTS[None]), "a row each pose"),
    "text as counts": (lambda r: views(r, counts=[["a"] * 6] * N), "real numbers"),
    "objects as counts": (lambda r: views(r, counts=np.full((N, 6), None)), "real numbers"),
    "complex counts": (lambda r: views(r, counts=COUNTS + 1j), "real numbers"),
    "bool counts": (lambda r: views(r, counts=COUNTS > 0), "real numbers"),
    "dates as counts": (lambda r: views(r, counts=np.full((N, 6), np.datetime64("2026-01-01"))), "real numbers"),
    "ragged counts": (lambda r: views(r, counts=[[1.0], [1.0, 2.0]]), "a row each pose"),
    "NaN in counts": (lambda r: views(r, counts=with_nan(COUNTS, (2, 3))), "leave such poses out"),
    "infinite counts": (lambda r: views(r, counts=COUNTS * np.inf), "leave such poses out"),
    "no poses": (lambda r: views(r, counts=np.empty((0, 6))), "but there are 0 poses"),
    "no tags": (lambda r: views(r, view=[], tag=[], corners_px=np.empty((0, 4, 2))), "at least three with tags"),
    "corners missing": (lambda r: views(r, corners_px=None), "give one of"),
    "corners and positions": (lambda r: views(r, positions_m=np.ones((M, 3))), "give one of"),
    "corners flat": (lambda r: views(r, corners_px=CORNERS.reshape(M, 8)), "(m, 4, 2)"),
    "corners of three points": (lambda r: views(r, corners_px=CORNERS[:, :3]), "(m, 4, 2)"),
    "NaN in corners": (lambda r: views(r, corners_px=with_nan(CORNERS, (1, 2, 0))), "leave such tags out"),
    "positions of two numbers": (lambda r: views(r, corners_px=None, positions_m=np.ones((M, 2))), "(m, 3)"),
    "poses of three rows": (lambda r: views(r, corners_px=None, poses=np.ones((M, 3, 4))), "(m, 4, 4)"),
    "poses that shear": (lambda r: views(r, corners_px=None, poses=sheared()), "give a rotation"),
    "poses of zeros": (lambda r: views(r, corners_px=None, poses=np.zeros((M, 4, 4))), "give a rotation"),
    "views too few": (lambda r: views(r, view=VIEW[:-1]), "the pose of each tag"),
    "tags too many": (lambda r: views(r, tag=np.arange(M + 1)), "the number of each tag"),
    "view beyond": (lambda r: views(r, view=VIEW + 3), "count them from 0"),
    "view negative": (lambda r: views(r, view=VIEW - 1), "from 0"),
    "view of halves": (lambda r: views(r, view=VIEW + 0.5), "from 0"),
    "tag negative": (lambda r: views(r, tag=TAG - 1), "from 0"),
    "tag twice in a view": (lambda r: views(r, tag=np.zeros(M, int)), "given twice"),
    "times too few": (lambda r: views(r, t_s=np.arange(N - 1)), "a time, s, each pose"),
    "oil too hot": (lambda r: views(r, oil_c=np.full(N, 300.0)), "or none"),
    "oil NaN": (lambda r: views(r, oil_c=with_nan(np.zeros(N), 1)), "or none"),
    "oil of one": (lambda r: views(r, oil_c=[3.0]), "each pose"),
    "times backwards": (lambda r: views(r, t_s=np.arange(N)[::-1]), "in the order of time"),
    "times in ms": (lambda r: views(r, t_s=np.arange(N) * 1e-3), "at least 0.3 s apart"),
    "times NaN": (lambda r: views(r, t_s=with_nan(np.arange(N), 2)), "give seconds"),
    "times in ns": (lambda r: views(r, t_s=1e18 + np.arange(N) * 1e9), "give seconds"),
    "task without tolerance": (lambda r: armcal.Task([[1, 0, 0]]), "give the largest error"),
    "task without targets": (lambda r: armcal.Task(tolerance_m=0.02), "there are no targets"),
    "task of no rows": (lambda r: armcal.Task(np.empty((0, 3)), 0.02), "there are no targets"),
    "targets of two numbers": (lambda r: armcal.Task([[1, 0]], 0.02), "(k, 3)"),
    "targets in mm": (lambda r: armcal.Task([[1000, 0, 0]], 0.02), "give metres"),
    "targets NaN": (lambda r: armcal.Task([[np.nan, 0, 0]], 0.02), "give metres"),
    "tolerance in mm": (lambda r: armcal.Task([[1, 0, 0]], 20), "1e-6 to 10 m"),
    "tolerance negative": (lambda r: armcal.Task([[1, 0, 0]], -0.02), "1e-6 to 10 m"),
    "tag map of shear": (lambda r: tags_of(poses=sheared()[:2]), "give a rotation"),
    "tag ids twice": (lambda r: tags_of(ids=[1, 1]), "give each tag once"),
    "tag ids too few": (lambda r: tags_of(ids=[1]), "the number of each tag"),
    "tag size 0": (lambda r: tags_of(size_m=0.0), "above 0"),
    "tag size in mm": (lambda r: tags_of(size_m=150), "at most 10"),
    "tag sigma NaN": (lambda r: tags_of(position_std_m=float("nan")), "above 0"),
    "tags of another frame": (lambda r: armcal.calibrate(r, views(r), tags=tags_of(frame="world")), "l0"),
    "robot of no folder": (lambda r: armcal.Robot.load("no-such-robot"), "no-such-robot"),
    "tag map of no file": (lambda r: armcal.TagMap.load("no-such.toml"), "no-such.toml"),
    "task of no file": (lambda r: armcal.Task.load("no-such.toml"), "no-such.toml"),
    "recording of no file": (lambda r: armcal.Recording.open("no-such.mcap", r), "no-such.mcap"),
    "recording of another format": (lambda r: armcal.Recording.open(__file__, r), "test_wrong_uses"),
    "calibration of no file": (lambda r: armcal.Calibration.load("no-such.toml", r), "no-such.toml"),
    "routine of no file": (lambda r: armcal.simulate("no-such-routine"), "no-such-routine"),
    "routine's key unknown": (lambda r: armcal.simulate("titan4-quickstart", set={"capture.pose": 3}), "pose"),
    "seed negative": (lambda r: armcal.simulate("titan4-quickstart", seed=-1), "a whole number"),
    "seed of halves": (lambda r: armcal.simulate("titan4-quickstart", seed=1.5), "a whole number"),
    "too many poses": (lambda r: armcal.plan(r, armcal.Task([[0.9, 0.2, 0.3]], 0.02), poses=5000), "0 to 1000"),
    "method unknown": (lambda r: armcal.calibrate(r, views(r), method="magic"), "bundle"),
    "no tags known": (lambda r: armcal.calibrate(r, views(r)), "tag"),
    "two views": (lambda r: armcal.calibrate(r, views(r, counts=COUNTS[:2], view=[0, 1], tag=[0, 0], corners_px=CORNERS[:2]),
                                             tags=tags_of()), "at least"),
    "plan for an arm without tags": (lambda r: armcal.plan(r, armcal.Task([[0.9, 0.2, 0.3]], 0.02)), ""),
    "follower without tags": (lambda r: armcal.Follower(r), "give those around it"),
    "message without time": (lambda r: armcal.Follower(r, tags=tags_of()).push({"counts": COUNTS[0]}), "t_s"),
    "message of nothing": (lambda r: armcal.Follower(r, tags=tags_of()).push({"t_s": 1.0}), "counts, tags and oil_c"),
    "message of five joints": (lambda r: armcal.Follower(r, tags=tags_of()).push({"t_s": 1.0, "counts": COUNTS[0, :5]}), "a reading each"),
    "message of a list": (lambda r: armcal.Follower(r, tags=tags_of()).push({"t_s": 1.0, "tags": [1]}), "{id: corners"),
    "message in ns": (lambda r: armcal.Follower(r, tags=tags_of()).push({"t_s": 1e18, "oil_c": 3.0}), "0 to 4e9 s"),
    "rest backwards": (lambda r: armcal.Follower(r, tags=tags_of()).rest(2.0, 1.0), "give times of pushed messages"),
    "pickled robot": (lambda r: pickle.dumps(r), "load it there"),
    "copied views": (lambda r: copy.deepcopy(views(r)), "make it there"),
}


@pytest.mark.parametrize("use", USES)
def test_a_wrong_use_is_an_error_with_a_remedy(use, robot):
    do, says = USES[use]
    with pytest.raises(armcal.Error) as caught:
        do(robot)
    assert says in str(caught.value), str(caught.value)
    assert caught.value.code and caught.value.remedy and caught.value.page


def test_wrong_types_are_type_errors(robot):
    for do in (lambda: armcal.calibrate(robot, 3), lambda: armcal.calibrate("titan4", None), lambda: armcal.Task(tolerance_m="x"),
               lambda: armcal.Follower(3), lambda: robot.tool_pose(), lambda: armcal.Robot()):
        with pytest.raises(TypeError):
            do()


def test_wrong_uses_of_a_calibration(cal, tmp_path, robot):
    for do, says in [
        (lambda: cal.angles(COUNTS[:, :5]), "a reading each"),
        (lambda: cal.angles(with_nan(COUNTS, (0, 0))), "leave such readings out"),
        (lambda: cal.tool_pose(COUNTS[0], oil_c=float("nan")), "oil_c"),
        (lambda: cal.export("word", tmp_path / "x"), "urdf"),
        (lambda: cal.export("lerobot", tmp_path / "x"), "input"),
        (lambda: cal.report(tmp_path / "no" / "such" / "folder.html"), "such"),
        (lambda: cal.save("/proc/no-such"), "/proc/no-such"),
        (lambda: pickle.dumps(cal), "Calibration.load"),
        (lambda: armcal.calibrate(armcal.Robot.load("titan4"), views(robot), prior=cal), "titan4"),
    ]:
        with pytest.raises(armcal.Error) as caught:
            do()
        assert says in str(caught.value), str(caught.value)
        assert caught.value.code and caught.value.remedy and caught.value.page
    with pytest.raises(AttributeError):
        cal.gain = 1


def test_threads_run_beside_a_calibration(robot, tags, task, measured, cal):
    found, turns = [], 0
    given = armcal.Views.from_arrays(robot, **measured.arrays())

    def work():
        found.append(armcal.calibrate(robot, given, tags=tags, task=task))

    threads = [threading.Thread(target=work) for _ in range(3)]
    [thread.start() for thread in threads]
    while any(thread.is_alive() for thread in threads):
        turns += 1
        time.sleep(0.001)
    assert turns > 5
    assert all(np.array_equal(one.covariance, cal.covariance) for one in found) and len(found) == 3


def test_a_forked_process_calibrates(robot, tags, task, measured, cal):
    given = armcal.Views.from_arrays(robot, **measured.arrays())
    child = os.fork()
    if child == 0:
        same = np.array_equal(armcal.calibrate(robot, given, tags=tags, task=task).covariance, cal.covariance)
        os._exit(0 if same else 1)
    assert os.waitpid(child, 0)[1] == 0


def test_ctrl_c_ends_a_long_call():
    code = "import armcal; print('begun', flush=True); armcal.simulate('titan4-quickstart')"
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "begun\n"
    time.sleep(0.5)
    process.send_signal(signal.SIGINT)
    began = time.monotonic()
    _, said = process.communicate(timeout=20)
    assert "KeyboardInterrupt" in said and process.returncode != 0
    assert time.monotonic() - began < 3
