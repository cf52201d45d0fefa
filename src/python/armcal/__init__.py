"""In-place calibration of robot arms with a wrist camera and AprilTags.

    robot = armcal.Robot.load("titan4")
    views = armcal.Views.from_arrays(robot, counts=counts, view=view, tag=tag, corners_px=corners_px)
    cal = armcal.calibrate(robot, views, task=armcal.Task(targets_m, tolerance_m=0.02))
    cal.verdict.grade, cal.u95_m

Arrays are numpy's, SI units, angles in rad; `a_from_b` maps coordinates in b to coordinates in a.
"""

from pathlib import Path as _Path

from . import _armcal
from ._armcal import (
    Calibration,
    Follower,
    Recording,
    Robot,
    Run,
    TagMap,
    Task,
    Verdict,
    Views,
    __version__,
    calibrate,
    plan,
    simulate,
)

__all__ = [
    "Calibration",
    "Error",
    "Follower",
    "Recording",
    "Robot",
    "Run",
    "TagMap",
    "Task",
    "Verdict",
    "Views",
    "__version__",
    "calibrate",
    "plan",
    "simulate",
]


class Error(ValueError):
    """Input that cannot be used. `code` is stable; `remedy` and `page` are those of `armcal explain CODE`."""

    def __init__(self, message: str, code: str = "", remedy: str = "", page: str = "") -> None:
        super().__init__(f"{message} [{code}]" if code else message)
        self.code = code
        self.remedy = remedy
        self.page = page


def _shared_folder() -> _Path:
    """Robots and routines of the wheel, or of the repository that the package is in."""
    here = _Path(__file__).resolve().parent
    return next((f for f in (here / "share", *here.parents[2:3]) if (f / "robots").is_dir()), here / "share")


_armcal.set_shared_folder(str(_shared_folder()))
