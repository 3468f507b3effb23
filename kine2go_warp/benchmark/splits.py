"""Which motions a policy may learn from, so that results can be quoted beside each other."""

from kine2go_warp.motions.catalogue_entry import twin_name

VERSION = 1
"""Raised when the lists below, the metrics or the rules of the score change."""

HELD_OUT = frozenset({
    "ai4_dog_left_turn", "ai4_dog_run_02", "ai4_dog_synth_circle_walk", "ai4_dog_synth_tight_strafe", "ai4_dog_walk_02",
    "ai4_dog_walk_06", "dog_trot", "vhdc_horse1_s1_walk_03", "vhdc_horse1_s2_trot_03", "solo8_walk",
})  # fmt: skip
"""Motions of the catalogue that are kept from learning. None shares frames of a file with one that is not."""


def split_of(motion: str) -> str:
    """Return ``held_out`` or ``train``; mirrored twins belong with their originals."""
    return "held_out" if motion in HELD_OUT or motion in map(twin_name, HELD_OUT) else "train"
