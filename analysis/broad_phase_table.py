"""The ratios of kbvh_broad_phase_bench and their targets, as a Markdown table.

usage: broad_phase_table.py FILE.json [--write analysis/guides/ipc-toolkit.md]
"""

import sys

from report.broad_phase_table import main

if __name__ == "__main__":
    sys.exit(main())
