from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, Literal, final

from typing_extensions import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "__version__",
    "main",
    "set_shared_folder",
    "calibrate",
    "plan",
    "simulate",
    "Robot",
    "TagMap",
    "Task",
    "Recording",
    "Views",
    "Calibration",
    "Verdict",
    "Follower",
    "Run",
]
__version__: str

_Path = str | PathLike[str]
_Floats = NDArray[np.float64]

def main(words: Sequence[str]) -> int: ...
def set_shared_folder(folder: _Path) -> None: ...

@final
class Robot:
    """An arm by its folder: robot.toml and the URDF."""

    @staticmethod
    def load(folder: _Path) -> Robot:
        """Reads a robot's folder, or one that comes with armcal by its name, such as "titan4"."""
    @property
    def name(self) -> str: ...
    @property
    def folder(self) -> Path: ...
    @property
    def joints(self) -> list[str]:
        """Names of the joints, base first."""
    def tool_pose(self, angles_rad: ArrayLike) -> _Floats:
        """Pose of the tool (4, 4) in the frame of the base, m, at joint angles (j,), rad, by the URDF."""

@final
class TagMap:
    """Tags or landmarks around an arm, with their poses."""

    @staticmethod
    def load(file: _Path) -> TagMap:
        """Reads a tag map (.toml), a tagslam.yaml or a Kalibr target (.yaml)."""
    @staticmethod
    def from_poses(
        frame: str, ids: ArrayLike, poses: ArrayLike, *, size_m: float, position_std_m: float, rotation_std_rad: float
    ) -> TagMap:
        """Tags by their poses (m, 4, 4) in `frame`, a link of the URDF, with one sigma of position and rotation."""
    @property
    def frame(self) -> str: ...
    @property
    def ids(self) -> list[int]: ...
    def __len__(self) -> int: ...

@final
class Task:
    """What the arm is calibrated for: targets and a tolerance."""

    def __new__(
        cls, targets_m: ArrayLike | None = None, tolerance_m: float | None = None, *, poses_rad: ArrayLike | None = None
    ) -> Self:
        """Tool positions (k, 3) in the base frame, m, or joint angles (k, j), rad, or both."""
    @staticmethod
    def load(file: _Path) -> Task:
        """Reads a task file (.toml)."""
    @property
    def tolerance_m(self) -> float: ...
    def __len__(self) -> int: ...

@final
class Recording:
    """A recording of an arm."""

    @staticmethod
    def open(file: _Path, robot: Robot, *, input: _Path | None = None) -> Recording:
        """Reads a recording that armcal made, or, by an input map, that of a real arm."""
    def views(self) -> Views: ...

@final
class Views:
    """An arm at rest, pose by pose, and the tags that its camera saw."""

    @staticmethod
    def from_arrays(
        robot: Robot,
        *,
        view: ArrayLike,
        tag: ArrayLike,
        counts: ArrayLike | None = None,
        angles_rad: ArrayLike | None = None,
        t_s: ArrayLike | None = None,
        oil_c: ArrayLike | None = None,
        corners_px: ArrayLike | None = None,
        positions_m: ArrayLike | None = None,
        poses: ArrayLike | None = None,
    ) -> Views:
        """Views of arrays: n poses at rest, and m tags seen in them.

        counts (n, j): raw reading of each joint, base first; or angles_rad (n, j): angles by the datasheet, rad.
        t_s (n,): times, at least 0.3 s apart; without them poses count as a second apart. oil_c (n,): temperatures of
        the oil, which offsets may follow.
        view (m,): the pose in which a tag was seen, from 0. tag (m,): its number.
        corners_px (m, 4, 2): raw pixels of bottom left, bottom right, top right and top left as printed; or
        positions_m (m, 3): the tag in the camera's frame, m; or poses (m, 4, 4): camera_from_tag.
        """
    def __len__(self) -> int: ...

@final
class Verdict:
    """May the result be used, and by what rule."""

    @property
    def grade(self) -> Literal["green", "amber", "refused"]: ...
    @property
    def codes(self) -> list[str]: ...
    @property
    def rule(self) -> str: ...
    @property
    def tolerance_m(self) -> float | None: ...
    @property
    def p_beyond_tolerance(self) -> float | None: ...

