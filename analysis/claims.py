"""Checks the paper's claims against results: RESULTS_DIR/results.jsonl and theory.json become RESULTS_DIR/claims.json.

usage: claims.py RESULTS_DIR [--claims FILE]
"""

import sys

from claims.claims import main

if __name__ == "__main__":
    sys.exit(main())
