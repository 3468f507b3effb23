"""The reference clip that the simulation tracks: one exact period of a motion on the robot, or a motion played once."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from kine2go_warp.errors import ClipError
from kine2go_warp.files import atomic_file
from kine2go_warp.motions.cycle import CycleStep, continued, extend
from kine2go_warp.motions.fidelity import Fidelity
from kine2go_warp.motions.poses import Poses
from kine2go_warp.motions.skeleton import Skeleton
from kine2go_warp.motions.validation import validate
from kine2go_warp.robots import DEFAULT_ROBOT, RobotSpec, stored_robot
from kine2go_warp.robots.kinematics import foot_positions
from kine2go_warp.rotations import from_rotation, heading, to_rotation

Array = NDArray[np.float64]

FORMAT_VERSION = 2
CONTACT_TOLERANCE = 0.15
"""How much earlier or later than the reference a robot may rest on its body [s]."""

Kind = Literal["cycle", "once"]
"""Whether a clip is repeated, or begins and ends in poses that are held."""


@dataclass(frozen=True)
class ClipOrigin:
    """Where a clip comes from, kept with everything made of it."""

    source: str = ""
    file: str = ""
    sha256: str = ""
    start: int = 0
    end: int = 0
    source_rate: float = 0.0
    licence: str = ""
    citation: str = ""


@dataclass(frozen=True)
class MotionClip:
    """One cycle of ``num_frames`` frames, or as many frames that are played once.

    Frame ``num_frames`` of a cycle is frame 0 moved on by ``cycle``. Before a clip that is played once lies its first
    pose, after it its last one, at rest.

    World frame: z up, floor at height 0, frame 0 at the origin with heading 0. Velocities are central differences,
    across the seam of a cycle; they are zero in the first and the last frame of a clip that is played once.
    """

    name: str
    frame_duration: float
    """Time from one frame to the next [s]."""
    root_position: Array
    """Base link origin [m], shape [num_frames, 3]."""
    root_orientation: Array
    """Base link orientation (w, x, y, z), sign-continuous, shape [num_frames, 4]."""
    joint_position: Array
    """Joint positions [rad], shape [num_frames, 12]."""
    root_linear_velocity: Array
    """Velocity of the base link origin [m/s], shape [num_frames, 3]."""
    root_angular_velocity: Array
    """Angular velocity of the base, world frame [rad/s], shape [num_frames, 3]."""
    joint_velocity: Array
    """Joint velocities [rad/s], shape [num_frames, 12]."""
    foot_position: Array
    """Foot centres by forward kinematics, FL, FR, RL, RR [m], shape [num_frames, 4, 3]."""
    stance: Array
    """1 where a foot stands, 0 where it swings, shape [num_frames, 4]."""
    body_rests: Array
    """1 where knees or trunk at the front and at the rear rest on the floor, else 0, shape [num_frames, 2]."""
    residual: Array
    """Largest distance of a foot from its retargeting target [m], shape [num_frames]."""
    cycle: CycleStep | None
    """Displacement of one whole cycle; none of a clip that is played once."""
    origin: ClipOrigin
    robot: str = DEFAULT_ROBOT
    """Reference of the robot that it is for; see ``robots.robot_named``."""
    slow_down: float = 1.0
    """By which the motion was slowed to keep within the motors' speeds."""
    time_scale: float = 1.0
    """Duration over the animal's as the settings ask for it, before any slowing down."""
    fidelity: Fidelity | None = None
    """How truly it moves as the animal does; no part of the motion itself."""
    keypoints: Skeleton | None = None
    """What it was made from, to look at; no part of the motion itself."""

    @property
    def num_frames(self) -> int:
        """Number of frames."""
        return len(self.root_position)

    @property
    def kind(self) -> Kind:
        """Whether it is repeated or played once."""
        return "once" if self.cycle is None else "cycle"

    @property
    def span(self) -> int:
        """Frames from phase 0 to phase 1: a cycle ends where the next begins, a clip played once at its last frame."""
        return self.num_frames - (self.cycle is None)

    @property
    def period(self) -> float:
        """Duration of one cycle, or of a clip that is played once [s]."""
        return self.span * self.frame_duration

    @property
    def displacement(self) -> tuple[float, float, float]:
        """Where a cycle, or a clip that is played once, leads, as seen from frame 0: forward, left [m], turn [rad]."""
        if self.cycle is not None:
            return self.cycle.x, self.cycle.y, self.cycle.yaw
        x, y, _ = self.root_position[-1]
        return float(x), float(y), float(heading(self.root_orientation[-1:])[0])

    @cached_property
    def body_may_touch(self) -> NDArray[np.bool_]:
        """Frames in which parts other than the feet may touch the ground, shape [num_frames].

        They may where the front or the rear rests there, and up to ``CONTACT_TOLERANCE`` before and after.
        """
        early = round(CONTACT_TOLERANCE / self.frame_duration)
        places = np.arange(-early, self.num_frames + early)
        rests = self.body_rests.max(axis=1)[continued(places, self.num_frames, self.cycle is not None)]
        return np.logical_or.reduce(sliding_window_view(rests, 2 * early + 1) > 0.5, axis=1)

    def content_hash(self) -> str:
        """Return a hash of the motion itself, equal for equal clips whatever file they are in."""
        digest = hashlib.sha256(f"{self.name} {self.frame_duration!r} {self.cycle!r}".encode())
        for array in (self.root_position, self.root_orientation, self.joint_position):
            digest.update(np.ascontiguousarray(array, dtype=np.float64).tobytes())
        if self.body_rests.any():
            digest.update(np.ascontiguousarray(self.body_rests, dtype=np.float64).tobytes())
        return digest.hexdigest()[:16]

    @property
    def spec(self) -> RobotSpec:
        """The robot that it is for.

        Raises:
            Kine2GoError: the robot is not available here.
        """
        return stored_robot(self.robot, f"clip {self.name}")

    @property
    def poses(self) -> Poses:
        """The poses of all frames, with joints."""
        return Poses(self.root_position, self.root_orientation, self.joint_position)

    def extended(self, before: int, after: int) -> Poses:
        """Return the poses of all frames and of some on either side, with joints."""
        return extend(self.poses, self.cycle, before, after)

    def resampled(self, rate: float, spec: RobotSpec) -> "MotionClip":
        """Return the same motion in time with about ``rate`` frames per second.

        The period is kept exactly, so the frame duration may differ from ``1 / rate`` by half a frame a period.
        Positions and joints are interpolated by cubic splines, rotations by slerp.
        """
        from scipy.interpolate import CubicSpline
        from scipy.spatial.transform import Slerp

        span = max(round(self.period * rate), 3)
        time = np.arange(span + self.num_frames - self.span, dtype=np.float64) * (self.period / span)
        margin = 4
        longer = self.extended(margin, margin)
        known = np.arange(-margin, self.num_frames + margin) * self.frame_duration
        nearest = np.minimum(np.round(time / self.frame_duration).astype(int), self.num_frames - 1)
        clip = replace(
            self,
            frame_duration=self.period / span,
            root_position=CubicSpline(known, longer.root_position)(time),
            root_orientation=from_rotation(Slerp(known, to_rotation(longer.root_orientation))(time)),
            joint_position=CubicSpline(known, longer.joints)(time),
            stance=self.stance[nearest],
            body_rests=self.body_rests[nearest],
            residual=np.interp(time, known[margin:-margin], self.residual),
        ).completed(spec)
        if self.keypoints is None:
            return clip
        return replace(clip, keypoints=self.keypoints.resampled(time / self.frame_duration, self.cycle))

    def completed(self, spec: RobotSpec) -> "MotionClip":
        """Return the clip with the velocities and the feet that follow from its poses and its frame duration."""
        longer = self.extended(1, 1)
        assert longer.joints is not None
        span = np.full((self.num_frames, 1), 2.0 * self.frame_duration)
        if self.cycle is None:
            span[[0, -1]] = np.inf
        rotation = to_rotation(longer.root_orientation)
        feet = np.einsum("tij,tkj->tki", rotation[1:-1].as_matrix(), foot_positions(spec, self.joint_position))
        return replace(
            self,
            root_orientation=longer.root_orientation[1:-1],
            root_linear_velocity=(longer.root_position[2:] - longer.root_position[:-2]) / span,
            root_angular_velocity=(rotation[2:] * rotation[:-2].inv()).as_rotvec() / span,
            joint_velocity=(longer.joints[2:] - longer.joints[:-2]) / span,
            foot_position=feet + self.root_position[:, None],
        )

    def save(self, path: Path) -> None:
        """Write the clip as ``.npz`` (plain arrays, no pickles)."""
        arrays = {field.name: getattr(self, field.name) for field in fields(self) if field.type is Array}
        if self.keypoints is not None:
            arrays |= self.keypoints.as_arrays()
        header = {
            "format_version": FORMAT_VERSION,
            "name": self.name,
            "robot": self.robot,
            "frame_duration": self.frame_duration,
            "slow_down": self.slow_down,
            "time_scale": self.time_scale,
            "fidelity": None if self.fidelity is None else self.fidelity.as_json(),
            "cycle": None if self.cycle is None else asdict(self.cycle),
            "origin": asdict(self.origin),
        }
        with atomic_file(path) as temporary:
            np.savez_compressed(temporary, allow_pickle=False, header=np.array(json.dumps(header)), **arrays)

    @classmethod
    def load(cls, path: Path) -> "MotionClip":
        """Read a clip written by ``save``.

        Raises:
            ClipError: the file is missing, not a clip, of another format version, or ``validate`` refuses it.
            Kine2GoError: its robot is not available here.
        """
        try:
            with np.load(path, allow_pickle=False) as data:
                header = json.loads(str(data["header"]))
                given = {"body_rests": np.zeros((len(data["stance"]), 2)), **data}
                arrays = {field.name: given[field.name] for field in fields(cls) if field.type is Array}
                keypoints = Skeleton.from_arrays(data)
            if header["format_version"] != FORMAT_VERSION:
                version = header["format_version"]
                raise ClipError(f"{path}: clip format {version}, expected {FORMAT_VERSION}; retarget it again")
            clip = cls(
                name=header["name"],
                robot=header.get("robot", DEFAULT_ROBOT),
                frame_duration=header["frame_duration"],
                slow_down=header["slow_down"],
                time_scale=header.get("time_scale", 1.0),
                fidelity=Fidelity.from_json(header.get("fidelity")),
                cycle=None if header["cycle"] is None else CycleStep(**header["cycle"]),
                origin=ClipOrigin(**header["origin"]),
                keypoints=keypoints,
                **arrays,
            )
        except ClipError:
            raise
        except FileNotFoundError:
            raise ClipError(f"{path}: no such clip; make it with 'kine2go motion retarget'") from None
        except Exception as error:  # noqa: BLE001 - damaged archives raise errors of many kinds
            # NumPy takes whatever is no archive for a pickle, and would advise to load it as one.
            problem = "it is no .npz file" if "pickle" in str(error) else f"{error.__class__.__name__}: {error}"
            raise ClipError(f"{path}: not a clip written by 'kine2go motion retarget' ({problem})") from None
        validate(clip, path)
        return clip


