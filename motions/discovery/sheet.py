"""The contact sheet: one HTML file without anything from a network, with drawings and figures of each motion."""

from collections import Counter
from html import escape

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.motions.discovery.cuts import Cut
from kine2go_warp.motions.discovery.discover import Discovered, Discovery
from kine2go_warp.motions.discovery.tables import described
from kine2go_warp.motions.keypoints import BONES, KEYPOINTS
from kine2go_warp.quantities import LEG_NAMES
from kine2go_warp.rotations import turn_planar

Array = NDArray[np.float64]

MOMENTS = 6
"""Skeletons that are drawn of each motion."""
WIDTH, HEIGHT = 360.0, 74.0
"""Of the drawing of the skeletons."""
BAR, GAP = 7.0, 3.0
"""Height of a foot's bar in the footfall diagram, and the space below it."""
LABELS_WIDTH = 22.0

STYLE = """
:root { color-scheme: light dark; --ink: #1c2128; --soft: #5b6572; --card: #fff; --paper: #f6f7f9; --line: #e2e6eb;
  --FL: #0072b2; --FR: #d18f00; --RL: #009e73; --RR: #c0649a; }
@media (prefers-color-scheme: dark) { :root { --ink: #e4e8ee; --soft: #98a3b1; --card: #1a1e25; --paper: #12151a;
  --line: #2c323c; --FL: #5aaee3; --FR: #e8b04a; --RL: #37c79d; --RR: #dd92bd; } }
body { margin: 0 auto; max-width: 80rem; padding: 1.5rem; background: var(--paper); color: var(--ink);
  font: 15px/1.5 system-ui, sans-serif; }
main { display: grid; grid-template-columns: repeat(auto-fill, minmax(23rem, 1fr)); gap: 1rem; }
article { background: var(--card); border: 1px solid var(--line); border-radius: 10px; padding: 0.8rem 1rem; }
h1 { font-size: 1.5rem; margin: 0; } h2 { font-size: 0.95rem; margin: 0; overflow-wrap: anywhere; }
p { margin: 0.2rem 0 0.5rem; color: var(--soft); font-size: 0.87rem; }
svg { width: 100%; height: auto; display: block; } line { stroke-width: 1.6; stroke-linecap: round; }
.trunk { stroke: var(--ink); } text { fill: var(--soft); font: 8px system-ui, sans-serif; }
.floor { stroke: var(--line); }
.FL { stroke: var(--FL); } .FR { stroke: var(--FR); } .RL { stroke: var(--RL); } .RR { stroke: var(--RR); }
rect.FL { fill: var(--FL); } rect.FR { fill: var(--FR); } rect.RL { fill: var(--RL); } rect.RR { fill: var(--RR); }
rect { stroke: none; } li { font-size: 0.87rem; color: var(--soft); }
"""


def contact_sheet(found: Discovery) -> str:
    """Return the page."""
    counts = Counter(one.cut.label for one in found.motions)
    tally = ", ".join(f"{count} {label}" for label, count in counts.most_common())
    cards = "\n".join(card(one) for one in found.motions)
    refused = "".join(f"<li>{escape(name)}: {escape(why)}</li>" for name, why in found.refused)
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline'">
<title>{len(found.motions)} motions</title><style>{STYLE}</style></head><body>
<h1>{len(found.motions)} motions in {len(found.recordings)} recordings</h1>
<p>{escape(tally)}. {found.recorded_time / 60.0:.1f} minutes recorded, {found.unique_time / 60.0:.1f} of them unique;
{found.duplicates} near duplicates left out. Bars: when FL, FR, RL, RR stand. Figures are in the robot's size.</p>
<main>
{cards}
</main>
{f"<h2>{len(found.refused)} do not fit the robot</h2><ul>{refused}</ul>" if refused else ""}
</body></html>
"""


def card(one: Discovered) -> str:
    """Return the part of one motion."""
    cut, remarks = one.cut, "; ".join(one.remarks)
    place = f"{cut.recording.path.name}, frames {cut.start} to {cut.end}, {cut.gait.duration:.2f} s"
    return f"""<article><h2>{escape(one.name)}</h2><p>{escape(described(one))}</p>
{skeletons(cut)}{footfalls(cut)}<p>{escape(place)}{". " + escape(remarks) if remarks else ""}</p></article>"""


def skeletons(cut: Cut) -> str:
    """Return a drawing of the animal at some moments, from its right, so that it looks to the right."""
    motion = cut.recording.motion
    frames = np.linspace(cut.start, cut.end - 1, MOMENTS).round().astype(int)
    points = motion.position[frames]
    turned = turn_planar(points - points[:, :1] * [1.0, 1.0, 0.0], -cut.recording.yaw[frames, None])
    floor = float(np.quantile(motion.points("toe")[..., 2], 0.05))
    scale = min(WIDTH / (MOMENTS * 1.9 * motion.trunk_length), HEIGHT / (float(points[..., 2].max()) - floor + 1e-9))
    lines = [f'<line class="floor" x1="0" x2="{WIDTH:.0f}" y1="{HEIGHT:.0f}" y2="{HEIGHT:.0f}"/>']
    for index, shape in enumerate(turned):
        x = (index + 0.3) * WIDTH / MOMENTS + scale * shape[:, 0]
        y = HEIGHT - scale * (shape[:, 2] - floor)
        for first, second in BONES:
            leg = KEYPOINTS[second][:2]
            kind = leg if leg in LEG_NAMES else "trunk"
            ends = f'x1="{x[first]:.1f}" y1="{y[first]:.1f}" x2="{x[second]:.1f}" y2="{y[second]:.1f}"'
            lines.append(f'<line class="{kind}" {ends}/>')
    return drawing(HEIGHT + 4.0, lines, "skeleton from the side")


def footfalls(cut: Cut) -> str:
    """Return a footfall diagram: a bar where a foot stands."""
    stance = cut.recording.stance[cut.start : cut.end]
    scale = (WIDTH - LABELS_WIDTH) / len(stance)
    bars = []
    for foot, leg in enumerate(LEG_NAMES):
        top = foot * (BAR + GAP)
        bars.append(f'<text x="0" y="{top + BAR:.0f}">{leg}</text>')
        edges = np.flatnonzero(np.diff(np.concatenate([[0], stance[:, foot].astype(int), [0]])))
        for first, after in zip(edges[::2], edges[1::2], strict=True):
            size = f'width="{scale * (after - first):.1f}" height="{BAR:.0f}"'
            bars.append(f'<rect class="{leg}" x="{LABELS_WIDTH + scale * first:.1f}" y="{top:.0f}" {size}/>')
    return drawing(4 * (BAR + GAP), bars, "footfall diagram")


def drawing(height: float, parts: list[str], what: str) -> str:
    """Return an SVG."""
    return f'<svg viewBox="0 0 {WIDTH:.0f} {height:.0f}" role="img" aria-label="{what}">{"".join(parts)}</svg>'
