"""Prints the headers of the folders as chains: a header includes, by way of others, all those before it in its line.

    header_chains.py SOURCE FOLDER...

A source that includes the headers of a chain in this order compiles each of them as if it stood alone: what comes before
a header it would have included itself. Thus fewer sources show that every header stands alone. One line for each chain,
headers as paths below SOURCE, separated by spaces.
"""

import pathlib
import re
import sys

source, folders = pathlib.Path(sys.argv[1]), sys.argv[2:]
included = {}


def below(header):
    """Returns the headers of the tree that `header` includes, by way of others, too."""
    if header not in included:
        included[header] = set()  # for headers that include each other
        found = set()
        for name in re.findall(r'^#include "([^"]+)"', (source / header).read_text(), re.MULTILINE):
            if (source / name).is_file():
                found |= {name} | below(name)
        included[header] = found
    return included[header]


def chains(headers):
    """Returns the headers in few chains: a largest matching between headers and what they include."""
    follower = {}

    def match(header, tried):
        for name in sorted(below(header) - {header}):
            if name in tried or name not in headers:
                continue
            tried.add(name)
            if name not in follower or match(follower[name], tried):
                follower[name] = header
                return True
        return False

    for header in headers:
        match(header, set())
    for header in headers:
        if header not in follower.values():
            chain = [header]
            while chain[-1] in follower:
                chain.append(follower[chain[-1]])
            yield chain


everything = sorted({str(path.relative_to(source)) for folder in folders for path in (source / folder).rglob("*.hpp")})
for chain in chains(everything):
    print(*chain)
