"""The overview for print: which profiles are drawn, and what is said of the others."""

import unittest

import paths  # noqa: F401

import overview_figures
from profiles import Profile


class Selection(unittest.TestCase):
    def profiles(self, count):
        return [Profile(f"s{i}", [1.0 + i], 10) for i in range(count)]

    def test_few_are_all_drawn(self):
        few = self.profiles(overview_figures.MOST + overview_figures.EXTRA)
        self.assertEqual(overview_figures.selection(few, set()), (few, []))
        self.assertEqual(overview_figures.left_out_says([], {}), "")

    def test_of_many_the_best_and_the_baselines(self):
        many = self.profiles(47)
        drawn, left_out = overview_figures.selection(many, {"s3", "s40"})
        self.assertEqual([one.id for one in drawn], [f"s{i}" for i in range(overview_figures.MOST)] + ["s40"])
        self.assertEqual(len(drawn) + len(left_out), 47)
        says = overview_figures.left_out_says(left_out, {one.id: f"title of {one.id}" for one in many})
        for one in left_out:
            self.assertIn(f"title of {one.id}", says)
        self.assertNotIn("title of s40", says)


if __name__ == "__main__":
    unittest.main()
