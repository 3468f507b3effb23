"""The catalogue of discovered motions, and a line of words for each."""

import json
from dataclasses import replace
from pathlib import Path

from kine2go_warp.errors import CatalogueError
from kine2go_warp.motions.discovery.discover import Discovered, Discovery
from kine2go_warp.motions.keypoints import FrameRange
from kine2go_warp.motions.own_file import OwnFile, motion_table, name_of
from kine2go_warp.toml import read_toml, to_toml


def described(one: Discovered) -> str:
    """Return what a motion is, in a line."""
    gait, cut = one.cut.gait, one.cut
    parts = [{"cycle": cut.label, "once": f"{cut.label}, played once", "still": f"{cut.label}, still"}[cut.kind]]
    if cut.kind != "still":
        parts.append(f"{gait.speed:.2f} m/s")
        if abs(gait.sideways) >= 0.1:
            parts.append(f"{abs(gait.sideways):.2f} m/s to the {'left' if gait.sideways > 0.0 else 'right'}")
        if abs(gait.turn_rate) >= 0.1:
            parts.append(f"turning {'left' if gait.turn_rate > 0.0 else 'right'} at {abs(gait.turn_rate):.2f} rad/s")
    if cut.kind == "cycle":
        parts.append(f"duty {' '.join(f'{share:.2f}' for share in gait.duty)}")
        parts.append(f"touch-downs {' '.join(f'{share:.2f}' for share in gait.phase)}")
        parts.append(f"seam {cut.seam:.2f}")
    return ", ".join(parts)


def catalogue_text(
    found: Discovery, files: dict[Path, OwnFile], out: Path, mirrored: bool = False, own: Path | None = None
) -> str:
    """Return a catalogue of the motions, best first, which is a recipe for all of them, too.

    Args:
        found: The motions.
        files: The files that they are in, by their paths, with licence and citation.
        out: The catalogue; files below its folder are named from there, others by their whole path.
        mirrored: Whether each motion gets a mirrored twin.
        own: A catalogue whose sources are known besides the package's; those that are used are copied.
    """
    known = {} if own is None else read_toml(own, CatalogueError)[0].get("source", {})
    used = {one.cut.recording.source.name for one in found.motions} & set(known)
    folder = out.resolve().parent
    name = name_of(out) or "motions"
    blocks = [f"# Found by 'kine2go motion discover', the best first.\nname = {json.dumps(name)}  # as a recipe\n"]
    if used:
        blocks.append(to_toml({"source": {name: known[name] for name in sorted(used)}}))
    for one in found.motions:
        cut = one.cut
        file, source = files[cut.recording.path], cut.recording.source
        place = file.path.resolve()
        place = place.relative_to(folder) if place.is_relative_to(folder) else place
        more = {"description": described(one)}
        more |= {"time_scale": cut.time_scale} if cut.time_scale else {}
        more |= {"mirror": True} if mirrored else {}
        rate = 0.0 if source.tells_rate else cut.recording.rate
        frames = FrameRange(cut.start, cut.end)
        named = replace(
            file,
            path=place,
            name=one.name,
            source=file.source or source.name,
            frames=frames,
            rate=round(rate, 6),
            kind=cut.clip_kind,
        )
        blocks.append("\n".join(motion_table(named, **more)) + "\n")
    return "\n".join(blocks)
