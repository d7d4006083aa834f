"""Draws a simulation of `kbvh loop`: a film strip of its frames, and its energies, momentum, gaps and times over time."""

import sys

from figures.loop_figures import main

if __name__ == "__main__":
    sys.exit(main())
