"""Files that hold one row a frame, of a robot's base and joints: JSON, pickles, tables and ``.npz``."""

import io
import json
import pickle
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.keypoints import MINIMUM_FRAMES, RATES
from kine2go_warp.motions.sources.arrays import checked_rate, rate_of, read_npz
from kine2go_warp.motions.sources.tables import is_number, parse_numbers, read_bytes, read_lines, read_text
from kine2go_warp.robots import GO2
from kine2go_warp.tables import counted

Array = NDArray[np.float64]

LARGEST_VALUE = 1e6


@dataclass(frozen=True)
class Rows:
    """Rows of numbers, whatever file they were in."""

    values: Array
    """Shape [num_frames, num_columns]."""
    columns: tuple[str, ...] = ()
    """Names of the columns, where the file has them."""
    rate: float | None = None
    """Frames per second [Hz], where the file tells."""
    legs: tuple[str, ...] = ()
    """Order of the legs, where the file tells."""
    robot: str = ""
    """Whose joints they are, where the file tells."""

    def take(self, wanted: tuple[str, ...], where: str) -> Array:
        """Return columns, shape [num_frames, num_wanted].

        Args:
            wanted: Names, or ranges of numbers such as ``"7:19"``.
            where: The file, for messages.

        Raises:
            ClipError: a column is not there.
        """
        chosen: list[int] = []
        for one in wanted:
            first, colon, last = one.partition(":")
            if one in self.columns:
                chosen.append(self.columns.index(one))
            elif colon and first.isdigit() and last.isdigit() and int(last) <= self.values.shape[1]:
                chosen += range(int(first), int(last))
            else:
                raise ClipError(f"{where}: has no column '{one}'")
        return self.values[:, chosen]


def read_frames(path: Path) -> Rows:
    """Read JSON with ``Frames`` and ``FrameDuration``, as DeepMimic's heirs write it.

    Raises:
        ClipError: the file is missing, is something else, or is damaged.
    """
    try:
        content = json.loads(read_text(path))
    except (ValueError, RecursionError) as error:
        raise ClipError(f"{path}: not JSON ({error})") from None
    if not isinstance(content, dict) or "Frames" not in content:
        raise ClipError(f"{path}: JSON without 'Frames'")
    duration = content.get("FrameDuration")
    if not isinstance(duration, int | float) or not 1.0 / RATES[1] <= duration <= 1.0 / RATES[0]:
        raise ClipError(f"{path}: FrameDuration is {duration!r:.40}; 0.001 to 1 s can be used")
    legs = content.get("LegOrder", [])
    return Rows(_matrix(content["Frames"], path), rate=1.0 / duration, legs=tuple(map(str, legs)))


def read_pickle(path: Path) -> Rows:
    """Read a pickled dictionary of ``frames`` and ``fps``, as MimicKit writes it, without running any code in it.

    Raises:
        ClipError: the file is missing, is something else, is damaged, or asks for more than numbers and lists.
    """
    try:
        content = _Plain(io.BytesIO(read_bytes(path))).load()
    except ClipError as error:
        raise ClipError(f"{path}: {error}") from None
    except Exception as error:  # noqa: BLE001 - damaged pickles raise errors of many kinds
        raise ClipError(f"{path}: not a pickle that can be read safely ({error.__class__.__name__})") from None
    if isinstance(content, dict) and len(content) == 1 and isinstance(only := next(iter(content.values())), dict):
        content = _posed(only, path)
    if not isinstance(content, dict) or "frames" not in content:
        raise ClipError(f"{path}: a pickle without 'frames'")
    rate = content.get("fps")
    if not isinstance(rate, int | float):
        raise ClipError(f"{path}: fps is {rate!r:.40}, not a number")
    return Rows(_matrix(content["frames"], path), rate=checked_rate(rate, path))


def _posed(content: dict[str, Any], path: Path) -> dict[str, Any]:
    """Return one motion of HumanoidVerse, PHC or ASAP as rows: position, orientation (x, y, z, w), joints.

    Raises:
        ClipError: one of its arrays is missing, or of another shape.
    """
    names = ("root_trans_offset", "root_rot", "dof")
    if missing := [name for name in names if name not in content]:
        raise ClipError(f"{path}: lacks {', '.join(missing)}")
    return {"fps": content.get("fps"), "frames": side_by_side(content, names, path)}


