"""Gains come back within their sigma, and U95 holds, over arms that are drawn from the sigmas of robot.toml."""

import json
import sys

import numpy as np

import armcal
from conftest import POSES_RAD, measure, tag_map, tool_m

SEEDS = range(100, 104)


def errors(robot, task, seeds):
    """Of each seed: errors of gain and offset over their sigma, and of the tool over U95 at each target."""
    for seed in seeds:
        measured = measure(seed)
        cal = armcal.calibrate(robot, armcal.Views.from_arrays(robot, **measured.arrays()), tags=tag_map(), task=task)
        assert cal.status == "accepted", cal.refusal
        sigma = dict(zip(cal.parameters, np.sqrt(np.diag(cal.covariance))))
        seen = [k for k in range(5) if f"j{k + 1} gain" in sigma]
        gain = [(cal.gain[k] - measured.gain[k]) / sigma[f"j{k + 1} gain"] for k in seen]
        # Counts that the true arm has at the targets, and where the calibrated arm believes its tool there.
        exact = (POSES_RAD - measured.offset_rad) / measured.gain
        counts = exact * np.degrees(180.0) + 32768.0
        believed = cal.tool_pose(counts)[:, :3, 3]
        off_m = np.linalg.norm(believed - [tool_m(pose) for pose in POSES_RAD], axis=1)
        yield gain, off_m / cal.u95_m


def test_gains_come_back_within_their_sigma(robot, task):
    found = list(errors(robot, task, SEEDS))
    gains = np.concatenate([gain for gain, _ in found])
    assert len(gains) >= 4 * len(SEEDS)
    assert np.mean(np.abs(gains) < 2) >= 0.8 and np.abs(gains).max() < 4.5
    assert max(ratio.max() for _, ratio in found) < 1.5


def test_covariance_and_angles_fit_together(robot, cal, measured):
    n = len(cal.parameters)
    assert cal.covariance.shape == (n, n) and np.allclose(cal.covariance, cal.covariance.T)
    assert np.linalg.eigvalsh(cal.covariance).min() > 0
    one, all_ = cal.angles(measured.counts[0]), cal.angles(measured.counts)
    assert one.shape == (6,) and all_.shape == measured.counts.shape and np.array_equal(all_[0], one)
    assert np.abs(all_ - measured.true_angles(measured.counts))[:, :5].max() < 0.02
    cov = cal.tool_covariance(measured.counts[:3])
    assert cov.shape == (3, 3, 3) and (np.linalg.eigvalsh(cov) > 0).all()
    assert cal.tool_pose(measured.counts).shape == (len(measured.counts), 4, 4)
    assert cal.verdict.grade in ("green", "amber") and cal.u95_m.shape == (2,)
    residuals = cal.residuals
    assert residuals["off_px"].shape == (len(measured.view), 4, 2)
    assert np.nanstd(residuals["off_px"]) < 0.3


def test_positions_and_poses_serve_as_well(robot, tags, task, measured):
    """The same arm by positions and poses of its tags, without pixels."""
    rng = np.random.default_rng(2)
    from conftest import LINK6_FROM_CAMERA, TAGS_M, base_from_link6

    view, tag, positions, poses = [], [], [], []
    for k, angles in enumerate(measured.true_angles(measured.counts)):
        camera_from_base = np.linalg.inv(base_from_link6(angles) @ LINK6_FROM_CAMERA)
        for number, at in enumerate(TAGS_M):
            pose = camera_from_base.copy()
            pose[:3, 3] += camera_from_base[:3, :3] @ at
            positions.append(pose[:3, 3] + rng.normal(0, 1e-3, 3))
            pose[:3, 3] = positions[-1]
            poses.append(pose)
            view.append(k)
            tag.append(number)
    for measured_by in ({"positions_m": positions}, {"poses": poses}):
        views = armcal.Views.from_arrays(robot, counts=measured.counts, view=view, tag=tag, **measured_by)
        found = armcal.calibrate(robot, views, tags=tags, task=task)
        assert np.abs(found.gain - measured.gain)[1:4].max() < 0.01, found.refusal


def test_times_of_any_epoch_and_the_oil_are_taken(robot, tags, task, measured):
    """Unix times as loggers have them; and an offset that follows the oil is found where its temperature is given."""
    n = len(measured.counts)
    oil_c = np.linspace(5.0, 45.0, n)
    drifted = measured.counts.copy()
    drifted[:, 1] -= np.degrees(4e-4) * 180.0 * (oil_c - 25.0)
    given = measured.arrays() | {"counts": drifted, "t_s": 1.8e9 + 10.0 * np.arange(n)}
    without = armcal.calibrate(robot, armcal.Views.from_arrays(robot, **given), tags=tags, task=task)
    found = armcal.calibrate(robot, armcal.Views.from_arrays(robot, **given, oil_c=oil_c), tags=tags, task=task)
    true = measured.true_angles(measured.counts)[:, 1]

    def error(cal):
        return np.abs([cal.angles(row, oil_c=at)[1] for row, at in zip(drifted, oil_c)] - true).max()

    assert found.status == "accepted" and error(found) < 0.002, found.refusal
    assert without.status == "refused" or error(without) > 2 * error(found)


def study(seeds):
    """python -c "import test_estimate; test_estimate.study(40)" in this folder: the figures of docs/results."""
    import tempfile
    from pathlib import Path

    from conftest import robot_toml, urdf

    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "arm.urdf").write_text(urdf())
        (Path(folder) / "robot.toml").write_text(robot_toml())
        robot = armcal.Robot.load(folder)
        found = list(errors(robot, armcal.Task(poses_rad=POSES_RAD, tolerance_m=0.02), range(1000, 1000 + seeds)))
    gains, ratios = np.concatenate([g for g, _ in found]), np.concatenate([r for _, r in found])
    json.dump({"runs": len(found), "gains": len(gains), "within_1_sigma": float(np.mean(np.abs(gains) < 1)),
               "within_2_sigma": float(np.mean(np.abs(gains) < 2)), "std_over_sigma": float(gains.std()),
               "targets": len(ratios), "beyond_u95": int((ratios > 1).sum()), "largest_over_u95": float(ratios.max()),
               "p95_over_u95": float(np.quantile(ratios, 0.95))}, sys.stdout, indent=1)
