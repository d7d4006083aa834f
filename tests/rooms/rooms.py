"""Tries every edge between rooms of core and experiments: declared ones must be visible, all others must not compile.

usage: rooms.py TABLE SOURCE_DIR COMPILER

TABLE has one room a line: name|folder|rooms it uses, by commas|include folders, by colons.
"""

import pathlib
import re
import subprocess
import sys


#: Files of the tree that are in no room: no room sees them.
TREE = ("experiments/main.cpp", "strategies/bottom_up.cpp", "tests/support/rounding.hpp")


def read_table(file):
    rooms = {}
    for line in pathlib.Path(file).read_text().splitlines():
        name, folder, uses, include = line.split("|")
        rooms[name] = {
            "folder": folder,
            "uses": [use for use in uses.split(",") if use],
            "include": [path for path in include.split(":") if path],
        }
    return rooms


def reach(rooms, name):
    """The room itself and all that it uses, directly or through others."""
    seen, todo = set(), [name]
    while todo:
        room = todo.pop()
        if room not in seen:
            seen.add(room)
            todo += rooms[room]["uses"]
    return seen


def seen(compiler, include, headers):
    """Which of the headers a file with these include folders finds. Only include lines are asked about."""
    source = "".join(f'#if __has_include("{header}")\n{header}\n#endif\n' for header in headers)
    # A source from standard input is in the current folder: one that holds nothing of the tree.
    command = [compiler, "-std=c++20", "-x", "c++", "-E", "-P", "-"]
    command += [option for path in include for option in ("-I", path)]
    done = subprocess.run(command, input=source, text=True, capture_output=True, cwd="/", check=True)
    return set(done.stdout.split()) & set(headers)


def stray_includes(rooms, source):
    """Include lines that name a header by another path than core/..., or one of a room that is not declared.

    Rooms without sources are compiled within those that use them, which may see more.
    """
    homes = sorted(((room["folder"], name) for name, room in rooms.items()), key=lambda home: -len(home[0]))
    found, read = [], 0
    for name, room in rooms.items():
        allowed = reach(rooms, name)
        for file in sorted((source / room["folder"]).rglob("*.[hc]pp")):
            for mark, path in re.findall(r'^\s*#\s*include\s*(["<])([^">]*)', file.read_text(), re.M):
                read += 1
                home = next((other for folder, other in homes if path.startswith(folder + "/")), None)
                if home is None and (path.startswith(("core/", "experiments/")) or (mark == '"' and "/" in path)):
                    found.append(f"{file.relative_to(source)} includes {path}, which is in no room")
                elif home is not None and home not in allowed:
                    found.append(f"{file.relative_to(source)} includes {path}: {name} does not declare {home}")
    return found, read


def main(table, source_dir, compiler):
    rooms = read_table(table)
    source = pathlib.Path(source_dir)
    headers = {}
    for name, room in rooms.items():
        found = sorted((source / room["folder"]).rglob("*.hpp"))
        if found and room["folder"].startswith(("core/", "experiments/")):
            headers[name] = str(found[0].relative_to(source))
    faults, forbidden, declared = [], 0, 0
    for name, room in rooms.items():
        allowed = reach(rooms, name)
        visible_headers = seen(compiler, room["include"], [*headers.values(), *TREE])
        for other, header in headers.items():
            visible = header in visible_headers
            if other in allowed:
                declared += 1
                if not visible:
                    faults.append(f"{name} declares {other}, but does not see {header}")
            else:
                forbidden += 1
                if visible:
                    faults.append(f"{name} does not declare {other}, but sees {header}")
        for header in TREE:
            forbidden += 1
            if header in visible_headers:
                faults.append(f"{name} sees {header}")
            elif not (source / header).exists():
                faults.append(f"{header} is not there: the check asks for nothing")
    stray, read = stray_includes(rooms, source)
    faults += stray
    print("\n".join(faults) if faults else
          f"{declared} declared edges work, {forbidden} others do not compile; {read} include lines are as declared")
    return 1 if faults or 0 in (forbidden, declared, read) else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