def side_by_side(content: Mapping[str, Any], names: Sequence[str], path: Path) -> NDArray[Any]:
    """Return arrays with a row a frame side by side, shape [num_frames, num_columns].

    Raises:
        ClipError: one holds no numbers, or another number of rows.
    """
    arrays = [np.asarray(content[name]) for name in names]
    if any(one.dtype.kind not in "fiu" or one.ndim < 2 for one in arrays) or len({len(one) for one in arrays}) > 1:
        shapes = ", ".join(f"{name} {one.shape}" for name, one in zip(names, arrays, strict=True))
        raise ClipError(f"{path}: {shapes}; expected numbers with a row for each frame")
    return np.concatenate([one.reshape(len(one), -1) for one in arrays], axis=1)


def read_torch(path: Path) -> Rows:
    """Read a ``.motion`` of ProtoMotions, without running any code in it: base, orientation (x, y, z, w), joints.

    Raises:
        ClipError: the file is missing, is something else, or is damaged.
    """
    import torch

    try:
        content = torch.load(io.BytesIO(read_bytes(path)), map_location="cpu", weights_only=True)
        arrays = {name: np.asarray(content[name]) for name in ("rigid_body_pos", "rigid_body_rot", "dof_pos")}
        rate = float(content["fps"])
    except ClipError:
        raise
    except Exception as error:  # noqa: BLE001 - damaged files raise errors of many kinds
        raise ClipError(f"{path}: no .motion that can be read safely ({error.__class__.__name__})") from None
    if any(arrays[name].ndim != 3 for name in ("rigid_body_pos", "rigid_body_rot")):
        raise ClipError(f"{path}: rigid_body_pos and rigid_body_rot need a row for each frame and body")
    base = {name: values[:, 0] if values.ndim == 3 else values for name, values in arrays.items()}
    return Rows(_checked(side_by_side(base, tuple(base), path).astype(np.float64), path), rate=checked_rate(rate, path))


class _Plain(pickle.Unpickler):
    """Builds lists, dictionaries, texts and numbers, and NumPy's arrays of numbers; anything else is refused."""

    ALLOWED: ClassVar[dict[tuple[str, str], Any]] = {
        ("numpy", "dtype"): np.dtype,
        ("numpy", "ndarray"): np.ndarray,
        **{(f"numpy.{core}.multiarray", "_reconstruct"): None for core in ("core", "_core")},
        **{(f"numpy.{core}.multiarray", "scalar"): None for core in ("core", "_core")},
    }

    def find_class(self, module: str, name: str) -> Any:
        """Return one of the few things that arrays of numbers are made with."""
        if (module, name) not in self.ALLOWED:
            raise ClipError(f"asks for {module}.{name}, which a file of numbers does not need; it was not run")
        return self.ALLOWED[module, name] or super().find_class(module, name)

    def persistent_load(self, pid: Any) -> Any:
        """Refuse what lies outside of the file."""
        raise ClipError(f"refers to an object outside ({pid!r:.40})")


def read_table(path: Path) -> Rows:
    """Read comma-separated numbers below a line of names; a column ``time`` [s] tells the rate.

    Raises:
        ClipError: the file is missing, or a line has another width or holds something that is not a number.
    """
    lines = read_lines(path)
    columns = tuple(name.strip().strip('"') for name in lines[0].split(","))
    if len(set(columns)) < len(columns) or all(is_number(name) for name in columns):
        raise ClipError(f"{path}, line 1: expected names of columns, each of them once")
    values = parse_numbers(path, lines[1:], len(columns), LARGEST_VALUE, 2, columns)
    rate = rate_of(values[:, columns.index("time")], path) if "time" in columns else None
    return Rows(values, columns, rate)


def read_arrays(path: Path) -> Rows:
    """Read an ``.npz`` with ``root_position``, ``root_orientation`` (w, x, y, z) and ``joint_position``.

    A clip of ours is one, and so is each file of ``kine2go dataset export --format npz``. The rate is that of a clip's
    header, or of an array ``time`` [s]. Motions of mjlab and BeyondMimic have ``body_pos_w``, ``body_quat_w``,
    ``joint_pos`` and ``fps``; their joints must be leg by leg, as ``joint_names`` tells where it is there.

    Raises:
        ClipError: the file is missing, is something else, or is damaged.
    """
    names = ("root_position", "root_orientation", "joint_position")
    data = read_npz(path)
    if {"body_pos_w", "joint_pos"} <= set(data):
        data = _of_mjlab(data, path)
    if missing := [name for name in names if name not in data]:
        raise ClipError(f"{path}: lacks {', '.join(missing)}")
    if not all(data[name].dtype.kind in "fiu" for name in names):
        raise ClipError(f"{path}: an array holds something else than numbers")
    arrays = [np.asarray(data[name], np.float64) for name in names]
    header = _header(data, path)
    rate = _rate(data, header, path)
    widths = [array.shape[1] if array.ndim == 2 else 0 for array in arrays]
    if widths != [3, 4, 12] or len({len(array) for array in arrays}) > 1:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in zip(names, arrays, strict=True))
        raise ClipError(f"{path}: {shapes}; expected (frames, 3), (frames, 4), (frames, 12)")
    return Rows(_checked(np.concatenate(arrays, axis=1), path), rate=rate, robot=str(header.get("robot", "")))


