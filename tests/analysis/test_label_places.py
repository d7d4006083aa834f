"""Labels of figures: none covers another, a mark or a leading line; and rows of marks on a line."""

from __future__ import annotations

import random
import unittest
from typing import Optional

import paths  # noqa: F401  (finds the modules under test)

from figures import label_places
from figures.label_places import Box, Label, Placed, Segment, around, place, stacked

ROOM = Box(0, 0, 400, 300)


def touches(box: Box, line: Segment) -> bool:
    """Brute force: whether one of many points of a line is well inside of a box."""
    (x0, y0), (x1, y1) = line
    inside = box.grown(-0.2, -0.2)
    return any(inside.holds(around((x0 + i / 400 * (x1 - x0), y0 + i / 400 * (y1 - y0)), 0, 0)) for i in range(401))


class TestPlace(unittest.TestCase):
    def check(self, labels: list[Label], marks: list[Box], lines: list[Segment], found: list[Optional[Placed]], gap: float) -> None:
        given = [(label, one) for label, one in zip(labels, found) if one is not None]
        for i, (label, one) in enumerate(given):
            self.assertAlmostEqual(one.box.right - one.box.left, label.width)
            self.assertAlmostEqual(one.box.bottom - one.box.top, label.height)
            self.assertAlmostEqual((one.box.left + one.box.right) / 2, one.middle[0])
            self.assertAlmostEqual((one.box.top + one.box.bottom) / 2, one.middle[1])
            self.assertTrue(ROOM.holds(one.box))
            self.assertFalse(any(one.box.overlaps(mark) for mark in marks), "covers a mark")
            if not label.needed:
                self.assertFalse(any(touches(one.box, line) for line in lines), "crosses a line of the figure")
            if one.lead:
                begin, end = one.lead
                self.assertEqual(begin, label.mark)
                self.assertTrue(one.box.grown(1e-9, 1e-9).holds(around(end, 0, 0)), "the line leads to the label")
            for _, other in given[:i]:
                self.assertFalse(one.box.overlaps(other.box), "covers a label")
                apart = max(one.box.left - other.box.right, other.box.left - one.box.right)
                beside = one.box.top < other.box.bottom and other.box.top < one.box.bottom
                self.assertFalse(beside and apart < gap - 1e-9, "too near on a line")
                self.assertFalse(other.lead and touches(one.box, other.lead), "stands on the leading line of an earlier label")
                self.assertFalse(one.lead and not label.needed and touches(other.box, one.lead), "its leading line runs over a label")

    def test_no_label_covers_anything_in_crowds(self) -> None:
        chance, without, leading = random.Random(3), 0, 0
        for _ in range(30):
            spread = chance.choice((15, 60, 200))
            spots = [(200 + chance.uniform(-spread, spread) * 0.9, 150 + chance.uniform(-spread, spread) * 0.7) for _ in range(chance.randrange(1, 25))]
            marks = [around(spot, 10, 9) for spot in spots]
            labels = [Label(spot, chance.choice((10, 25, 60)), 10, chance.random() < 0.3) for spot in spots]
            lines = list(zip(spots, spots[1:]))[: chance.randrange(0, 8)]
            found = place(labels, marks, lines, ROOM, 4)
            self.check(labels, marks, lines, found, 4)
            self.assertEqual(place(labels, marks, lines, ROOM, 4), found, "the same again")
            without += sum(one is None for one in found)
            leading += sum(one is not None and one.lead is not None for one in found)
        self.assertGreater(without, 0, "crowds without room are among them")
        self.assertGreater(leading, 10)

    def test_one_mark_has_its_label_at_its_left(self) -> None:
        (one,) = place([Label((200, 150), 20, 10, False)], [around((200, 150), 10, 9)], [], ROOM, 4)
        assert one is not None
        self.assertEqual((one.box.right, one.middle[1], one.lead), (193, 150, None))

    def test_marks_at_one_place_have_labels_around_it(self) -> None:
        labels = [Label((200, 150), 20, 10, True)] * 9
        found = place(labels, [around((200, 150), 10, 9)], [], ROOM, 4)
        self.assertNotIn(None, found)
        self.check(labels, [around((200, 150), 10, 9)], [], found, 4)
        self.assertTrue(any(one and one.lead for one in found))
        optional = place([Label((200, 150), 20, 10, False)] * 9, [around((200, 150), 10, 9)], [], ROOM, 4)
        self.assertEqual(optional[:4], found[:4])

    def test_only_needed_labels_cross_lines_and_they_cross_as_few_as_can_be(self) -> None:
        # Lines 4 apart everywhere, but for the right half, where they are 8 apart: each label crosses one there at least.
        lines: list[Segment] = [((0, y), (400, y)) for y in range(0, 300, 8)] + [((0, y + 4), (200, y + 4)) for y in range(0, 300, 8)]
        for needed in (False, True):
            (one,) = place([Label((200, 150), 20, 10, needed)], [], lines, ROOM, 4)
            self.assertEqual(one is not None, needed)
            if one is not None:
                self.assertGreater(one.box.left, 200)
                self.assertEqual(sum(touches(one.box, line) for line in lines), 1)

    def test_no_label_where_no_room_is(self) -> None:
        self.assertEqual(place([Label((5, 5), 500, 10, True)], [], [], ROOM, 4), [None])
        self.assertEqual(place([], [], [], ROOM, 4), [])


