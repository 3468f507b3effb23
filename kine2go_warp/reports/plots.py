"""The plots of a motion as SVG inside a page, in whose colours and font they are drawn, light or dark."""

import io
import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from kine2go_warp.scores.plots import COLOURS, MotionCurves, draw_coverage, draw_phase

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

MOST_PATHS = 40
"""Paths that are drawn of a motion; more hide one another and make the page large."""

INK, PAPER, GRID = "#010203", "#fdfcfb", "#e6e6e6"
"""Colours that the page replaces by its own; the last one is what the plots draw their grid with."""

THEME = {INK: "currentColor", PAPER: "var(--card)", GRID: "var(--line)"} | {
    colour: f"var(--plot-{index})" for index, colour in enumerate(COLOURS)
}


def coverage_svg(curves: MotionCurves, key: str) -> str:
    """Return the root paths from above; ``key`` tells this drawing's parts from those of others on the page."""
    shown = replace(curves, paths=curves.paths[:MOST_PATHS], headings=curves.headings[:MOST_PATHS])
    return inline_svg(lambda: draw_coverage(shown), key, f"Root paths of {curves.motion} from above")


def phase_svg(curves: MotionCurves, key: str) -> str:
    """Return errors and leg distance over the reference cycle."""
    label = f"Errors and leg distance of {curves.motion} over the reference cycle"
    return inline_svg(lambda: draw_phase(curves), key, label)


def inline_svg(draw: "Callable[[], Figure]", key: str, label: str) -> str:
    """Return a figure as an element of a page.

    Args:
        draw: Draws the figure.
        key: Goes before the names of its parts, which must be unique on a page.
        label: Says what it shows to those who cannot see it.
    """
    import matplotlib as mpl

    ink = ("text.color", "axes.edgecolor", "axes.labelcolor", "xtick.color", "ytick.color")
    look: dict[Any, Any] = dict.fromkeys(ink, INK) | {
        "svg.fonttype": "none",
        "svg.hashsalt": "kine2go",
        "legend.facecolor": PAPER,
        "legend.edgecolor": GRID,
        "path.simplify_threshold": 0.5,
    }
    buffer = io.StringIO()
    with mpl.rc_context(look):
        draw().savefig(buffer, format="svg", transparent=True, metadata={"Date": None})
    return themed(buffer.getvalue(), key, label)


def themed(svg: str, key: str, label: str) -> str:
    """Return a drawing of Matplotlib's without its head and notes, with names, colours and font of the page."""
    from markupsafe import escape

    size = re.search(r'viewBox="([^"]+)"', svg)
    body = svg[svg.index(">", svg.index("<svg")) + 1 :]
    body = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->", "", body, flags=re.DOTALL)
    body = body.replace("xlink:href", "href")
    body = re.sub(r'\bid="', f'id="{key}-', body)
    body = re.sub(r'href="#', f'href="#{key}-', body)
    body = re.sub(r"url\(#", f"url(#{key}-", body)
    body = re.sub(r"(font: [^;\"]*?px) [^;\"]*", r"\1 system-ui, sans-serif", body)
    for colour, replacement in THEME.items():
        body = body.replace(colour, replacement)
    body = "\n".join(line.strip() for line in body.splitlines() if line.strip())
    box = size.group(1) if size else "0 0 100 100"
    return f'<svg viewBox="{box}" role="img" aria-label="{escape(label)}">{body}'
