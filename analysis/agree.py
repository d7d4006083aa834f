"""Compares the verdicts of two studies on the claims.

usage: agree.py FOLDER FOLDER
"""

import sys

from claims.agree import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