class TestBox(unittest.TestCase):
    def test_lines_cross_boxes_where_sampling_says_so(self) -> None:
        chance, box, crossing = random.Random(5), Box(10, 20, 30, 28), 0
        for _ in range(300):
            line = ((chance.uniform(0, 40), chance.uniform(10, 40)), (chance.uniform(0, 40), chance.uniform(10, 40)))
            if touches(box, line):
                crossing += 1
                self.assertTrue(box.crossed_by(line), line)
            elif not touches(box.grown(0.5, 0.5), line):
                self.assertFalse(box.crossed_by(line), line)
        self.assertGreater(crossing, 50)
        self.assertTrue(box.crossed_by(((20, 0), (20, 90))))
        self.assertFalse(box.crossed_by(((31, 0), (31, 90))))
        self.assertTrue(box.crossed_by(((20, 24), (20, 24))), "a point")

    def test_boxes_that_touch_do_not_overlap(self) -> None:
        self.assertFalse(Box(0, 0, 1, 1).overlaps(Box(1, 0, 2, 1)))
        self.assertTrue(Box(0, 0, 1, 1).overlaps(Box(0.9, 0.9, 2, 2)))


class TestStacked(unittest.TestCase):
    def test_places_of_a_row_are_apart_and_rows_are_few(self) -> None:
        chance = random.Random(7)
        for _ in range(50):
            places = sorted(chance.uniform(0, 100) for _ in range(chance.randrange(0, 40)))
            rows = stacked(places, 9, 99)
            self.assertEqual(len(rows), len(places))
            for i, row in enumerate(rows):
                for other in range(i):
                    if rows[other] == row:
                        self.assertGreaterEqual(places[i] - places[other], 9)
            crowd = max((sum(at - 9 < one <= at for one in places) for at in places), default=0)
            self.assertEqual(max(rows, default=-1) + 1, crowd, "no more rows than the densest place needs")

    def test_beyond_the_last_row_they_cover_each_other(self) -> None:
        self.assertEqual(stacked([0, 1, 2, 3, 4], 9, 2), [0, 1, 0, 1, 0])
        self.assertEqual(stacked([5.0] * 3, 9, 3), [0, 1, 2])
        self.assertEqual(set(stacked([5.0] * 7, 9, 3)), {0, 1, 2})
        self.assertEqual(stacked([], 9, 3), [])
        self.assertLess(label_places.LEAD, max(label_places.REACHES))


if __name__ == "__main__":
    unittest.main()
