"""Other AprilTag detectors on the images of the detection study.

    armcal-lab detection --images DIR
    python tests/oracle/compare_detectors.py DIR [KORNIA] [--out FILE]

DIR holds truth.csv and the images. KORNIA is the program of tests/oracle/kornia, built; without it that detector is left out.
Writes FILE, tests/golden/detectors.csv if none is given: one line for each detector, water and band of shortest sides.
Errors are rms per corner coordinate, `common` over tags that all detectors found; times are medians an image, of one
thread: processor time of the Python ones, wall time of ours and of kornia (idle machine).
"""

import argparse
import csv
import subprocess
import time
from pathlib import Path

import cv2
import numpy as np
from pupil_apriltags import Detector

ROOT = Path(__file__).parents[2]
OUT = ROOT / "tests/golden/detectors.csv"
# A detection whose farthest corner is off by more than this share of the shortest side is of something else.
MATCH_SHARE = 0.3
SIDES_PX = [(0, 8), (8, 12), (12, 16), (16, 24), (24, 40), (40, 1000)]


def read_truth(folder):
    tags = {}
    with open(folder / "truth.csv") as file:
        for row in csv.DictReader(file):
            corners = np.array([[float(row[f"{axis}{k}"]) for axis in "xy"] for k in range(4)])
            ours = None
            if row["found"] == "1":
                ours = np.array([[float(row[f"f{axis}{k}"]) for axis in "xy"] for k in range(4)])
            tags.setdefault(row["image"], []).append(
                dict(id=int(row["id"]), corners=corners, side=float(row["shortest_side_px"]), water=row["water"], ours=ours)
            )
    return tags


def pupil(decimate):
    detector = Detector(families="tag36h11", nthreads=1, quad_decimate=decimate)

    # Bottom left, bottom right, top right, top left; the library's pixel centres are at halves.
    def detect(image):
        return [(tag.tag_id, np.array(tag.corners) - 0.5) for tag in detector.detect(image)]

    return detect


def opencv(refinement):
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = refinement
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    detector = cv2.aruco.ArucoDetector(dictionary, parameters)

    # OpenCV's family is turned by half a turn: its first corner, top left, is the bottom right one; it runs clockwise.
    def detect(image):
        corners, ids, _ = detector.detectMarkers(image)
        if ids is None:
            return []
        return [(int(i), c[0][[3, 0, 1, 2]][[2, 1, 0, 3]].astype(float)) for i, c in zip(ids.ravel(), corners)]

    return detect


def best_rotation(found, truth):
    """Corners in the order that fits best: conventions differ, and a wrong order is no matter of accuracy."""
    orders = [np.roll(found[::step], k, axis=0) for step in (1, -1) for k in range(4)]
    return min(orders, key=lambda order: np.abs(order - truth).max())


def matched(detections, tags):
    """Corners for each tag, or None; and how many detections belong to no tag."""
    n_used, out = 0, []
    for tag in tags:
        found = None
        for tag_id, corners in detections:
            if tag_id == tag["id"]:
                corners = best_rotation(corners, tag["corners"])
                if np.linalg.norm(corners - tag["corners"], axis=1).max() < MATCH_SHARE * tag["side"]:
                    found = corners
        n_used += found is not None
        out.append(found)
    ids = {tag["id"] for tag in tags}
    return out, sum(1 for tag_id, _ in detections if tag_id not in ids)


def run(name, detect, truth, folder):
    cv2.setNumThreads(1)
    results, seconds, n_false = {}, [], 0
    for image_name, tags in truth.items():
        image = cv2.imread(str(folder / image_name), cv2.IMREAD_GRAYSCALE)
        start = time.process_time()
        detections = detect(image)
        seconds.append(time.process_time() - start)
        results[image_name], wrong = matched(detections, tags)
        n_false += wrong
    print(f"{name}: {1e3 * np.median(seconds):.1f} ms, wrong ids {n_false}")
    return results, 1e3 * np.median(seconds), n_false