@final
class Calibration:
    """A calibration of the joint sensors, accepted or refused."""

    @staticmethod
    def load(file: _Path, robot: Robot) -> Calibration:
        """Reads calibration.toml, with the covariance beside it."""
    @property
    def status(self) -> Literal["accepted", "refused"]: ...
    @property
    def refusal(self) -> str | None: ...
    @property
    def verdict(self) -> Verdict: ...
    @property
    def u95_m(self) -> _Floats:
        """Radius (k,) that contains the tool's error with 95 % probability at each target of the task, m."""
    @property
    def u95_max_m(self) -> float | None: ...
    @property
    def gain(self) -> _Floats:
        """Gain (j,) over that of the datasheet."""
    @property
    def gain_rad_per_count(self) -> _Floats: ...
    @property
    def offset_rad(self) -> _Floats: ...
    @property
    def offset_std_rad(self) -> _Floats: ...
    @property
    def parameters(self) -> list[str]:
        """Names (p,) of the estimated parameters."""
    @property
    def covariance(self) -> _Floats:
        """Covariance (p, p) of the parameters: gains relative, offsets in rad."""
    @property
    def residuals(self) -> dict[str, NDArray[Any]]:
        """What the fit leaves, tag by tag: view, tag, off_m, used (m,), and off_px (m, 4, 2)."""
    @property
    def held_out(self) -> dict[str, Any]: ...
    @property
    def summary(self) -> dict[str, Any]: ...
    def angles(self, counts: ArrayLike, *, oil_c: float | None = None, pressure_pa: float | None = None) -> _Floats:
        """Joint angles, rad, of raw readings (j,) or (n, j)."""
    def tool_pose(self, counts: ArrayLike, *, oil_c: float | None = None, pressure_pa: float | None = None) -> _Floats:
        """Pose of the tool (4, 4) or (n, 4, 4) in the frame of the base, m."""
    def tool_covariance(
        self, counts: ArrayLike, *, oil_c: float | None = None, pressure_pa: float | None = None
    ) -> _Floats:
        """Covariance of the tool's position (3, 3) or (n, 3, 3) in the frame of the base, m^2."""
    def report(self, file: _Path) -> None:
        """Writes the report, an HTML page that needs no other file."""
    def save(self, folder: _Path) -> Path:
        """Writes calibration.toml, its covariance, summary.json and report.html; returns the folder used."""
    def export(self, form: str, file: _Path, *, input: _Path | None = None, refused: bool = False) -> None:
        """Writes another form, by the names of `armcal export --as`."""

def calibrate(
    robot: Robot,
    views: Views,
    *,
    tags: TagMap | None = None,
    task: Task | None = None,
    prior: Calibration | None = None,
    method: str = "bundle",
) -> Calibration:
    """Calibrates the joint sensors of `robot` by `views`; returns a Calibration, accepted or refused."""

def plan(
    robot: Robot,
    task: Task,
    *,
    vehicle: _Path | None = None,
    prior: Calibration | None = None,
    poses: int | None = None,
    seed: int | None = None,
) -> dict[str, Any]:
    """Plans the views of a capture and certified paths to them; returns a dictionary with the keys of plan.toml."""

@final
class Follower:
    """Follows the messages of an arm and keeps its sensors' estimate up to date."""

    def __new__(cls, robot: Robot, cal: Calibration | None = None, *, tags: TagMap | None = None, task: Task | None = None) -> Self: ...
    def push(self, message: Mapping[str, Any]) -> list[dict[str, Any]]:
        """Takes a message in: t_s and one of counts (j,), tags {id: (4, 2)} and oil_c; returns what it made known."""
    def rest(self, start_s: float, end_s: float) -> list[dict[str, Any]]:
        """The arm stood still from `start_s` to `end_s`: what was pushed of this span makes a view."""
    def finish(self) -> list[dict[str, Any]]: ...
    @property
    def n_views(self) -> int: ...
    @property
    def belief(self) -> dict[str, Any] | None: ...
    def angles(self, counts: ArrayLike) -> _Floats: ...
    def u95_m(self, counts: ArrayLike) -> float | None: ...

@final
class Run:
    """What a simulated run gave."""

    @property
    def folder(self) -> Path: ...
    @property
    def recording(self) -> Path: ...
    @property
    def robot(self) -> Robot: ...
    @property
    def calibration(self) -> Calibration: ...
    @property
    def summary(self) -> dict[str, Any]: ...

def simulate(
    routine: _Path, *, seed: int | None = None, out: _Path | None = None, set: Mapping[str, Any] | None = None
) -> Run:
    """Runs a routine on a simulated arm: reach, plan, capture, calibrate, reach again."""
