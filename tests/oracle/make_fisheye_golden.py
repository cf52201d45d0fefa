"""Projections of an equidistant (Kannala-Brandt) camera by OpenCV's cv2.fisheye -> tests/golden/fisheye.json."""

import json
import tomllib
from pathlib import Path

import cv2
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
N_POINTS = 100
SEED = 20240118
MAX_ANGLE_RAD = np.radians(80.0)
UNPROJECT_TOLERANCE_RAD = 1e-6


def project(points_m, camera):
    matrix, distortion = intrinsics(camera)
    pixels, _ = cv2.fisheye.projectPoints(points_m.reshape(-1, 1, 3), np.zeros(3), np.zeros(3), matrix, distortion)
    return pixels.reshape(-1, 2)


def unproject(pixels, camera):
    """Pinhole coordinates x/z and y/z."""
    matrix, distortion = intrinsics(camera)
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 100, 1e-14)
    return cv2.fisheye.undistortPoints(pixels.reshape(-1, 1, 2), matrix, distortion, criteria=criteria).reshape(-1, 2)


def intrinsics(camera):
    (fx, fy), (cx, cy) = camera["focal_px"], camera["center_px"]
    return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]), np.array(camera["distortion"])


def cases(camera, rng):
    angle = np.concatenate([[0.0, 1e-6, 1e-3, MAX_ANGLE_RAD], rng.uniform(0.0, MAX_ANGLE_RAD, N_POINTS - 4)])
    azimuth = rng.uniform(-np.pi, np.pi, N_POINTS)
    range_m = rng.uniform(0.25, 2.5, N_POINTS)
    points = range_m[:, None] * np.stack(
        [np.sin(angle) * np.cos(azimuth), np.sin(angle) * np.sin(azimuth), np.cos(angle)], axis=1
    )
    pixels = project(points, camera)
    plane = unproject(pixels, camera)
    back = np.arctan2(np.linalg.norm(plane, axis=1), 1.0)
    error = np.abs(back - angle).max()
    assert error < UNPROJECT_TOLERANCE_RAD, f"undistortPoints differs by {error} rad"
    rows = [
        {"point_in_camera_m": p.tolist(), "pixel_px": u.tolist(), "view_angle_rad": float(a), "undistorted_xy_over_z": n.tolist()}
        for p, u, a, n in zip(points, pixels, angle, plane)
    ]
    return rows, float(error)


def main():
    rng = np.random.default_rng(SEED)
    robot = tomllib.loads((ROOT / "robots" / "titan4" / "robot.toml").read_text())
    keys = ("resolution_px", "focal_px", "center_px", "distortion")
    wrist = {k: robot["camera"][k] for k in keys}
    other = {
        "resolution_px": [1600, 1200],
        "focal_px": rng.uniform(420.0, 520.0, 2).round(3).tolist(),
        "center_px": (np.array([799.5, 599.5]) + rng.uniform(-15.0, 15.0, 2)).round(3).tolist(),
        "distortion": (rng.uniform(-1.0, 1.0, 4) * [0.05, 0.02, 0.008, 0.002]).round(6).tolist(),
    }
    cameras = []
    for name, camera in (("titan4 wrist", wrist), ("random", other)):
        rows, error = cases(camera, rng)
        cameras.append({"name": name, **camera, "undistort_max_angle_error_rad": error, "cases": rows})
    golden = {
        "what": "cv2.fisheye.projectPoints with no rotation or translation; camera frame x right, y down, z forward; pixel centres at whole "
        "numbers. undistorted_xy_over_z is cv2.fisheye.undistortPoints of pixel_px. Pixels may lie outside the image.",
        "tool": "opencv-python-headless",
        "tool_version": cv2.__version__,
        "seed": SEED,
        "max_view_angle_rad": float(MAX_ANGLE_RAD),
        "cameras": cameras,
    }
    out = ROOT / "tests" / "golden" / "fisheye.json"
    out.write_text(dump(golden))
    print(f"{out.relative_to(ROOT)}: " + ", ".join(f"{c['name']} {c['undistort_max_angle_error_rad']:.1e} rad" for c in cameras))


def dump(golden):
    """One point per line, so that differences stay readable."""
    head = json.dumps({k: v for k, v in golden.items() if k != "cameras"}, indent=1)[:-2]
    blocks = []
    for camera in golden["cameras"]:
        top = json.dumps({k: v for k, v in camera.items() if k != "cases"})[:-1]
        blocks.append(top + ', "cases": [\n' + ",\n".join("  " + json.dumps(c) for c in camera["cases"]) + "\n]}")
    return head + ',\n "cameras": [\n' + ",\n".join(blocks) + "\n]\n}\n"


if __name__ == "__main__":
    main()
