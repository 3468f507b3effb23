"""The page docs/environment.md, written from the code that it describes; ``docs/make.py`` writes it."""

import ast
from collections.abc import Iterator, Sequence
from dataclasses import fields
from pathlib import Path

from kine2go_warp.env.config import EnvConfig, TerrainConfig
from kine2go_warp.env.observations import observation_layout, observation_size, place_privileged
from kine2go_warp.robots import GO2, RobotSpec
from kine2go_warp.robots.spec import FRICTION_STIFFNESS, LEG_JOINTS

KERNELS = Path(__file__).resolve().parent.parent / "kernels"

INTRODUCTION = """# The environment

Written by `uv run python docs/make.py`; a test compares.

One control step ({control_rate:.0f} Hz) is {substeps} physics steps. Within one captured graph: the action becomes
joint targets, pushes, the substeps with the motors' PD law and latency, contacts, reference, rewards, ends of episodes,
new episodes, observation. Nothing is allocated, the host is not waited for, and no Python runs for a world.
"""


EXTENSION = """## Add terms in your own file

Rewards, observations and ends of episodes are terms: a name, a Warp kernel and its parameters. What is drawn for the
worlds is a list of terms, too. A file of your own may add some, switch others off, and change weights, limits and
ranges; the package is not touched. Say this is `my_file.py`:

```python
from dataclasses import replace

import warp as wp

from kine2go_warp.env.terms.base import with_term
from kine2go_warp.env.terms.observations import ObservationTerm
from kine2go_warp.env.terms.randomization import RandomizationTerm
from kine2go_warp.env.terms.rewards import RewardTerm
from kine2go_warp.env.terms.terminations import TerminationTerm
from kine2go_warp.kernels.kinematics import leg_point_velocity_w
from kine2go_warp.kernels.state import joint_position, root_position
from kine2go_warp.kernels.world import WorldView
from kine2go_warp.learning.presets import FAST


@wp.kernel
def foot_slip(view: WorldView, out: wp.array2d(dtype=float), column: int, contact_force: float):
    world = wp.tid()
    total = float(0.0)
    for leg in range(4):
        if view.foot_force[world, leg][2] > contact_force:
            velocity = leg_point_velocity_w(view.robot, view.geometry, world, leg, 3)
            total += velocity[0] * velocity[0] + velocity[1] * velocity[1]
    out[world, column] = total


@wp.kernel
def previous_command(view: WorldView, out: wp.array2d(dtype=float), column: int):
    world = wp.tid()
    for joint in range(12):
        command = view.joint_target[world, joint]
        if view.done[world] != wp.int64(0):  # a new episode, whose motors hold the joints where they are
            command = joint_position(view.robot, world, joint)
        out[world, column + joint] = command - view.default_position[joint]


@wp.kernel
def base_is_low(view: WorldView, out: wp.array2d(dtype=float), column: int, min_height: float):
    world = wp.tid()
    out[world, column] = wp.where(root_position(view.robot, world)[2] < min_height, 1.0, 0.0)


SLIP = RewardTerm("foot_slip", foot_slip, {"contact_force": 5.0}, weight=-0.1, formula="Σ v² of feet in contact [m/s]")
COMMAND = ObservationTerm("previous_command", previous_command, dims=("joint",), unit="rad", mirror="angle")
LOW = TerminationTerm("base_low", base_is_low, {"min_height": 0.15}, unit="m")
BATTERY = RandomizationTerm("battery", range=(0.8, 1.0), parameter="strength", shared=True)
ENV = FAST.env
PRESET = replace(
    FAST,
    env=replace(
        ENV,
        rewards=(*with_term(ENV.rewards, "joint_position", exponent=4.0), SLIP),
        observations=(*with_term(ENV.observations, "linear_velocity_b", enabled=False), COMMAND),
        terminations=(*ENV.terminations, LOW),
        randomization=(*ENV.randomization, BATTERY),
    ),
)
```

`kine2go policy train CLIP --preset my_file.py:PRESET` trains with it. A kernel takes `(view, out, column)` and then the
term's parameters by their names; it is launched over all worlds, and writes one value (a reward, before its weight) or
as many as its `dims` have (an observation: `axis` 3, `joint` 12, `foot` 4) to `out[world, column]` and on; a
termination writes 1 where the episode ends, else 0. What it can read is in the tables below. A
randomization term has no kernel: it names a parameter of the table below, draws from its range and scales, shifts or
sets it, one draw a joint or one for all (`shared`). Other arrays of the model are out of its reach.

A term of the package or of yours is a setting by its name: `[train.env.rewards.foot_slip] weight = -0.2`,
`[train.env.observations.last_action] enabled = false`, `[train.env.terminations.base_low.params] min_height = 0.1`,
`[train.env.randomization] friction = [0.5, 1.0]`. TensorBoard, Rerun, `policy.json`, the dataset's labels and the
reasons of rejected rollouts follow. `gather` and `eval` keep your ends of episodes, with their own limits of distance
and rotation, and draw what their own settings say; plain MuJoCo (`sim2sim`) knows the package's ends alone and names
the others. The policy folder refers to your file by its path: keep the file where it is. `kine2go policy export` writes
any policy, but the package's own controller knows the package's observations alone.

- An observation of yours joins the history as the others do. Observations are computed after new episodes have begun:
  where `done` is 1, states and reference are the new episode's, `joint_target` and `torque` may be the old one's.
- `mirror` says which signs change when left and right change places: `scalar` none, `vector` that of y, `rotation`
  those of x and z, `angle` that of the hip among a leg's three joints. Mirrored samples need it.
- `formula` of a reward is its text in tables, parameters in braces; `maximum` its largest value before the weight.
- TensorBoard has `Reward/NAME`, the mean of a step after the weight, and `Termination/NAME`.
"""


