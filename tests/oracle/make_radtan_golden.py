"""Projections of a pinhole camera with radial and tangential distortion by OpenCV's projectPoints -> tests/golden/radtan.json."""

import json
from pathlib import Path

import cv2
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
N_POINTS = 100
SEED = 20240602
UNPROJECT_TOLERANCE = 1e-9


def matrix(camera):
    (fx, fy), (cx, cy) = camera["focal_px"], camera["center_px"]
    return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


def cases(camera, rng):
    """Points whose pixels lie in the image, or a little outside."""
    (fx, fy), (cx, cy) = camera["focal_px"], camera["center_px"]
    width, height = camera["resolution_px"]
    plane = np.stack([(rng.uniform(0, width, N_POINTS) - cx) / fx, (rng.uniform(0, height, N_POINTS) - cy) / fy], axis=1)
    plane[0] = 0.0
    depth_m = rng.uniform(0.25, 4.0, N_POINTS)
    points = depth_m[:, None] * np.column_stack([plane, np.ones(N_POINTS)])
    distortion = np.array(camera["distortion"])
    pixels, _ = cv2.projectPoints(points.reshape(-1, 1, 3), np.zeros(3), np.zeros(3), matrix(camera), distortion)
    pixels = pixels.reshape(-1, 2)
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 500, 1e-15)
    back = cv2.undistortPoints(pixels.reshape(-1, 1, 2), matrix(camera), distortion, criteria=criteria)
    error = np.abs(back.reshape(-1, 2) - plane).max()
    assert error < UNPROJECT_TOLERANCE, f"undistortPoints differs by {error}"
    return [{"point_in_camera_m": p.tolist(), "pixel_px": u.tolist()} for p, u in zip(points, pixels)], float(error)


def main():
    rng = np.random.default_rng(SEED)
    # Coefficients k1, k2, p1, p2, k3, drawn; the first is barrel-shaped, as lenses are.
    cameras = []
    for name, signs in (("barrel", [-1, 1, 1, -1, -1]), ("cushion", [1, 1, -1, 1, 0]), ("none", [0, 0, 0, 0, 0])):
        size = rng.uniform(0.5, 1.0, 5) * [0.24, 0.15, 0.002, 0.002, 0.05]
        camera = {
            "resolution_px": [1280, 1024],
            "focal_px": rng.uniform(1100.0, 1600.0, 2).round(3).tolist(),
            "center_px": (np.array([639.5, 511.5]) + rng.uniform(-20.0, 20.0, 2)).round(3).tolist(),
            "distortion": (size * signs).round(6).tolist(),
        }
        rows, error = cases(camera, rng)
        cameras.append({"name": name, **camera, "undistort_max_error": error, "cases": rows})
    golden = {
        "what": "cv2.projectPoints with no rotation or translation; camera frame x right, y down, z forward; distortion k1, k2, p1, p2, k3",
        "tool": "opencv-python-headless",
        "tool_version": cv2.__version__,
        "seed": SEED,
        "cameras": cameras,
    }
    out = ROOT / "tests" / "golden" / "radtan.json"
    out.write_text(dump(golden))
    print(f"{out.relative_to(ROOT)}: " + ", ".join(f"{c['name']} {c['undistort_max_error']:.1e}" for c in cameras))


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
