"""Domain randomisation: what differs between the worlds besides where their robots begin."""

import numpy as np
import warp as wp

from kine2go_warp.env.bodies import Bodies
from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.episodes import Episodes
from kine2go_warp.env.motors import Motors
from kine2go_warp.env.simulation import Simulation
from kine2go_warp.kernels import randomization
from kine2go_warp.kernels.randomization import BodyRanges, MotorRanges
from kine2go_warp.quantities import RANDOMIZED_PARAMETERS

NEVER = 2**31 - 1
"""A control step that no episode reaches."""


def parameter_arrays(motors: Motors, bodies: Bodies) -> dict[str, wp.array]:
    """Return the arrays of the simulation that hold ``RANDOMIZED_PARAMETERS``, by the names of their states."""
    model, base = motors.model, bodies.base
    return {
        "base_mass": base.mass,
        "base_com": base.com,
        "friction": bodies.friction,
        "stiffness": model.stiffness,
        "damping": model.damping,
        "strength": model.strength,
        "motor_offset": model.offset,
        "joint_friction": model.friction,
        "delay": model.delay,
    }


MOTOR_PARAMETERS = ("stiffness", "damping", "strength", "motor_offset", "joint_friction", "latency")
"""Those that are drawn together."""


class Randomization:
    """Draws the ranges of the settings and writes them where the physics reads them."""

    def __init__(self, config: EnvConfig, simulation: Simulation, motors: Motors, episodes: Episodes) -> None:
        self.config, self.settings = config, config.randomization
        self.simulation, self.motors, self.episodes = simulation, motors, episodes
        num_worlds = config.num_worlds
        self.bodies = Bodies(config, simulation)
        self.next_push = wp.full(num_worlds, NEVER, dtype=int)
        self.push = wp.zeros(num_worlds, dtype=wp.vec3)
        self._set_ranges()

    def _set_ranges(self) -> None:
        """Convert the settings to what kernels take."""
        chosen = self.settings.chosen
        self.body_ranges, self.motor_ranges = BodyRanges(), MotorRanges()
        self.body_ranges.mass = wp.vec2(*chosen("base_mass", 0.0))
        self.body_ranges.com = wp.vec2(*chosen("base_com", 0.0))
        self.motor_ranges.stiffness = wp.vec2(*chosen("stiffness", 1.0))
        self.motor_ranges.damping = wp.vec2(*chosen("damping", 1.0))
        self.motor_ranges.strength = wp.vec2(*chosen("strength", 1.0))
        self.motor_ranges.offset = wp.vec2(*chosen("motor_offset", 0.0))
        self.motor_ranges.friction = wp.vec2(*chosen("joint_friction", 1.0))
        self.motor_ranges.delay = wp.vec2(*(float(value) for value in self.config.delay_range))
        self.friction_range = wp.vec2(*chosen("friction", self.config.solver.friction))
        steps = [max(value * self.config.control_rate, 1.0) for value in chosen("push_interval", 1.0)]
        self.push_interval = wp.vec2(*steps)
        self.push_speed = wp.vec2(*chosen("push_speed", 0.0))

    def draw_bodies(self) -> None:
        """Draw the base of every world anew. It takes milliseconds a world, so only when all worlds are made anew."""
        if self.settings.base_mass or self.settings.base_com:
            inputs = [self.episodes.seed, self.body_ranges, self.bodies.base]
            wp.launch(randomization.draw_bodies, dim=self.config.num_worlds, inputs=inputs)
            self.bodies.apply_bodies()

    def reset(self) -> None:
        """Draw what lasts for an episode, in every world that is done."""
        settings, motor, num_worlds = self.settings, self.config.motor, self.config.num_worlds
        drawn = self.episodes.reset_inputs
        if any(getattr(settings, name) for name in MOTOR_PARAMETERS):
            nominal = [motor.stiffness, motor.damping, self.motors.nominal_friction]
            inputs = [*drawn, self.motor_ranges, *nominal, self.motors.model]
            wp.launch(randomization.draw_motors, dim=num_worlds, inputs=inputs)
        if settings.friction:
            inputs = [*drawn, self.friction_range, self.bodies.friction]
            wp.launch(randomization.draw_friction, dim=num_worlds, inputs=inputs)
            self.bodies.apply_friction()
        if settings.push_interval:
            inputs = [*drawn, self.push_interval, self.next_push]
            wp.launch(randomization.schedule_push, dim=num_worlds, inputs=inputs)

    def push_robots(self) -> None:
        """Push the robots whose time has come."""
        if self.settings.push_interval:
            episodes = self.episodes
            wp.launch(
                randomization.push_robots,
                dim=self.config.num_worlds,
                inputs=[
                    episodes.seed,
                    episodes.episode,
                    episodes.reference_step,
                    self.push_interval,
                    self.push_speed,
                    self.next_push,
                    self.simulation.robot,
                    self.push,
                ],
            )

    def parameters(self) -> dict[str, np.ndarray]:
        """Return what holds in each world now, by the names of ``RANDOMIZED_PARAMETERS``, first axis worlds."""
        base = self.bodies.base
        arrays = parameter_arrays(self.motors, self.bodies)
        held = {one.name: arrays[one.state.name].numpy().copy() for one in RANDOMIZED_PARAMETERS}
        held["base_mass"] = np.asarray(held["base_mass"] - base.nominal_mass, np.float32)
        held["base_com"] = np.asarray(held["base_com"] - np.array(base.nominal_com), np.float32)
        held["latency"] = np.asarray(held["latency"] * self.config.substep_duration, np.float32)
        return held
