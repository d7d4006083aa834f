#!/usr/bin/env python3
"""Checks that the tests which share the cases of one executable leave none of them out.

usage: parts.py BUILD

kbvh_parts (tests/CMakeLists.txt) divides the cases of an executable by patterns, frames per keyframe interval and shards. Every
case must be in one of these tests, every shard must be registered, and cases that depend on KBVH_PER_KEYFRAME must be played at
each of FRAMES in one test or another. Exit code 1 if something is missing.
"""
import collections
import json
import subprocess
import sys

FRAMES = {"conformance_test": ("Registry/Conformance.", {"1", "7", "20"})}  # what the executable plays if nothing is set


def cases(program, pattern):
    """Names of the cases of a GoogleTest executable that match a pattern."""
    listed = subprocess.run([program, "--gtest_list_tests", "--gtest_filter=" + pattern], check=True, capture_output=True,
                            text=True).stdout
    names, suite = set(), ""
    for line in listed.splitlines():
        word = line.split("#")[0].rstrip()
        if line.startswith("  "):
            names.add(suite + word.strip())
        elif word.endswith("."):
            suite = word
    return names


def settings(test):
    """The environment that CTest gives to a test."""
    properties = {one["name"]: one["value"] for one in test.get("properties", [])}
    if "sanitized" in properties.get("LABELS", ()):
        return {}  # of another build, and a choice
    return dict(entry.split("=", 1) for entry in properties.get("ENVIRONMENT", ()))


def faults(tests):
    """Describes what no registered test plays. `tests` are those of `ctest --show-only=json-v1`."""
    parts = collections.defaultdict(lambda: collections.defaultdict(set))  # program: (pattern, frames, shards): shards
    for test in tests:
        said = settings(test)
        if "GTEST_TOTAL_SHARDS" in said:
            key = (said.get("GTEST_FILTER", "*"), said.get("KBVH_PER_KEYFRAME", ""), int(said["GTEST_TOTAL_SHARDS"]))
            parts[test["command"][0]][key].add(int(said["GTEST_SHARD_INDEX"]))
    found = [] if parts else ["no test is registered in parts"]
    for program, chosen in sorted(parts.items()):
        name = program.rpartition("/")[2]
        frames_of = collections.defaultdict(set)
        for (pattern, frames, shards), registered in chosen.items():
            if registered != set(range(shards)):
                found.append(f"{name} {pattern}: shards {sorted(registered)} of {shards}")
            for case in cases(program, pattern):
                frames_of[case].update(frames.split(","))
        prefix, wanted = FRAMES.get(name, ("", set()))
        for case in sorted(cases(program, "*")):
            if case not in frames_of:
                found.append(f"{name}: {case} is in no test")
            elif wanted and case.startswith(prefix) and not wanted <= frames_of[case]:
                found.append(f"{name}: {case} is not played with {sorted(wanted - frames_of[case])} frames a keyframe")
    return found


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    out = subprocess.run(["ctest", "--test-dir", sys.argv[1], "--show-only=json-v1"], check=True, capture_output=True,
                         text=True).stdout
    found = faults([test for test in json.loads(out)["tests"] if "command" in test])
    for text in found[:40]:
        print(text)
    print(f"{len(found)} missing" if found else "every case is in a test")
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
