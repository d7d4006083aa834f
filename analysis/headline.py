"""The headline tables of README.md and of the results guide, from the results of plan `headline`.

usage: headline.py RESULTS_DIR [--write PAGE]... [--picture FILE.png]
"""

import sys

from report.headline import main

if __name__ == "__main__":
    sys.exit(main())
