"""Writes src/core/optics/tag_family/*.txt: the codes of tag families, from OpenCV's dictionaries and the AprilTag library.

One line an id: the cells within the black border in hexadecimal, row by row from the top left as printed, the first cell the
highest bit, 1 = white. OpenCV's dictionaries hold the families turned by half a turn against the images that the AprilTag
project publishes and its detector expects (`UPRIGHT`); src/detect/tag_family_tests.rs proves the result with that detector.

The newer families come from the C files of the AprilTag library (BSD-2), in the folder that is the one argument. A code is the
one before it plus a multiple of a prime; a file has the first code and then the multiples, in hexadecimal.
"""

import re
import sys
from pathlib import Path

import cv2
import numpy as np

# Quarter turns that bring OpenCV's pattern upright.
UPRIGHT = 2
# Name, dictionary, cells along a side within the border, tags.
FAMILIES = [
    ("tag16h5", cv2.aruco.DICT_APRILTAG_16h5, 4, 30),
    ("tag25h9", cv2.aruco.DICT_APRILTAG_25h9, 5, 35),
    ("tag36h11", cv2.aruco.DICT_APRILTAG_36h11, 6, 587),
]

# Bits of a code.
STEPPED = {"tagCircle21h7": 21, "tagCircle49h12": 49, "tagCustom48h12": 48, "tagStandard41h12": 41, "tagStandard52h13": 52}
PRIME = 982451653
WIDTH = 118


def stepped(source, n_bits):
    codes = [int(word, 16) for word in re.findall(r"0x([0-9a-f]{16})UL", source)]
    inverse = pow(PRIME, -1, 1 << n_bits)
    steps = [((b - a) * inverse) % (1 << n_bits) for a, b in zip(codes, codes[1:])]
    lines = [f"{codes[0]:x}"]
    for step in steps:
        word = f"{step:x}"
        if len(lines[-1]) + 1 + len(word) > WIDTH:
            lines.append(word)
        else:
            lines[-1] += " " + word
    return "\n".join(lines) + "\n"


def code(dictionary, tag_id, inner):
    side = inner + 2
    image = dictionary.generateImageMarker(tag_id, side, borderBits=1)
    assert image.shape == (side, side)
    ring = np.concatenate([image[0], image[-1], image[:, 0], image[:, -1]])
    assert not ring.any(), "the border is black"
    cells = np.rot90(image[1 : inner + 1, 1 : inner + 1] > 0, UPRIGHT).flatten()
    return int("".join("1" if cell else "0" for cell in cells), 2)


def main():
    folder = Path(__file__).parents[2] / "src/core/optics/tag_family"
    for name, dictionary, inner, n_tags in FAMILIES:
        dictionary = cv2.aruco.getPredefinedDictionary(dictionary)
        codes = [code(dictionary, tag_id, inner) for tag_id in range(dictionary.bytesList.shape[0])]
        assert len(codes) == n_tags and len(set(codes)) == n_tags
        digits = -(-inner * inner // 4)
        (folder / f"{name}.txt").write_text("".join(f"{value:0{digits}x}\n" for value in codes))
    for name, n_bits in STEPPED.items():
        source = (Path(sys.argv[1]) / f"{name}.c").read_text()
        (folder / f"{name}.txt").write_text(stepped(source, n_bits))


if __name__ == "__main__":
    main()
