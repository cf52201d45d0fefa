"""Writes src/optics/tag36h11.txt: the codes of the family tag36h11, from OpenCV's dictionary.

One line an id: 36 cells in hexadecimal, row by row from the top left as printed, the first cell the highest bit, 1 = white.
OpenCV's dictionary holds the family turned by half a turn against the images that the AprilTag project publishes and
its detector expects (`UPRIGHT`); src/optics/tag36h11.rs proves the result with that detector.
"""

from pathlib import Path

import cv2
import numpy as np

# Quarter turns that bring OpenCV's pattern upright.
UPRIGHT = 2


def code(dictionary, tag_id):
    image = dictionary.generateImageMarker(tag_id, 8, borderBits=1)
    assert image.shape == (8, 8)
    ring = np.concatenate([image[0], image[-1], image[:, 0], image[:, -1]])
    assert not ring.any(), "the border is black"
    cells = np.rot90(image[1:7, 1:7] > 0, UPRIGHT).flatten()
    return int("".join("1" if cell else "0" for cell in cells), 2)


def main():
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    codes = [code(dictionary, tag_id) for tag_id in range(dictionary.bytesList.shape[0])]
    assert len(codes) == 587 and len(set(codes)) == 587
    file = Path(__file__).parents[2] / "src/optics/tag36h11.txt"
    file.write_text("".join(f"{value:09x}\n" for value in codes))


if __name__ == "__main__":
    main()
