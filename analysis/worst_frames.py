"""The worst frames of the best refit and of the interval joins, from the results of plan `spacetime`.

usage: worst_frames.py RESULTS_DIR [--write analysis/guides/results.md]
"""

import sys

from report.worst_frames import main

if __name__ == "__main__":
    sys.exit(main())
