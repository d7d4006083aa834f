"""Decides the look of every strategy: colour and marker by family, line style within the family.

Colours are Okabe and Ito's, which colour-blind readers can distinguish; markers differ per family, so that no information
depends on colour alone. Unknown families (strategies from outside the project) get a free colour that depends on their name
only, unless two of them would collide.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass

#: family -> (colour, marker: one of matplotlib's letters or a name in `_POLYGONS`)
FAMILIES: dict[str, tuple[str, str]] = {
    "refit": ("#0072B2", "o"),
    "period": ("#7A7A7A", "d"),
    "kinetic": ("#D55E00", "s"),
    "rebuild": ("#009E73", "^"),
    "oracle": ("#000000", "X"),
    "fcl": ("#56B4E9", "D"),
    "bullet": ("#E69F00", "v"),
    "embree": ("#CC79A7", "P"),
    "lazy": ("#8C7A00", "<"),
    "linear": ("#882255", "h"),
    "approximate": ("#AA4499", "8"),
    "auto": ("#44AA99", "p"),
    "restructuring": ("#5D4A9C", ">"),
    "sweep": ("#117733", "*"),
    "volumes": ("#6B4C2A", "H"),
    "cgal": ("#4B7A00", "boat"),
}

#: Choices for unknown families.
FREE: tuple[tuple[str, str], ...] = (
    ("#A8324A", "bar"),
    ("#2F6F7E", "hourglass"),
    ("#1B1BB3", "arrow"),
)

LINE_STYLES: tuple[object, ...] = ("-", (0, (5, 2)), (0, (1.2, 1.4)), (0, (6, 1.5, 1.2, 1.5)), (0, (3, 1, 1, 1, 1, 1)))

#: How far a family's colour is mixed with white (> 0) or black (< 0) for its members, in turn.
SHADES: tuple[float, ...] = (0.0, -0.3, -0.5, -0.68, 0.25)

#: Phases of a frame, from light to dark so that they differ in grey, too; none is a family's colour.
PHASES: dict[str, tuple[str, str]] = {
    "motion": ("#C9C2B2", ""),
    "update": ("#33415C", ""),
    "plan_changes": ("#7D8597", "xxx"),
    "traversal": ("#A9B4C9", ""),
    "triangle_tests": ("#D3DAE6", "///"),
}

PHASE_NAMES: dict[str, str] = {
    "motion": "motion evaluation",
    "update": "update",
    "plan_changes": "plan changes",
    "traversal": "traversal",
    "triangle_tests": "triangle tests",
}


@dataclass(frozen=True)
class Look:
    """The look of one contestant in every figure and table."""

    colour: str
    marker: str
    line: object
    filled: bool
    dark: str = ""  #: its colour on a dark page

    @property
    def face(self) -> str:
        """Returns the colour inside the marker: open markers distinguish members of a family without colour."""
        return self.colour if self.filled else "#FFFFFF"

    @property
    def drawn(self) -> object:
        """Returns the marker as matplotlib takes it: a letter, or corners."""
        if len(self.marker) == 1:
            return self.marker
        corners = [corner.split(",") for corner in _POLYGONS[self.marker].split()]
        return tuple((float(x), -float(y)) for x, y in [*corners, corners[0]])


def families(names: Iterable[str]) -> dict[str, tuple[str, str]]:
    """Returns colour and marker of each family; the same for a name in every report, unless free ones collide."""
    chosen = {name: FAMILIES[name] for name in names if name in FAMILIES}
    taken: set[int] = set()
    for name in sorted(set(names) - set(FAMILIES)):
        slot = int.from_bytes(hashlib.sha256(name.encode()).digest()[:4], "big") % len(FREE)
        for step in range(len(FREE)):
            candidate = (slot + step) % len(FREE)
            if candidate not in taken:
                slot = candidate
                break
        taken.add(slot)
        chosen[name] = FREE[slot]
    return chosen


def mix(colour: str, shade: float) -> str:
    """Mixes `colour` (#RRGGBB) with white (shade > 0) or black (shade < 0)."""
    towards = 255 if shade > 0 else 0
    channels = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return "#" + "".join(f"{round(c + (towards - c) * abs(shade)):02X}" for c in channels)


def looks(contestants: Iterable[tuple[str, str, str]]) -> dict[str, Look]:
    """Returns looks by contestant, from (contestant, strategy id, family).

    Strategies of a family take, in the order of their ids, the shade that fewest contestants have so far; configurations of
    one strategy share its colour. All that share a colour, up to ten, differ by line style or by whether the marker is filled.
    """
    listed = list(contestants)
    by_family = families([family for _, _, family in listed])
    members: dict[str, list[str]] = {}
    variants: dict[str, list[str]] = {}
    for contestant, strategy, family in sorted(listed):
        ids = members.setdefault(family, [])
        if strategy not in ids:
            ids.append(strategy)
        configurations = variants.setdefault(strategy, [])
        if contestant not in configurations:
            configurations.append(contestant)
    shades: dict[str, int] = {}
    steps: dict[str, int] = {}
    for ids in members.values():
        sharing = [0] * len(SHADES)
        for strategy in ids:
            shade = shades[strategy] = sharing.index(min(sharing))
            steps.update({one: shade + sharing[shade] + rank for rank, one in enumerate(variants[strategy])})
            sharing[shade] += len(variants[strategy])
    result: dict[str, Look] = {}
    for contestant, strategy, family in listed:
        colour, marker = by_family[family]
        result[contestant] = Look(
            colour=mix(colour, SHADES[shades[strategy]]),
            marker=marker,
            line=LINE_STYLES[steps[contestant] % len(LINE_STYLES)],
            filled=steps[contestant] % 2 == 0,
            dark=shaded_on_dark(colour, SHADES[shades[strategy]]),
        )
    return result


#: Outlines of the markers in a box from -5 to 5, for symbols inside the page's text.
_POLYGONS: dict[str, str] = {
    "boat": "-5,-3 5,-3 2,4 -2,4",
    "s": "-4,-4 4,-4 4,4 -4,4",
    "^": "0,-5 5,4 -5,4",
    "v": "0,5 5,-4 -5,-4",
    "<": "-5,0 4,-5 4,5",
    ">": "5,0 -4,-5 -4,5",
    "D": "0,-5 5,0 0,5 -5,0",
    "d": "0,-5 3,0 0,5 -3,0",
    "p": "0,-5 4.8,-1.5 2.9,4 -2.9,4 -4.8,-1.5",
    "h": "0,-5 4.3,-2.5 4.3,2.5 0,5 -4.3,2.5 -4.3,-2.5",
    "H": "-5,0 -2.5,-4.3 2.5,-4.3 5,0 2.5,4.3 -2.5,4.3",
    "8": "-2,-5 2,-5 5,-2 5,2 2,5 -2,5 -5,2 -5,-2",
    "P": "-1.7,-5 1.7,-5 1.7,-1.7 5,-1.7 5,1.7 1.7,1.7 1.7,5 -1.7,5 -1.7,1.7 -5,1.7 -5,-1.7 -1.7,-1.7",
    "X": "-5,-2.7 -2.7,-5 0,-2.3 2.7,-5 5,-2.7 2.3,0 5,2.7 2.7,5 0,2.3 -2.7,5 -5,2.7 -2.3,0",
    "*": "0,-5 1.2,-1.6 4.8,-1.6 1.9,.6 3,4.1 0,2 -3,4.1 -1.9,.6 -4.8,-1.6 -1.2,-1.6",
    "bar": "-5,-2 5,-2 5,2 -5,2",
    "hourglass": "-4,-5 4,-5 1.2,0 4,5 -4,5 -1.2,0",
    "arrow": "5,0 -4.5,-4.5 -1.5,0 -4.5,4.5",
}


def symbol(look: Look) -> str:
    """Returns the marker as a small inline SVG."""
    paint = f'fill="{look.face}" stroke="{look.colour}" stroke-width="1.6"'
    points = _POLYGONS.get(look.marker)
    shape = f'<polygon points="{points}" {paint}/>' if points else f'<circle r="4.2" {paint}/>'
    return f'<svg class="symbol" viewBox="-6.5 -6.5 13 13" width="13" height="13" aria-hidden="true">{shape}</svg>'


#: The dark page of the explorer, the least contrast of a mark on it (WCAG 2.1, 1.4.11: 3 for graphics), and that of a family's colour,
#: which leaves room for a member that is darker.
DARK_PAGE = "#15181D"
DARK_CONTRAST = 4.0
DARK_FAMILY = 5.0


def _luminance(colour: str) -> float:
    """Returns the relative luminance of WCAG."""
    channels = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.03928 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one: str, other: str) -> float:
    """Returns the contrast ratio of two colours, from 1 to 21."""
    light, dark = sorted((_luminance(one), _luminance(other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def on_dark(colour: str, least: float = DARK_CONTRAST) -> str:
    """Mixes a colour with as much white as it needs to be seen on the dark page."""
    shades = (mix(colour, share / 20) for share in range(21))
    return next(shade for shade in shades if contrast(shade, DARK_PAGE) >= least)


def shaded_on_dark(family: str, shade: float) -> str:
    """Returns the colour of a family's member on the dark page: as far from that page as its shade is from the light one."""
    return on_dark(mix(on_dark(family, DARK_FAMILY), -shade))


def for_page(look: Look) -> dict[str, object]:
    """Returns a look as data for a page: colours for both schemes, the marker's corners (none: a circle) and dashes."""
    corners = [[float(c) for c in corner.split(",")] for corner in _POLYGONS.get(look.marker, "").split()]
    return {
        "light": look.colour,
        "dark": look.dark,
        "corners": corners,
        "dashes": [] if isinstance(look.line, str) else list(look.line[1]),  # type: ignore[index]
        "filled": look.filled,
    }


def palette() -> dict[str, object]:
    """Returns what a page needs to choose looks for contestants that it was not made with."""
    return {
        "families": FAMILIES,
        "free": FREE,
        "shades": SHADES,
        "dashes": [[] if isinstance(line, str) else list(line[1]) for line in LINE_STYLES],  # type: ignore[index]
        "corners": {name: [[float(c) for c in corner.split(",")] for corner in text.split()] for name, text in _POLYGONS.items()},
        "dark": DARK_PAGE,
        "contrast": DARK_CONTRAST,
        "family_contrast": DARK_FAMILY,
    }
