"""Turns a folder of results into report.html and figures/.

usage: report.py RESULTS_DIR [--title TEXT] [--figures main|all|paper|none] [--print]
"""

import sys

from report.report import main

if __name__ == "__main__":
    sys.exit(main())
