"""Policies of any origin: a Python callable, an ONNX file with a manifest, or one of ours."""

import inspect
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.benchmark.observation import Observation, Rows, parsed
from kine2go_warp.deployment.controller import ExportedPolicy, TrackingController, open_session
from kine2go_warp.deployment.export import up_to_date_export
from kine2go_warp.deployment.metadata import ONNX_FILE
from kine2go_warp.deployment.observer import MeasuredState
from kine2go_warp.deployment.reference import Pose
from kine2go_warp.deployment.rotations import between, to_matrix
from kine2go_warp.errors import PolicyError
from kine2go_warp.files import sha256_of
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.objects import load_object
from kine2go_warp.robots import RobotSpec
from kine2go_warp.settings import from_dictionary

Act = Callable[[Observation], NDArray[Any]]
"""Returns the actions of all worlds in the dataset's unit, shape [num_worlds, 12]; called once a row, in order."""


@dataclass(frozen=True)
class BenchmarkPolicy:
    """A policy that can be benchmarked."""

    name: str
    sha256: str
    """Of the file that it is in."""
    begin: Callable[[RobotSpec, Rows], Act]
    """Return what acts in some worlds from their first row on, given robot and references [num_worlds, num_rows, ...].

    Raises:
        PolicyError: the policy cannot act on this robot.
    """


@dataclass(frozen=True)
class Manifest:
    """What the JSON file beside an ONNX model says."""

    observation: tuple[str, ...]
    """Features side by side in the model's input, shape [num_worlds, size]; see ``Observation``."""
    name: str = ""
    """By default that of the file."""

    def __post_init__(self) -> None:
        if not self.observation:
            raise ValueError("observation must name at least one feature")
        for key in self.observation:
            parsed(key)


def load_policy(reference: str, name: str = "") -> BenchmarkPolicy:
    """Return the policy that a reference names.

    Args:
        reference: An ``.onnx`` file with its manifest beside it, as ``.json``; a policy folder or an exported policy of
            ours; or ``module:NAME`` or ``file.py:NAME``, a function from observation to actions or a class whose
            instances are one.
        name: Its name in results, instead of its own.

    Raises:
        Kine2GoError: there is none, or it cannot be read.
    """
    path = Path(reference)
    if path.suffix == ".onnx":
        return onnx_policy(path, name)
    if path.is_dir():
        return our_policy(path, name)
    if ":" not in reference:
        raise PolicyError(f"{reference}: no policy here; name an .onnx file, a policy folder, or file.py:NAME")
    made: Any = load_object(reference)
    if not callable(made):
        raise PolicyError(f"{reference}: is no function or class")

    def begin(_spec: RobotSpec, _reference: Rows) -> Act:
        act: Any = made() if inspect.isclass(made) else made
        return act

    return BenchmarkPolicy(name or reference.rpartition(":")[2], sha256_of(Path(inspect.getfile(made))), begin)


def onnx_policy(path: Path, name: str = "") -> BenchmarkPolicy:
    """Return the policy in an ONNX file, whose first input is the observation and whose first output the action.

    Raises:
        PolicyError: model or manifest cannot be read, or do not fit each other.
    """
    file = path.with_suffix(".json")
    try:
        values = json.loads(file.read_text())
        manifest = from_dictionary(Manifest, values, str(file), PolicyError)
    except FileNotFoundError:
        raise PolicyError(f"{file}: missing; it names the features of the observation (docs/benchmark.md)") from None
    except (ValueError, TypeError, OSError) as error:
        raise PolicyError(f"{file}: cannot be read ({error})") from None
    session = open_session(path)
    (source, *_), (target, *_) = session.get_inputs(), session.get_outputs()

    def act(observation: Observation) -> NDArray[Any]:
        seen = observation.stacked(manifest.observation)
        if isinstance(source.shape[-1], int) and source.shape[-1] != seen.shape[1]:
            raise PolicyError(
                f"{path}: takes {source.shape[-1]} numbers, and the features of {file.name} have {seen.shape[1]}"
            )
        return session.run([target.name], {source.name: seen})[0]

    return BenchmarkPolicy(name or manifest.name or path.stem, sha256_of(path), lambda *_: act)


def our_policy(folder: Path, name: str = "") -> BenchmarkPolicy:
    """Return a policy of ours, from its folder, where it is exported if it has not been, or from an export.

    Raises:
        PolicyError: it cannot be read.
    """
    if not (folder / ONNX_FILE).is_file():
        name, folder = name or folder.name or folder.resolve().name, up_to_date_export(PolicyFolder(folder))
    exported_policy = ExportedPolicy.load(folder)

    def begin(spec: RobotSpec, reference: Rows) -> Act:
        if exported_policy.metadata.joint_names != spec.joint_names:
            raise PolicyError(f"{folder}: drives another robot than {spec.name}")
        worlds = len(reference["reference_root_position"])
        controllers = [
            TrackingController(
                exported_policy, RecordedReference({name: rows[world] for name, rows in reference.items()})
            )
            for world in range(worlds)
        ]

        def act(observation: Observation) -> NDArray[Any]:
            states = observation.state
            measured = [
                MeasuredState(**{name: np.asarray(values[world], np.float64) for name, values in states.items()})
                for world in range(worlds)
            ]
            targets = [controller.act(state) for controller, state in zip(controllers, measured, strict=True)]
            return (np.array(targets) - spec.default_joint_position) / spec.action_scale

        return act

    return BenchmarkPolicy(name or folder.name or folder.resolve().name, sha256_of(folder / ONNX_FILE), begin)


class RecordedReference:
    """The reference of a trajectory, from its rows; beyond the last row it stays there."""

    def __init__(self, rows: Rows) -> None:
        """Keep the rows of one trajectory, each array of shape [num_rows, ...]."""
        self._rows = rows
        self._last = len(rows["reference_root_position"]) - 1

    def root(self, step: float) -> Pose:
        """See ``Reference``."""
        one, other, fraction = self._neighbours(step)
        turns = self._rows["reference_root_orientation"]
        turn = between(to_matrix(turns[one]), to_matrix(turns[other]), fraction)
        return Pose(self._interpolated("reference_root_position", step), turn)

    def joint_position(self, step: float) -> NDArray[np.float64]:
        """See ``Reference``."""
        return self._interpolated("reference_joint_position", step)

    def joint_velocity(self, step: float) -> NDArray[np.float64]:
        """See ``Reference``."""
        return self._interpolated("reference_joint_velocity", step)

    def _interpolated(self, name: str, step: float) -> NDArray[np.float64]:
        one, other, fraction = self._neighbours(step)
        rows = self._rows[name].astype(np.float64)
        return (1.0 - fraction) * rows[one] + fraction * rows[other]

    def _neighbours(self, step: float) -> tuple[int, int, float]:
        """Return the rows around a step, and how far it is from the first."""
        place = min(max(step, 0.0), float(self._last))
        one = int(place)
        return one, min(one + 1, self._last), place - one
