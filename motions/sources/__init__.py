"""Sources of motion clips: a class each, or a table of ``dialects.toml``."""

from kine2go_warp.errors import CatalogueError
from kine2go_warp.motions.sources.ai4animation import AI4Animation
from kine2go_warp.motions.sources.base import MotionSource
from kine2go_warp.motions.sources.dialects import Dialect, JointsDialect, bundled_dialects
from kine2go_warp.motions.sources.joints import JointSource
from kine2go_warp.motions.sources.points import PointSource
from kine2go_warp.motions.sources.solo8 import Solo8
from kine2go_warp.motions.sources.vhdc import Vhdc
from kine2go_warp.objects import load_object


def source_of(name: str, dialect: Dialect) -> MotionSource:
    """Return the source that reads files of a dialect."""
    if isinstance(dialect, JointsDialect):
        return JointSource(name, dialect, root_drop=dialect.root_drop)
    lengths = dialect.scale, dialect.root_drop, dialect.forward_lift, dialect.foot_outward
    return PointSource(name, dialect, *lengths, dialect.unit)


SOURCES: dict[str, MotionSource] = {
    **{source.name: source for source in (AI4Animation(), Vhdc(), Solo8())},
    **{name: source_of(name, dialect) for name, dialect in bundled_dialects().items()},
}
"""All sources by the name that catalogue entries use."""


def source_named(name: str) -> MotionSource:
    """Return the source of that name, or the one that a reference such as ``my_source.py:MySource`` leads to.

    Raises:
        CatalogueError: there is none of that name.
        Kine2GoError: the reference leads to nothing, or to something else.
    """
    if ":" in name:
        found = load_object(name)
        if not (isinstance(found, type) and issubclass(found, MotionSource)):
            raise CatalogueError(f"{name}: is no subclass of MotionSource")
        return found()
    if name not in SOURCES:
        known = ", ".join(sorted(SOURCES))
        raise CatalogueError(f"unknown motion source '{name}'; known are: {known}, or FILE.py:NAME for one of your own")
    return SOURCES[name]


__all__ = ["SOURCES", "AI4Animation", "MotionSource", "Solo8", "Vhdc", "source_named"]