def view_section() -> str:
    """Return the tables of what a kernel may read."""
    world, state = (KERNELS / name for name in ("world.py", "state.py"))
    parts = {"view": (world, "WorldView"), "view.robot": (state, "RobotState")}
    parts["view.reference"] = (KERNELS / "reference.py", "ReferenceState")
    rows = [
        (f"`{path}.{name}`", f"`{kind}`", text)
        for path, (file, struct) in parts.items()
        for name, kind, text in struct_fields(file, struct)
    ]
    functions = [
        (f"`{call}`", file.stem, text) for file in (state, KERNELS / "kinematics.py") for call, text in calls(file)
    ]
    return f"""### What a kernel can read

Suffixes name frames: `_w` world, `_b` base, `_h` the base's heading. Quaternions are (x, y, z, w) in kernels.

{table(("field", "type", "meaning"), rows)}
Functions for kernels, of `kine2go_warp.kernels.state` and `kine2go_warp.kernels.kinematics`:

{table(("function", "module", "what it returns"), functions)}"""


def struct_fields(file: Path, struct: str) -> Iterator[tuple[str, str, str]]:
    """Yield name, type and docstring of the fields of a struct."""
    (found,) = (one for one in ast.parse(file.read_text()).body if isinstance(one, ast.ClassDef) and one.name == struct)
    for one, after in zip(found.body, [*found.body[1:], None], strict=True):
        if isinstance(one, ast.AnnAssign) and isinstance(one.target, ast.Name):
            value = after.value if isinstance(after, ast.Expr) else None
            text = value.value if isinstance(value, ast.Constant) else ""
            yield one.target.id, ast.unparse(one.annotation), " ".join(str(text).split()).replace("``", "`")


def calls(file: Path) -> Iterator[tuple[str, str]]:
    """Yield the signature of each Warp function of a file, and the first line of its docstring."""
    for one in ast.parse(file.read_text()).body:
        if isinstance(one, ast.FunctionDef) and any(ast.unparse(mark) == "wp.func" for mark in one.decorator_list):
            yield f"{one.name}({ast.unparse(one.args)})", (ast.get_docstring(one) or "").partition("\n")[0]


