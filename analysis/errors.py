"""Time against error, of one or several studies: what each figure shows, and the figures' data for pages without the results.

usage: errors.py RESULTS_DIR... [--write FILE]
"""

import sys

from figures.time_error_file import main

if __name__ == "__main__":
    sys.exit(main())