def robot_of(clips: Sequence[MotionClip]) -> RobotSpec:
    """Return the robot that clips are for.

    Raises:
        ClipError: they are for different ones.
        Kine2GoError: the robot is not available here.
    """
    for clip in clips:
        if clip.robot != clips[0].robot:
            raise ClipError(
                f"clip {clip.name} is for the robot {clip.robot} and {clips[0].name} for {clips[0].robot}; "
                "retarget them to one robot"
            )
    return clips[0].spec


def assemble_clip(
    poses: Poses,
    spec: RobotSpec,
    *,
    name: str,
    frame_duration: float,
    stance: Array,
    residual: Array,
    cycle: CycleStep | None,
    origin: ClipOrigin,
    time_scale: float = 1.0,
    body_rests: Array | None = None,
) -> MotionClip:
    """Make a clip of poses with joints, a closed cycle unless ``cycle`` is none; ``MotionClip`` has the rest.

    Without ``body_rests`` the robot stands on its feet alone.
    """
    assert poses.joints is not None
    none = np.empty(0)
    return MotionClip(
        name=name,
        frame_duration=frame_duration,
        root_position=poses.root_position,
        root_orientation=poses.root_orientation,
        joint_position=poses.joints,
        root_linear_velocity=none,
        root_angular_velocity=none,
        joint_velocity=none,
        foot_position=none,
        stance=stance,
        body_rests=np.zeros((len(stance), 2)) if body_rests is None else body_rests,
        residual=residual,
        cycle=cycle,
        origin=origin,
        robot=spec.reference,
        time_scale=time_scale,
    ).completed(spec)
