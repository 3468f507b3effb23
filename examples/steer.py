"""Steer the robot: a reference is stitched from clips by speed and turn rate, and a policy that tracks many follows it.

Motion matching: a few times a second that frame of all clips is sought which goes on as commanded and whose pose is
nearest to the present one. The jump is faded out. The robot is simulated in plain MuJoCo, live in the Rerun viewer.
"""

import contextlib
import select
import sys
import termios
import time
import tty
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import tyro
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from kine2go_warp.cli.data import PolicyPath, read_clips
from kine2go_warp.cli.main import run_script
from kine2go_warp.cli.watching import watching
from kine2go_warp.deployment.controller import ExportedPolicy, TrackingController
from kine2go_warp.deployment.export import up_to_date_export
from kine2go_warp.deployment.steering import Command, Frames, MatchingConfig, SteeredReference
from kine2go_warp.errors import Kine2GoError
from kine2go_warp.evaluation.config import EvalConfig
from kine2go_warp.evaluation.mujoco import MujocoRollouts
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.rotations import heading
from kine2go_warp.scores.plots import COLOURS, new_figure, save

KEYS = "w and s: faster and slower, a and d: turn left and right, q: quit"
SHOWN_AT_ONCE = 12
"""Control steps that go to the viewer together."""
LOST = 1.0
"""Distance from the reference at which the robot is lost [m]."""


@dataclass(frozen=True)
class Settings:
    """Steer a policy that tracks many clips, with keys or by a plan."""

    policy: PolicyPath
    """Policy folder made by 'kine2go policy train' of several clips."""
    clips: tuple[Path, ...] = ()
    """Clips (.npz) to stitch from; by default those that the policy was trained on."""
    plan: tuple[str, ...] = ()
    """What is commanded instead of keys, as SECONDS:SPEED:TURN in s, m/s and rad/s, such as 3:1.0:0 4:0.8:-0.6."""
    rerun: bool = False
    """Watch in the Rerun viewer."""
    rerun_web: bool = False
    """Watch in a browser on this machine."""
    rerun_save: Path | None = None
    """Write a recording (.rrd) instead."""
    picture: Path | None = None
    """Draw the way, and what was commanded beside what was done, to this file (.png)."""
    matching: tyro.conf.OmitArgPrefixes[MatchingConfig] = field(default_factory=MatchingConfig)


@dataclass
class Drive:
    """The robot on its way."""

    rollouts: MujocoRollouts
    controller: TrackingController
    reference: SteeredReference
    rows: list[dict[str, NDArray[np.float32]]]
    """Of all control steps, as in a dataset."""

    def step(self) -> bool:
        """Advance by a control step; return whether the robot still follows."""
        number, state = self.controller.step, self.rollouts.measured()
        self.rollouts.robot.step(self.controller.act(state))
        root = self.reference.root(number)
        rows = {
            "root_position": state.root_position,
            "root_orientation": state.root_orientation,
            "joint_position": state.joint_position,
            "reference_root_position": root.position,
            "reference_root_orientation": Rotation.from_matrix(root.rotation).as_quat(scalar_first=True),
            "reference_joint_position": self.reference.joint_position(number),
            "foot_contact_force": np.zeros((4, 3)),
        }
        self.rows.append({name: np.asarray(value, np.float32) for name, value in rows.items()})
        off = np.linalg.norm(state.root_position - root.position)
        return bool(off < LOST) and not self.rollouts.robot.touches_ground


def begin(settings: Settings, command: Command) -> Drive:
    """Place the robot at the beginning of a reference.

    Raises:
        Kine2GoError: policy or clips cannot be used.
    """
    folder = PolicyFolder(settings.policy)
    record = folder.read_record()
    clips = folder.checked_clips(record, read_clips(settings.clips)) or folder.read_clips(record)
    policy = ExportedPolicy.load(up_to_date_export(folder))
    rate = policy.metadata.control_rate
    reference = SteeredReference(Frames.of(clips, rate, settings.matching.look_ahead), rate, settings.matching, command)
    rollouts = MujocoRollouts(policy, record.preset.env, EvalConfig())
    root, ahead = reference.root(0.0), reference.root(1.0)
    joint_q = np.concatenate(
        [root.position, Rotation.from_matrix(root.rotation).as_quat(), reference.joint_position(0.0)]
    )
    velocity = rate * (ahead.position - root.position)
    turning = rate * Rotation.from_matrix(ahead.rotation @ root.rotation.T).as_rotvec()
    rollouts.robot.set_state(joint_q, np.concatenate([velocity, turning, reference.joint_velocity(1.0)]))
    return Drive(rollouts, TrackingController(policy, reference), reference, [])


def planned(plan: Sequence[str]) -> list[tuple[float, Command]]:
    """Return the commands of a plan with the time that each lasts [s].

    Raises:
        Kine2GoError: a part is not of the form SECONDS:SPEED:TURN.
    """
    found = []
    for part in plan:
        try:
            seconds, speed, turn = map(float, part.split(":"))
        except ValueError:
            seconds = speed = turn = float("nan")
        if not (0.0 < seconds < 1e4 and abs(speed) < 10.0 and abs(turn) < 10.0):
            raise Kine2GoError(f"--plan {part}: expected SECONDS:SPEED:TURN, such as 3:1.0:-0.5")
        found.append((seconds, Command(speed, turn)))
    return found


