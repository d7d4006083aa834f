"""Of several runs of one plan, the quieter one of each table.

usage: quieter.py RESULTS_DIR RESULTS_DIR... --out DIR
"""

import sys

from results.quieter import main

if __name__ == "__main__":
    sys.exit(main())
