"""Recipes that take seconds, source clips without a licence, and a listener."""

from dataclasses import replace
from pathlib import Path

from kine2go_warp.dataset.content import dataset_content
from kine2go_warp.learning.presets import FAST
from kine2go_warp.motions.generator import DogGait, generate, write_ai4animation
from kine2go_warp.pipelines.engines.inline import InlineEngine
from kine2go_warp.pipelines.events import RunObserver
from kine2go_warp.pipelines.recipe import Recipe, RecordConfig
from kine2go_warp.pipelines.runner import RecipeRunner
from kine2go_warp.pipelines.workspace import Workspace
from kine2go_warp.rollouts.config import GatherConfig
from tests.conftest import ANYTHING_GOES

TINY = Recipe(
    name="tiny",
    motions=("dog_trot",),
    train=FAST.override({"env.num_worlds": 8, "ppo.iterations": 2}),
    gather=GatherConfig(trajectories=3, rows=20, warm_up=0.1, **ANYTHING_GOES),
    record=RecordConfig(trajectories=1),
)

TWO = replace(TINY, motions=("dog_trot", "ai4_dog_pace"))
"""The second motion is another dog of the generator's, under the name of a real one."""


def write_sources(folder: Path) -> Path:
    """Write the source clip of ``TWO``'s second motion into a folder of source clips, and return the folder."""
    file = folder / "ai4animation" / "dog_walk00_joint_pos.txt"
    file.parent.mkdir(parents=True)
    write_ai4animation(generate(replace(DogGait(), speed=1.0), 240).points, file)
    return folder


class Listener(RunObserver):
    def __init__(self):
        self.events = []

    def on_event(self, event):
        self.events.append(event)

    def of(self, kind):
        return [event for event in self.events if event.kind == kind]

    @property
    def stages(self):
        return [(event.motion, event.stage) for event in self.of("stage_started")]


def run(recipe, folder, data=None, engine=None, should_stop=lambda: False):
    """Run a recipe, by default in this process."""
    listener = Listener()
    engine = engine or InlineEngine("cpu")
    result = RecipeRunner(recipe, Workspace(folder), data, engine, listener, should_stop).run()
    return result, listener


def content(folder: Path) -> str:
    """A hash of the dataset of a run."""
    return dataset_content(Workspace(folder).dataset)
