"""The targets of a plan and the measurements, from targets.json, as Markdown tables.

usage: targets_table.py DIR/targets.json [--write analysis/guides/results.md]
"""

import sys

from report.targets_table import main

if __name__ == "__main__":
    sys.exit(main())
