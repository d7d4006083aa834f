"""Turns a folder of results into explorer.html: one page with its data inside, for any browser, without a network.

usage: explore.py RESULTS_DIR [--title TEXT]
"""

import sys

from explorer.explore import main

if __name__ == "__main__":
    sys.exit(main())
