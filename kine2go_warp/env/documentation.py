"""The tables of docs/environment.md, written from the code that they describe.

``uv run python -m kine2go_warp.env.documentation`` prints the page.
"""

from collections.abc import Sequence
from dataclasses import fields

from kine2go_warp.env.config import EnvConfig, RandomizationConfig, TerrainConfig
from kine2go_warp.env.observations import observation_layout, observation_size, privileged_layout
from kine2go_warp.env.randomization import DRAWN_QUANTITIES
from kine2go_warp.kernels.rewards import MAXIMUM_REWARDS, REWARD_TERMS
from kine2go_warp.kernels.terminations import REASON_DESCRIPTIONS, REASON_NAMES
from kine2go_warp.robots import GO2, RobotSpec
from kine2go_warp.robots.spec import FRICTION_STIFFNESS, LEG_JOINTS

REWARD_FORMULAS = (
    "exp(-5 Σ (q - q̂)²) over 12 joints [rad]",
    "exp(-0.1 Σ (q̇ - q̇̂)²) over 12 joints [rad/s]",
    "exp(-40 Σ \\|p - p̂\\|²) over 4 feet relative to the root, each in its own heading frame [m]",
    "exp(-20 \\|p - p̂\\|²) + exp(-10 θ²), root position [m] and angle of the rotation between the two roots [rad]",
    "exp(-2 \\|v - v̂\\|²) + exp(-0.2 \\|ω - ω̂\\|²), root velocities in the world frame [m/s, rad/s]",
)
"""The terms in the order of ``REWARD_TERMS`` (paper, appendix, "Reward structure"); a hat marks the reference."""

FACTORS = ("stiffness", "damping", "strength", "joint_friction")
"""What is drawn as a factor on its nominal value."""

INTRODUCTION = """# The environment

Written by `uv run python -m kine2go_warp.env.documentation > docs/environment.md`; a test compares.

One control step ({control_rate:.0f} Hz) is {substeps} physics steps. Within one captured graph: the output becomes
joint targets, pushes, the substeps with the motors' PD law and latency, contacts, reference, rewards, ends of episodes,
new episodes, observation. Nothing is allocated, the host is not waited for, and no Python runs for a world.
"""


def environment_page(config: EnvConfig | None = None) -> str:
    """Return docs/environment.md."""
    config = config or EnvConfig()
    sections = (
        INTRODUCTION.format(control_rate=config.control_rate, substeps=config.substeps),
        observation_section(config),
        reward_section(config),
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

{table(headings, rows(privileged_layout()))}"""


def reward_section(config: EnvConfig) -> str:
    """Return the reward terms."""
    scaled = [weight / config.control_rate for weight in config.reward.weights]
    rows = [
        (f"`{name}`", weight, f"{scale:.6f}", f"{scale * maximum:.6f}", formula)
        for name, weight, scale, maximum, formula in zip(
            REWARD_TERMS, config.reward.weights, scaled, MAXIMUM_REWARDS, REWARD_FORMULAS, strict=True
        )
    ]
    return f"""## Reward

Weights are the paper's; each is divided by the control rate. A state that is not finite earns nothing.

{table(("term", "weight", "per step", "at most", "formula before the weight"), rows)}"""


def termination_section(config: EnvConfig) -> str:
    """Return why episodes end."""
    limits = config.termination
    notes = {
        "distance": f"{limits.max_distance} m",
        "rotation": f"{limits.max_angle} rad",
        "time_out": f"{config.episode_time} s",
    }
    rows = [
        (number, f"`{name}`", notes.get(name, ""), description)
        for number, (name, description) in enumerate(zip(REASON_NAMES, REASON_DESCRIPTIONS, strict=True))
    ]
    return f"""## Ends of episodes

The first that applies counts, a time-out last. Limits are those of `paper`; `fast` and `robust` are stricter.

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
Phases are drawn evenly, or, with `phase_sampling.uniform_share` below 1, more often where the robot has failed of late:
each clip is cut into {sampling.bins} bins, failures count {sampling.lookback} s before they happen, and counts fade by
the factor {sampling.memory} in a control step.
"""


def randomization_section() -> str:
    """Return what is drawn for each world."""
    units = {quantity.name: quantity for quantity in DRAWN_QUANTITIES}
    extra = {
        "push_interval": ("s", "push", "time between two pushes"),
        "push_speed": ("m/s", "push", "horizontal velocity added to the base, in a random direction"),
    }
    rows = []
    for field in fields(RandomizationConfig):
        if field.name in units:
            quantity = units[field.name]
            moment = "world, at start-up" if quantity.when == "world" else "episode"
            unit = "factor" if quantity.name in FACTORS else quantity.unit
            rows.append((f"`{field.name}`", unit, moment, quantity.per, quantity.description))
        else:
            unit, moment, description = extra[field.name]
            rows.append((f"`{field.name}`", unit, moment, "world", description))
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

Joint stops are critically damped with a time constant of {solver.stop_time:g} s, whatever the inertia (`solver.stop_time`). The
robot's parts collide with the ground alone, or with one another, too (`solver.self_contact`). How far legs are from one
another, the trunk and the head is recorded as `leg_distance`.
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
device and shown while training. `kine2go train --strict` stops at the first one and saves the world's state before the
step, from which it can be repeated (`WorldSnapshot.load(file).restore(environment)`).
"""


if __name__ == "__main__":
    print(environment_page(), end="")
