"""The simulations below a folder, with the finders of their pairs side by side, as a Markdown table.

usage: loop_table.py FOLDER [--write analysis/guides/simulator.md]
"""

import sys

from report.loop_table import main

if __name__ == "__main__":
    sys.exit(main())
