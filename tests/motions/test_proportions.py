"""Proportions measured on an animal are those that the sources state for theirs, which were chosen by hand."""

import pytest

from kine2go_warp.motions.catalogue import load_catalogue
from kine2go_warp.motions.proportions import measured_proportions

FILES = {entry.file: entry for entry in load_catalogue().values() if entry.source in ("ai4animation", "vhdc")}


@pytest.mark.parametrize("file", [file for file, entry in FILES.items() if not entry.bundled])
def test_real_animals_measure_as_their_sources_say(data_folder, file):
    source = FILES[file].motion_source
    measures = measured_proportions(source.load(data_folder / file, FILES[file].rate))
    assert measures.scale == pytest.approx(source.scale, rel=0.08)
    assert measures.forward_lift == pytest.approx(source.forward_lift, abs=0.01)
    assert measures.foot_outward == pytest.approx(source.foot_outward, abs=0.025)
    # The horse's markers lie on its back; its hips are put as high.
    assert measures.root_drop == pytest.approx(0.0 if source.name == "vhdc" else source.root_drop, abs=0.012)


def test_an_animal_twice_as_large_is_half_the_scale(data_folder):
    entry = load_catalogue()["ai4_dog_pace"]
    motion = entry.motion_source.load(entry.path(data_folder), entry.rate)
    once, twice = measured_proportions(motion), measured_proportions(motion.scaled(2.0))
    assert twice.scale == pytest.approx(0.5 * once.scale)
    assert twice.root_drop == pytest.approx(once.root_drop, abs=1e-9)
