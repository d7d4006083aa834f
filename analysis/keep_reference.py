"""Makes analysis/reference from the results of plan paper: RESULTS_DIR/results.jsonl, packed, theory.json and claims.json.

usage: keep_reference.py RESULTS_DIR [--out DIR]
"""

import sys

from claims.reference import main

if __name__ == "__main__":
    sys.exit(main())
