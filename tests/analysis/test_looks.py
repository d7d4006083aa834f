"""Colours, markers and number formats."""

from __future__ import annotations

import unittest

import paths  # noqa: F401  (finds the modules under test)

import pandas as pd
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from figures import colours, figures
from results import text


class TestLooks(unittest.TestCase):
    def test_known_families_have_distinct_colours_and_markers(self) -> None:
        every = [*colours.FAMILIES.values(), *colours.FREE]
        self.assertEqual(len({colour for colour, _ in every}), len(every))
        self.assertEqual(len({marker for _, marker in every}), len(every))

    def test_unknown_families_get_a_colour_that_depends_on_the_name(self) -> None:
        alone = colours.families(["mine"])["mine"]
        self.assertEqual(colours.families(["refit", "mine", "kinetic"])["mine"], alone)
        self.assertIn(alone, colours.FREE)

    def test_unknown_families_never_collide_while_there_are_free_ones(self) -> None:
        names = [f"family {i}" for i in range(len(colours.FREE))]
        self.assertEqual(len(set(colours.families(names).values())), len(names))

    def test_order_does_not_matter(self) -> None:
        listed = [("a1", "a", "refit"), ("a2", "a", "refit"), ("b", "b", "refit"), ("x", "x", "new")]
        self.assertEqual(colours.looks(listed), colours.looks(listed[::-1]))

    def test_members_of_a_family_differ(self) -> None:
        looks = colours.looks([("a1", "a", "refit"), ("a2", "a", "refit"), ("b", "b", "refit")])
        self.assertEqual(len({(look.colour, str(look.line), look.filled) for look in looks.values()}), 3)
        self.assertEqual(looks["a1"].colour, looks["a2"].colour)
        self.assertEqual({look.marker for look in looks.values()}, {"o"})

    def test_more_members_than_shades_differ(self) -> None:
        looks = colours.looks((f"{member} {one}", f"{member}", "kinetic") for member in range(10) for one in range(4 + member % 3))
        shared: dict[str, list[tuple[str, bool]]] = {}
        for look in looks.values():
            shared.setdefault(look.colour, []).append((str(look.line), look.filled))
        self.assertEqual(len(shared), len(colours.SHADES))
        for styles in shared.values():
            self.assertEqual(len(set(styles)), min(len(styles), 10))

    def test_a_strategy_of_many_configurations_has_its_shade_alone(self) -> None:
        many = [(f"many {one}", "many", "refit") for one in range(12)]
        looks = colours.looks([*many, *((f"z{one}", f"z{one}", "refit") for one in range(8))])
        self.assertNotIn(looks["many 0"].colour, {looks[f"z{one}"].colour for one in range(8)})
        self.assertEqual(len({(look.colour, str(look.line), look.filled) for look in looks.values()}), 18)

    def test_every_marker_can_be_drawn(self) -> None:
        figure = Figure()
        axes = figure.subplots()
        for colour, marker in [*colours.FAMILIES.values(), *colours.FREE]:
            axes.plot([0], [0], marker=colours.Look(colour, marker, "-", True).drawn)
        FigureCanvasAgg(figure).draw()

    def test_every_marker_has_a_symbol_for_the_page(self) -> None:
        for colour, marker in [*colours.FAMILIES.values(), *colours.FREE]:
            shape = colours.symbol(colours.Look(colour, marker, "-", True))
            self.assertIn("<circle" if marker == "o" else "<polygon", shape)


class TestRows(unittest.TestCase):
    SETTINGS = " (candidates listed, leaf 16, leaf boxes tight, planes clip, queue segment heap, rebuild never)"

    def rows(self, count: int) -> pd.DataFrame:
        """Contestants of which each third has a name of four lines."""
        names = [f"kinetic BoxTree {i}" for i in range(count)]
        phases = {f"middle_{phase}": 1.0 for phase in figures.PHASES}
        return pd.DataFrame(
            {
                "id": names, "contestant": names, "title": names, "group": "g", "total_motion": 4.0, **phases,
                "label": [name + (self.SETTINGS if i % 3 == 0 else "") for i, name in enumerate(names)],
            }
        )  # fmt: skip

    def test_names_of_rows_do_not_overlap(self) -> None:
        for count in (4, figures.CROWD + 1):
            with self.subTest(count):
                rows = self.rows(count)
                figure = figures.cost_split(rows, colours.looks((name, name, "kinetic") for name in rows["id"]))
                canvas = FigureCanvasAgg(figure)
                canvas.draw()
                boxes = [label.get_window_extent(canvas.get_renderer()) for label in figure.axes[0].get_yticklabels()]
                for upper, lower in zip(boxes, boxes[1:]):
                    self.assertGreaterEqual(upper.y0, lower.y1)


class TestText(unittest.TestCase):
    def test_significant(self) -> None:
        for value, expected in ((0, "0"), (0.012345, "0.0123"), (1.0, "1.00"), (9.999, "10.0"), (123.4, "123"),
                                (12345, "12\u202f300"), (3.14e-7, "3.14×10⁻⁷"), (float("nan"), "–"), (None, "–")):  # fmt: skip
            self.assertEqual(text.significant(value), expected)

    def test_small_is_never_shown_as_zero(self) -> None:
        self.assertNotEqual(text.significant(1e-300), "0")
        self.assertNotEqual(text.percent(1e-9), "0\u00a0%")

    def test_sizes_and_memory(self) -> None:
        self.assertEqual([text.size(n) for n in (999, 1500, 2000, 16000, 579_000, 1_200_000)],
                         ["999", "1.5k", "2k", "16k", "579k", "1.2M"])  # fmt: skip
        self.assertEqual(text.memory(1_536_000), "1.54\u00a0MB")
        self.assertEqual(text.memory(12), "12\u00a0B")

    def test_ordinals(self) -> None:
        self.assertEqual([text.ordinal(n) for n in (2, 3, 10, 11, 21, 112)], ["2nd", "3rd", "10th", "11th", "21st", "112th"])

    def test_ticks(self) -> None:
        self.assertEqual([text.tick(v) for v in (0, 0.5, 2, 2000, 1e-5, 0.0002)], ["0", "0.5", "2", "2\u202f000", "10⁻⁵", "0.0002"])
        self.assertEqual(text.percent_tick(0.001), "0.1\u2009%")


if __name__ == "__main__":
    unittest.main()
