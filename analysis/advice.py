"""Which strategy for what, by one rule over the cells of some studies: for the report, its lines on the terminal, the guide and the site.

usage: advice.py RESULTS_DIR... [--cells FILE] [--write PAGE]
"""

import sys

from advice.cells_file import main

if __name__ == "__main__":
    sys.exit(main())
