"""Domain randomisation: what differs between the worlds besides where their robots begin."""

from dataclasses import dataclass

import numpy as np
import warp as wp

from kine2go_warp.env.bodies import Bodies
from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.episodes import Episodes
from kine2go_warp.env.motors import Motors
from kine2go_warp.env.simulation import Simulation
from kine2go_warp.kernels import randomization
from kine2go_warp.kernels.randomization import BodyRanges, MotorRanges

NEVER = 2**31 - 1
"""A control step that no episode reaches."""


@dataclass(frozen=True)
class DrawnQuantity:
    """One row of the table of what is drawn."""

    name: str
    """As in ``RandomizationConfig``."""
    unit: str
    per: str
    """``world``, ``axis`` or ``joint``."""
    when: str
    description: str


DRAWN_QUANTITIES = (
    DrawnQuantity("base_mass", "kg", "world", "world", "mass added to the base"),
    DrawnQuantity("base_com", "m", "axis", "world", "shift of the base's centre of mass, base frame"),
    DrawnQuantity("friction", "1", "world", "episode", "coefficient of friction between robot and ground"),
    DrawnQuantity("stiffness", "N m/rad", "joint", "episode", "stiffness of the motors"),
    DrawnQuantity("damping", "N m s/rad", "joint", "episode", "damping of the motors"),
    DrawnQuantity("strength", "1", "joint", "episode", "factor on the torque of the motors"),
    DrawnQuantity("motor_offset", "rad", "joint", "episode", "error of the motors' zero angle"),
    DrawnQuantity("joint_friction", "N m", "joint", "episode", "Coulomb friction of the joints"),
    DrawnQuantity("latency", "s", "world", "episode", "time from an action to its effect at the motors"),
)
"""What is recorded of a world, drawn or not. Pushes are recorded where they happen."""


MOTOR_QUANTITIES = ("stiffness", "damping", "strength", "motor_offset", "joint_friction", "latency")
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

    def begin(self) -> None:
        """Draw what lasts for an episode, in every world that is done."""
        settings, motor, num_worlds = self.settings, self.config.motor, self.config.num_worlds
        drawn = self.episodes.drawn
        if any(getattr(settings, name) for name in MOTOR_QUANTITIES):
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

    def drawn(self) -> dict[str, np.ndarray]:
        """Return what holds in each world now, by the names of ``DRAWN_QUANTITIES``, first axis worlds."""
        motors, base = self.motors.model, self.bodies.base
        nominal_com = np.array(base.nominal_com)
        return {
            "base_mass": np.asarray(base.mass.numpy() - base.nominal_mass, np.float32),
            "base_com": np.asarray(base.com.numpy() - nominal_com, np.float32),
            "friction": self.bodies.friction.numpy().copy(),
            "stiffness": motors.stiffness.numpy().copy(),
            "damping": motors.damping.numpy().copy(),
            "strength": motors.strength.numpy().copy(),
            "motor_offset": motors.offset.numpy().copy(),
            "joint_friction": motors.friction.numpy().copy(),
            "latency": np.asarray(motors.delay.numpy() * self.config.substep_duration, np.float32),
        }
