"""Which strategy for what, by one rule over the cells of a study: for the report, its lines on the terminal, the guide and the site.

usage: advice.py RESULTS_DIR [--write PAGE]     prints the table, or puts it between `<!-- advice -->` and `<!-- /advice -->`
"""

import sys

from advice.advice import main

if __name__ == "__main__":
    sys.exit(main())