def _of_mjlab(data: dict[str, Any], path: Path) -> dict[str, Any]:
    """Return a motion of mjlab by our names.

    Raises:
        ClipError: an array is missing or has another shape, or the joints are in another order.
    """
    if missing := [name for name in ("body_quat_w", "fps") if name not in data]:
        raise ClipError(f"{path}: lacks {', '.join(missing)}")
    if data["body_pos_w"].ndim != 3 or data["body_quat_w"].ndim != 3 or data["fps"].size != 1:
        raise ClipError(f"{path}: body_pos_w and body_quat_w need a row for each frame and body, fps one number")
    joints = tuple(map(str, data.get("joint_names", GO2.joint_names)))
    if sorted(joints) != sorted(GO2.joint_names):
        raise ClipError(f"{path}: joints {', '.join(joints)}; expected {', '.join(GO2.joint_names)} in some order")
    rate = checked_rate(float(np.ravel(data["fps"])[0]), path)
    return {
        "root_position": data["body_pos_w"][:, 0],
        "root_orientation": data["body_quat_w"][:, 0],
        "joint_position": data["joint_pos"][..., [joints.index(name) for name in GO2.joint_names]],
        "time": np.arange(len(data["joint_pos"])) / rate,
    }


def _header(data: dict[str, Any], path: Path) -> dict[str, Any]:
    """Return the header of a clip of ours; nothing where there is none."""
    try:
        header = json.loads(str(data.get("header", "{}")))
    except (ValueError, RecursionError):
        raise ClipError(f"{path}: its header is not JSON") from None
    if not isinstance(header, dict):
        raise ClipError(f"{path}: its header is not JSON of a clip")
    return header


def _rate(data: dict[str, Any], header: dict[str, Any], path: Path) -> float:
    """Return the frame rate of an ``.npz`` [Hz]."""
    if "time" in data:
        return rate_of(data["time"], path)
    duration = header.get("frame_duration")
    if isinstance(duration, int | float) and duration > 0.0:
        return checked_rate(1.0 / duration, path)
    if duration is not None:
        raise ClipError(f"{path}: a frame duration of {duration!r:.40}; it must be positive [s]")
    raise ClipError(f"{path}: tells no rate; it needs an array 'time' [s]")


def _matrix(frames: Any, path: Path) -> Array:
    """Return frames as rows of numbers; the message names the first one that differs."""
    if isinstance(frames, np.ndarray):
        frames = frames.tolist()
    if not isinstance(frames, list) or len(frames) < MINIMUM_FRAMES:
        raise ClipError(f"{path}: no list of at least {MINIMUM_FRAMES} frames")
    width = len(frames[0]) if isinstance(frames[0], list | tuple | np.ndarray) else 0
    rows = np.empty((len(frames), width))
    for index, frame in enumerate(frames):
        if not isinstance(frame, list | tuple | np.ndarray) or len(frame) != width or width == 0:
            raise ClipError(f"{path}, frame {index}: not the {width} numbers that frame 0 has")
        try:
            rows[index] = frame
        except (OverflowError, TypeError, ValueError):
            raise ClipError(f"{path}, frame {index}: holds something that is not a number") from None
    return _checked(rows, path)


def _checked(rows: Array, path: Path) -> Array:
    """Return rows whose values are finite and of a size that lengths and angles have."""
    wrong = ~(np.abs(rows) <= LARGEST_VALUE)
    if wrong.any():
        frame, column = np.argwhere(wrong)[0]
        raise ClipError(f"{path}, frame {frame}: column {column} is not finite or exceeds {LARGEST_VALUE:g}")
    if len(rows) < MINIMUM_FRAMES:
        raise ClipError(f"{path}: {counted(len(rows), 'frame')}; a motion needs at least {MINIMUM_FRAMES}")
    return rows