def environment_page(config: EnvConfig | None = None) -> str:
    """Return docs/environment.md."""
    config = config or EnvConfig()
    sections = (
        INTRODUCTION.format(control_rate=config.control_rate, substeps=config.substeps),
        observation_section(config),
        reward_section(config),
        EXTENSION,
        view_section(),
        termination_section(config),
        reset_section(config),
        randomization_section(),
        robot_section(config),
        terrain_section(),
        faults_section(),
    )
    return "\n".join(sections)


def table(headings: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Return a Markdown table."""
    lines = ["| " + " | ".join(headings) + " |", "|" + "---|" * len(headings)]
    return "\n".join([*lines, *("| " + " | ".join(str(cell) for cell in row) + " |" for row in rows)]) + "\n"


def observation_section(config: EnvConfig) -> str:
    """Return what the policy and the critic see."""
    headings = ("name", "from", "to", "unit", "meaning")

    def rows(layout: Sequence) -> list[tuple]:
        return [(f"`{row.name}`", row.start, row.stop, row.unit, row.description) for row in layout]

    return f"""## Observation

{observation_size(config)} numbers: the last {config.history_length} states, newest first, then the reference at
{", ".join(str(ahead) for ahead in config.steps_ahead)} control steps from now. `_b` is the base frame, `_h` the heading
frame (the base's yaw alone). Neither absolute position nor heading can be read from it. When an episode begins, the
history is filled with its first state. `policy.json` holds the same table.

{table(headings, rows(observation_layout(config)))}
With `privileged` the critic also sees:

{table(headings, rows([placed.field for placed in place_privileged(config)]))}"""


def reward_section(config: EnvConfig) -> str:
    """Return the reward terms."""
    rows = []
    for term in config.rewards:
        scale = term.weight / config.control_rate
        most = "" if term.maximum is None else f"{scale * term.maximum:.6f}"
        rows.append((f"`{term.name}`", term.weight, f"{scale:.6f}", most, term.formula_text))
    return f"""## Reward

The reward is the sum of the terms below, those of weight 0 left out. Weights are the paper's; each is divided by the
control rate. A state that is not finite earns nothing. Each term is one kernel of `kernels/rewards.py`, named with its
weight and its parameters in `kine2go_warp/env/terms/rewards.py`.

{table(("term", "weight", "per step", "at most", "formula before the weight"), rows)}"""


def termination_section(config: EnvConfig) -> str:
    """Return why episodes end."""
    rows = []
    for number, term in enumerate(config.terminations, 1):
        limit = ", ".join(f"{value:g} {term.unit}" for _, value in term.params)
        limit = f"{config.episode_time} s" if term.is_time_out else limit
        rows.append((number, f"`{term.name}`", limit, term.description))
    return f"""## Ends of episodes

The first of the list that applies counts, a time-out last. Limits are those of `paper`; `fast` and `robust` are
stricter. Each is one kernel of `kernels/terminations.py`, named with its limits in
`kine2go_warp/env/terms/terminations.py`. With `initial_limit_scale` above 1 the limits of distance and rotation begin
at that multiple of their values and fall to them within `limit_anneal_time`.

{table(("number", "reason", "limit", "meaning"), rows)}"""


def reset_section(config: EnvConfig) -> str:
    """Return how episodes begin."""
    units = {"reference_probability": "-", "joint_position": "rad", "joint_velocity": "rad/s", "tilt": "rad"}
    units |= {"linear_velocity": "m/s", "angular_velocity": "rad/s"}
    meanings = {
        "reference_probability": "share of episodes that begin on the reference; the others stand where it is",
        "tilt": "roll and pitch",
        "linear_velocity": "of the base, along each axis",
        "angular_velocity": "of the base, about each axis",
    }
    rows = [
        (
            f"`{field.name}`",
            getattr(config.reset, field.name),
            units[field.name],
            meanings.get(field.name, "each joint"),
        )
        for field in fields(config.reset)
    ]
    sampling = config.phase_sampling
    return f"""## Beginnings of episodes

Clip, phase in the cycle and heading are drawn anew for each episode; half widths of what is added to them:

{table(("quantity", "value", "unit", "meaning"), rows)}
Phases are drawn evenly, or, with `phase_sampling.uniform_share` below 1, more often where the robot failed recently:
each clip is cut into {sampling.bins} bins, failures count {sampling.lookback} s before they happen, and counts fade by
the factor {sampling.memory} in a control step.
"""


def randomization_section() -> str:
    """Return what is drawn for each world."""
    moments = {"world": "world, at start-up", "episode": "episode", "push": "push"}
    rows = []
    for term in EnvConfig().randomization:
        drawn = term.drawn
        unit = "factor" if drawn.operation == "scale" else drawn.unit
        rows.append((f"`{term.name}`", unit, moments[drawn.when], *(drawn.dims or ("world",)), drawn.meaning))
    return f"""## Domain randomisation

Each is a range `[least, greatest]` of a uniform distribution, off by default (`robust` uses them all). What holds in a
world is recorded with each trajectory; a push with the row before it.

{table(("range", "unit", "drawn for", "each", "meaning"), rows)}"""


def robot_section(config: EnvConfig, spec: RobotSpec = GO2) -> str:
    """Return the body, the motors and the joints as they are simulated."""
    limits, solver = spec.motor_limits, config.solver
    columns = (
        ("driving torque [N m]", limits.driving),
        ("up to [rad/s]", limits.full_torque_speed),
        ("none from [rad/s]", limits.no_load_speed),
        ("braking torque [N m]", limits.braking),
        ("largest speed [rad/s]", spec.joint_speed),
        ("friction [N m]", spec.joint_friction),
    )
    rows = [(name, *(f"{values[index]:g}" for _, values in columns)) for index, name in enumerate(LEG_JOINTS)]
    return f"""## Robot

Masses, centres of mass and inertias are the URDF's, links on fixed joints merged with their parents; a test compares
every body with MuJoCo's own compiler. The rotors add {spec.armature:g} kg m² to each joint. `model_hash` of a motion is
a hash of the compiled numbers.


{table(("joint", *(name for name, _ in columns)), rows)}
Torques fall linearly between the two speeds. The calf's linkage gears its motor by 1.5, the ratio of the URDF's limits.
`motor.torque_speed=false` gives the URDF's limits at any speed. Friction counts `motor.friction` times, 1 in `fast` and
`robust` and 0 in `paper`. It is a damped spring of {FRICTION_STIFFNESS:g} N m/rad that slides once its torque is the
friction's: a joint at rest is held without creeping. It is part of the motors' kernel; as rows of the solver
(`frictionloss`, twelve more a world) it took a fifth of the environment's rate.

Joint stops are critically damped with a time constant of {solver.stop_time:g} s, whatever the inertia
(`solver.stop_time`). The robot's parts collide with the ground alone, or with one another, too (`solver.self_contact`),
which costs a tenth of the environment's rate.
`leg_distance` in the rows of a dataset is how far legs are from one another, the trunk and the head.
"""


def terrain_section() -> str:
    """Return the kinds of ground."""
    rows = [(f"`{field.name}`", getattr(TerrainConfig(), field.name)) for field in fields(TerrainConfig)]
    return f"""## Ground

A plane, or one height field for all worlds: `waves`, `steps`, `slopes`. The reference is lifted by the ground under its
root, smoothed over the length of the robot, and its vertical velocity grows by the climb; its tilt stays.

{table(("setting", "default"), rows)}"""


def faults_section() -> str:
    """Return what happens when the simulation fails."""
    return """## Faults

Full contact or constraint buffers and numbers that are not finite end the episode of their world, are counted on the
device and shown while training. `kine2go policy train --strict` stops at the first one and saves the world's state
before the step, from which it can be repeated (`WorldSnapshot.load(file).restore(environment)`).
"""
