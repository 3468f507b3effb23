"""Domain randomisation: what differs between the worlds besides where their robots begin."""

import zlib
from typing import Any

import numpy as np
import warp as wp

from kine2go_warp.env.bodies import Bodies
from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.motors import Motors
from kine2go_warp.env.simulation import Simulation
from kine2go_warp.env.terms.randomization import RandomizationTerm, active
from kine2go_warp.kernels import launch, randomization
from kine2go_warp.kernels.randomization import Draw
from kine2go_warp.kernels.world import WorldView
from kine2go_warp.quantities import RANDOMIZED_PARAMETERS

NEVER = 2**31 - 1
"""A control step that no episode reaches."""

STREAMS = {
    "base_mass": (8, 0, 1), "base_com": (8, 1, 1), "friction": (7, 0, 1), "stiffness": (6, 0, 5), "damping": (6, 1, 5),
    "strength": (6, 2, 5), "motor_offset": (6, 3, 5), "joint_friction": (6, 4, 5), "latency": (6, 60, 1),
}  # fmt: skip
"""Stream, first number and stride of the package's own terms; they decide the bits of every seed."""

OTHER_STREAM = 11
"""The stream of all other terms, each with a key from its name."""

OPERATIONS = {"scale": randomization.SCALE, "add": randomization.ADD, "set": randomization.SET}


def parameter_arrays(motors: Motors, bodies: Bodies) -> dict[str, wp.array[Any]]:
    """Return the arrays of the simulation that hold ``RANDOMIZED_PARAMETERS``, by the names of their states."""
    owners = {"motors": motors.model, "base": bodies.base, "bodies": bodies}
    paths = {one.state.name: one.array.split(".") for one in RANDOMIZED_PARAMETERS}
    return {name: getattr(owners[owner], attribute) for name, (owner, attribute) in paths.items()}


def as_rows(array: wp.array[Any]) -> wp.array[Any]:
    """Return an array of floats or vectors as rows of floats, one a world, without copying."""
    size = array.size * wp.types.type_size(array.dtype) // array.shape[0]
    return wp.array(ptr=array.ptr, dtype=float, shape=(array.shape[0], size), device=array.device)


class Randomization:
    """Draws the ranges of the settings and writes them where the physics reads them."""

    def __init__(self, config: EnvConfig, simulation: Simulation, motors: Motors) -> None:
        self.config, self.motors = config, motors
        num_worlds = config.num_worlds
        self.bodies = Bodies(config, simulation)
        self.next_push = wp.full(num_worlds, NEVER, dtype=int)
        self.push = wp.zeros(num_worlds, dtype=wp.vec3)
        self.is_pushing = bool(active(config.randomization, "push_interval"))
        interval = [max(value * config.control_rate, 1.0) for value in self._push_range("push_interval")]
        self.push_ranges = [wp.vec2(*interval), wp.vec2(*self._push_range("push_speed"))]
        arrays = parameter_arrays(motors, self.bodies)
        self.latency = wp.zeros((num_worlds, 1), dtype=float)
        self.rows = {one.name: as_rows(arrays[one.state.name]) for one in RANDOMIZED_PARAMETERS}
        self.rows["latency"] = self.latency
        self.nominal = {name: wp.clone(rows) for name, rows in self.rows.items()}

    def _push_range(self, name: str) -> tuple[float, ...]:
        """Return the range of a push's parameter, nothing if there are no pushes."""
        return tuple(value for term in active(self.config.randomization, name) for value in term.range)

    def _draw(self, view: WorldView, when: str) -> None:  # pyright: ignore[reportGeneralTypeIssues] - a Warp struct
        """Draw what is drawn at a moment, in every world that is done."""
        before = dict(self.nominal)
        for term in self.config.randomization:
            name = term.drawn_name
            if term.range and term.drawn.when == when:
                inputs = [view, self._distribution(term), before[name], self.rows[name]]
                launch(randomization.draw_parameter, dim=self.config.num_worlds, inputs=inputs)
                before[name] = self.rows[name]

    def _distribution(self, term: RandomizationTerm) -> Draw:  # pyright: ignore[reportGeneralTypeIssues] - a Warp struct
        """Return what the kernel needs to know of a term."""
        draw, (least, greatest) = Draw(), term.range
        if term.drawn_name == "latency":
            # Whole substeps, both ends included.
            substeps = [round(value / self.config.substep_duration) for value in term.range]
            least, greatest = substeps[0], substeps[1] + 1.0
        draw.limits, draw.operation = wp.vec2(least, greatest), OPERATIONS[term.drawn.operation]
        draw.shared = term.shared
        if term.name == term.drawn_name:
            draw.stream, draw.first, draw.stride = STREAMS[term.name]
        else:
            draw.stream, draw.first, draw.stride = OTHER_STREAM, 0, 1
            draw.key = zlib.crc32(term.name.encode()) % NEVER + 1
        return draw

    def draw_bodies(self, view: WorldView) -> None:  # pyright: ignore[reportGeneralTypeIssues] - a Warp struct
        """Draw the base of every world anew. It takes milliseconds a world, so only when all worlds are made anew."""
        if self.config.draws_bodies:
            self._draw(view, "world")
            self.bodies.apply_bodies()

    def reset(self, view: WorldView) -> None:  # pyright: ignore[reportGeneralTypeIssues] - a Warp struct
        """Draw what lasts for an episode, in every world that is done."""
        terms, num_worlds = self.config.randomization, self.config.num_worlds
        self._draw(view, "episode")
        if active(terms, "friction"):
            self.bodies.apply_friction()
        if active(terms, "latency"):
            inputs = [view, self.latency, self.config.delay_range[1]]
            launch(randomization.round_down, dim=num_worlds, inputs=inputs)
        if self.is_pushing:
            inputs = [view, self.push_ranges[0], self.next_push]
            launch(randomization.schedule_push, dim=num_worlds, inputs=inputs)

    def push_robots(self, view: WorldView) -> None:  # pyright: ignore[reportGeneralTypeIssues] - a Warp struct
        """Push the robots whose time has come."""
        if self.is_pushing:
            inputs = [view, *self.push_ranges, self.next_push, self.push]
            launch(randomization.push_robots, dim=self.config.num_worlds, inputs=inputs)

    def parameters(self) -> dict[str, np.ndarray]:
        """Return what holds in each world now, by the names of ``RANDOMIZED_PARAMETERS``, first axis worlds."""
        arrays = parameter_arrays(self.motors, self.bodies)
        held = {one.name: arrays[one.state.name].numpy().copy() for one in RANDOMIZED_PARAMETERS}
        for one in RANDOMIZED_PARAMETERS:
            if one.operation == "add":
                held[one.name] -= self.nominal[one.name].numpy().reshape(held[one.name].shape)
        held["latency"] = np.asarray(held["latency"] * self.config.substep_duration, np.float32)
        return held