def run_kornia(program, truth, folder):
    """Its output: `image ms`, then `id x0 y0 .. x3 y3` lines, indented."""
    text = subprocess.run([program, folder], check=True, capture_output=True, text=True).stdout
    detections, ms, current = {}, [], None
    for line in text.splitlines():
        fields = line.split()
        if line.startswith(" "):
            detections[current].append((int(fields[0]), np.array(fields[1:], float).reshape(4, 2)))
        else:
            current = fields[0]
            detections[current] = []
            ms.append(float(fields[1]))
    results, n_false = {}, 0
    for image_name, tags in truth.items():
        # Which pixel centres it means is not documented: the better of both.
        results[image_name], wrong = matched(detections[image_name], tags)
        n_false += wrong
    print(f"kornia: {np.median(ms):.1f} ms, wrong ids {n_false}")
    return results, np.median(ms), n_false


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("kornia", nargs="?")
    parser.add_argument("--out", type=Path, default=OUT)
    args = parser.parse_args()
    folder = args.folder
    truth = read_truth(folder)
    detectors = {
        "pupil-apriltags, decimate 1": pupil(1.0),
        "pupil-apriltags, decimate 2": pupil(2.0),
        "opencv, apriltag": opencv(cv2.aruco.CORNER_REFINE_APRILTAG),
        "opencv, subpix": opencv(cv2.aruco.CORNER_REFINE_SUBPIX),
    }
    results = {"armcal": ({name: [tag["ours"] for tag in tags] for name, tags in truth.items()}, float("nan"), 0)}
    for name, detect in detectors.items():
        results[name] = run(name, detect, truth, folder)
    if args.kornia:
        results["kornia-apriltag"] = run_kornia(args.kornia, truth, folder)
    results["armcal"] = (results["armcal"][0], ours_ms(folder), 0)
    write(truth, results, args.out)


def ours_ms(folder):
    """As the study measured it, if it left it there."""
    file = folder / "time_ms.txt"
    return float(file.read_text()) if file.exists() else float("nan")


def write(truth, results, out):
    rows = []
    for water in ("clear", "coastal", "turbid", "all"):
        for low, high in [*SIDES_PX, (0, 1000)]:
            chosen = [
                (image, k)
                for image, tags in truth.items()
                for k, tag in enumerate(tags)
                if water in (tag["water"], "all") and low <= tag["side"] < high
            ]
            if not chosen:
                continue
            common = [c for c in chosen if all(found[c[0]][c[1]] is not None for found, _, _ in results.values())]
            for name, (found, ms, n_false) in results.items():
                own = [c for c in chosen if found[c[0]][c[1]] is not None]
                pairs = {}
                # Pairwise: tags that this detector and ours both found.
                ours = results["armcal"][0]
                both = [c for c in own if ours[c[0]][c[1]] is not None]
                pairs["own"], pairs["common"], pairs["both"] = own, common, both
                errors = {key: rms(truth, found, some) for key, some in pairs.items()}
                ours_both = rms(truth, ours, both)
                rows.append(
                    [name, water, low, high, len(chosen), len(own), f"{len(own) / len(chosen):.4f}",
                     f"{errors['own']:.4f}", len(common), f"{errors['common']:.4f}", len(both), f"{errors['both']:.4f}",
                     f"{ours_both:.4f}", n_false, f"{ms:.1f}"]
                )
    with open(out, "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow("detector,water,side_from_px,side_to_px,n,found,recall,rms_px,n_common,rms_common_px,"
                        "n_both,rms_both_px,armcal_rms_both_px,wrong_ids,ms_per_image".split(","))
        writer.writerows(rows)
    for row in rows:
        if row[1] == "all":
            print(*row, sep="\t")


def rms(truth, found, chosen):
    if not chosen:
        return float("nan")
    errors = [found[image][k] - truth[image][k]["corners"] for image, k in chosen]
    return float(np.sqrt(np.mean(np.square(errors))))


if __name__ == "__main__":
    main()
