"""Draws the measurements of `kbvh theory`: FOLDER/theory.json becomes figures in FOLDER/figures/.

usage: theory_figures.py FOLDER
"""

import sys

from figures.theory_figures import main

if __name__ == "__main__":
    sys.exit(main())