def commands_of(plan: Sequence[tuple[float, Command]], rate: float) -> Iterator[Command]:
    """Yield the command of every control step of a plan."""
    for seconds, command in plan:
        for _ in range(round(seconds * rate)):
            yield command


@contextlib.contextmanager
def keys() -> Iterator[Callable[[], str]]:
    """Read single keys from the terminal: yield a function that returns the next one, or nothing.

    Raises:
        Kine2GoError: there is no terminal.
    """
    if not sys.stdin.isatty():
        raise Kine2GoError("there is no terminal to read keys from; give a --plan")
    before = termios.tcgetattr(sys.stdin)
    try:
        tty.setcbreak(sys.stdin)
        yield lambda: sys.stdin.read(1) if select.select([sys.stdin], [], [], 0.0)[0] else ""
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)


def commands_of_keys(pressed: Callable[[], str], command: Command) -> Iterator[Command]:
    """Yield the command of every control step, as the keys change it, until ``q``."""
    while (key := pressed()) != "q":
        faster = {"w": 0.1, "s": -0.1}.get(key, 0.0)
        turned = {"a": 0.2, "d": -0.2}.get(key, 0.0)
        if faster or turned:
            command = Command(round(command.speed + faster, 3), round(command.turn + turned, 3))
            print(f"\r{command.speed:.1f} m/s, {command.turn:+.1f} rad/s   ", end="", flush=True)
        yield command


def run(settings: Settings) -> None:
    """Steer until the plan or the user ends it, or the robot is lost."""
    plan = planned(settings.plan)
    with contextlib.ExitStack() as stack:
        pressed = None if plan else stack.enter_context(keys())
        drive = begin(settings, plan[0][1] if plan else Command(1.0, 0.0))
        rate, spec = drive.reference.rate, drive.rollouts.spec
        shown = watching("steering", spec, settings.rerun, settings.rerun_web, settings.rerun_save)
        observer = stack.enter_context(shown)
        live = bool(pressed) or settings.rerun or settings.rerun_web
        if pressed:
            print(KEYS)
        commands = commands_of(plan, rate) if pressed is None else commands_of_keys(pressed, drive.reference.command)
        start, follows, done = time.monotonic(), True, list[Command]()
        for number, command in enumerate(commands, 1):
            drive.reference.command = command
            done.append(command)
            follows = drive.step()
            if observer is not None and number % SHOWN_AT_ONCE == 0:
                some = drive.rows[-SHOWN_AT_ONCE:]
                times = np.arange(number - SHOWN_AT_ONCE, number) / rate
                observer.on_worlds(times, {name: np.stack([row[name] for row in some])[None] for name in some[0]})
            if not follows:
                break
            if live:
                time.sleep(max(0.0, start + number / rate - time.monotonic()))
    print(summary(drive, follows))
    if settings.picture is not None:
        print(f"{draw(drive, done, settings.picture)}: the way, speed and turn rate")


def summary(drive: Drive, follows: bool) -> str:
    """Return in words how far the robot came and how well it followed."""
    rows = {name: np.stack([row[name] for row in drive.rows]) for name in drive.rows[0]}
    joints = rows["joint_position"] - rows["reference_joint_position"]
    off = np.linalg.norm(rows["root_position"] - rows["reference_root_position"], axis=-1)
    seconds = len(off) / drive.reference.rate
    return (
        f"\n{'followed' if follows else 'was lost after'} {seconds:.1f} s with {drive.reference.jumps} jumps between "
        f"clips: joint RMSE {np.sqrt(np.mean(joints**2)):.3f} rad, root {100.0 * off.mean():.1f} cm off on average"
    )


def draw(drive: Drive, commands: Sequence[Command], path: Path) -> Path:
    """Draw the way from above, and speed and turn rate as commanded, of the reference and of the robot."""
    rows = {name: np.stack([row[name] for row in drive.rows]) for name in drive.rows[0]}
    time, span = np.arange(len(drive.rows)) / drive.reference.rate, round(0.5 * drive.reference.rate)
    figure = new_figure(9.0, 3.6)
    way, speed, turn = figure.subplots(1, 3)
    way.set(title="way [m]", aspect="equal")
    speed.set(title="speed [m/s]", xlabel="time [s]")
    turn.set(title="turn rate [rad/s]", xlabel="time [s]")
    speed.plot(time, [command.speed for command in commands], color="0.3", linestyle="--", label="commanded")
    turn.plot(time, [command.turn for command in commands], color="0.3", linestyle="--")
    for colour, name, prefix in zip(COLOURS, ("reference", "robot"), ("reference_", ""), strict=False):
        position, orientation = rows[f"{prefix}root_position"], rows[f"{prefix}root_orientation"]
        yaw = np.unwrap(heading(orientation.astype(np.float64)))
        # Over half a second, so that the swaying of each stride does not hide it.
        going = (position[span:, :2] - position[:-span, :2]) * drive.reference.rate / span
        middle = 0.5 * (yaw[span:] + yaw[:-span])
        way.plot(*position[:, :2].T, color=colour, label=name)
        speed.plot(time[span:], going[:, 0] * np.cos(middle) + going[:, 1] * np.sin(middle), color=colour, label=name)
        turn.plot(time[span:], (yaw[span:] - yaw[:-span]) * drive.reference.rate / span, color=colour)
    speed.legend(fontsize="small")
    return save(figure, path)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script and return its exit status: 2 for an error that the user can mend."""
    return run_script(run, Settings, arguments)


if __name__ == "__main__":
    sys.exit(main())
