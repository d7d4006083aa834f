"""Writes figures to files and embeds them in a page. figures.py decides their content."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Optional

import matplotlib
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from figures.axes import settle
from results import files

#: Text size and frame of every figure; set only while one is drawn, so that nothing global changes.
STYLE: dict[str, object] = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#555555",
    "axes.axisbelow": True,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "xtick.color": "#333333",
    "ytick.color": "#333333",
    "grid.color": "#E3E3E3",
    "grid.linewidth": 0.7,
    "hatch.linewidth": 0.6,
    "lines.linewidth": 1.6,
    "figure.facecolor": "white",
    "svg.fonttype": "path",
    "svg.hashsalt": "kbvh",
    "pdf.fonttype": 42,
}


@dataclass(frozen=True)
class Picture:
    """A drawn figure of the report."""

    name: str
    title: str
    reading: str  #: how to read it, two sentences
    uri: str  #: the picture itself, as a data URI; "" of one that the page only leads to
    width: int  #: in CSS pixels
    height: int

    @property
    def file(self) -> str:
        """Returns the link to its file, from the page."""
        return f"figures/{self.name}.png"


#: Dots per inch and colours of embedded figures: sharp enough on a screen, a tenth of the bytes of their SVG.
EMBEDDED_DPI, EMBEDDED_COLOURS = 120, 64


def _small(figure: Figure) -> bytes:
    drawn, small = io.BytesIO(), io.BytesIO()
    figure.savefig(drawn, format="png", dpi=EMBEDDED_DPI)
    Image.open(drawn).convert("RGB").quantize(EMBEDDED_COLOURS, dither=Image.Dither.NONE).save(small, format="png", optimize=True)
    return small.getvalue()


def small_png(draw: Callable[[], Optional[Figure]]) -> bytes:
    """Draws a figure as the small PNG that pages embed; b"" if there is nothing to draw."""
    with matplotlib.rc_context(STYLE):
        figure = draw()
        if figure is None:
            return b""
        FigureCanvasAgg(figure)
        settle(figure)
        return _small(figure)


def picture(
    folder: Path, name: str, title: str, reading: str, draw: Callable[[], Optional[Figure]], embedded: bool = True
) -> Optional[Picture]:
    """Draws a figure and writes it as PNG and PDF to `folder`; None if there is nothing to draw. The page has it as a small PNG, or
    only a link to its file.
    """
    with matplotlib.rc_context(STYLE):
        figure = draw()
        if figure is None:
            return None
        FigureCanvasAgg(figure)
        settle(figure)
        folder.mkdir(parents=True, exist_ok=True)
        for kind, said in (("png", {"dpi": 160}), ("pdf", {"metadata": {"CreationDate": None, "Title": title}})):
            drawn = io.BytesIO()
            figure.savefig(drawn, format=kind, **said)
            files.write_whole(folder / f"{name}.{kind}", drawn.getvalue())
        small = _small(figure) if embedded else b""
    width, height = figure.get_size_inches()
    uri = "data:image/png;base64," + base64.b64encode(small).decode("ascii") if embedded else ""
    return Picture(name, title, reading, uri, round(width * 96), round(height * 96))
