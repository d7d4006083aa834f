#!/usr/bin/env python3
"""Runs the registered tests with one process for all cases of a suite, where CTest starts one for each case.

usage: suites.py [--shuffle SEED] BUILD [CTEST OPTION...]

The options choose tests as ctest does (-L, -LE, -R, -E). Suites run side by side, those first that took longest in this
build before, or have the largest property COST; with --shuffle in a random order, and so do the cases of each. A case that
fails is printed with what its executable said. Exit code 1 if any failed.
"""
import concurrent.futures
import json
import os
import random
import re
import subprocess
import sys
import time

import skipped

SHORTEST_LIMIT = 1200  # seconds, of all cases of a suite together
LONGEST_FILTER = 100_000  # of one argument; Linux takes 131,072 characters


def registered(build, options):
    """The tests that ctest would run, as {"name", "command", "properties"}."""
    out = subprocess.run(["ctest", "--test-dir", build, "--show-only=json-v1", *options], check=True,
                         capture_output=True, text=True).stdout
    return [test for test in json.loads(out)["tests"] if "command" in test]


def batches(tests):
    """Groups cases of one GoogleTest suite: [(name, number of cases, command, environment, folder, expected output, limit, cost)]."""
    groups = {}
    for test in tests:
        properties = {p["name"]: p["value"] for p in test.get("properties", [])}
        environment = tuple(properties.get("ENVIRONMENT", ()))
        folder = properties.get("WORKING_DIRECTORY", ".")
        cases = [word for word in test["command"] if word.startswith("--gtest_filter=")]
        rest = [word for word in test["command"] if word not in cases and word != "--also_run_disabled_tests"]
        case = cases[0].split("=", 1)[1] if cases else None
        suite = test["name"] if case is None else case.rpartition(".")[0]
        key = (tuple(rest), environment, folder, suite)
        limit = max(properties.get("TIMEOUT", 0), SHORTEST_LIMIT)
        settings = properties.get("PASS_REGULAR_EXPRESSION", ()), limit, properties.get("COST", 0)
        groups.setdefault(key, (test["name"], [], *settings))[1].append(case)
    for (command, environment, folder, suite), (name, cases, *settings) in groups.items():
        if cases == [None]:
            yield name, 1, list(command), environment, folder, *settings
            continue
        filters = [""]
        for case in cases:
            if len(filters[-1]) + len(case) > LONGEST_FILTER:
                filters.append("")
            filters[-1] += (":" if filters[-1] else "") + case
        for part in filters:
            yield (f"{os.path.basename(command[0])} {suite}", part.count(":") + 1,
                   [*command, "--gtest_brief=1", "--gtest_filter=" + part], environment, folder, *settings)


def in_order(work, before):
    """The batches, the longest first: by seconds of an earlier run {name: seconds} or else the property COST, then by cases."""
    return sorted(work, key=lambda batch: (-before.get(batch[0], batch[-1]), -batch[1]))


def run(batch):
    name, count, command, environment, folder, expected, limit, _ = batch
    variables = {**os.environ, **dict(entry.split("=", 1) for entry in environment)}
    begin = time.monotonic()
    try:
        ran = subprocess.run(command, cwd=folder, env=variables, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                             errors="replace", timeout=limit)
        code, said = ran.returncode, ran.stdout
    except subprocess.TimeoutExpired as late:
        said = (late.stdout or b"").decode(errors="replace") + f"\nafter {limit:.0f} s it had not ended"
        return name, count, 1, said, time.monotonic() - begin
    if expected:  # as for ctest, the output decides
        code = 0 if any(re.search(text, said, re.DOTALL) for text in expected) else code or 1
    return name, count, code, said, time.monotonic() - begin


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    begin = time.monotonic()
    arguments = sys.argv[1:]
    seed = int(arguments[1]) if arguments[0] == "--shuffle" else None
    build, *options = arguments if seed is None else arguments[2:]
    past = os.path.join(build, "suite_times.json")
    before = {}
    if os.path.exists(past):
        with open(past) as file:
            before = json.load(file)
    work = in_order(batches(registered(build, options)), before)
    if seed is not None:
        random.Random(seed).shuffle(work)
        os.environ.update(GTEST_SHUFFLE="1", GTEST_RANDOM_SEED=str(seed % 99999 + 1))
    if not work:
        sys.exit("no test is chosen")
    failed, cases, times, left_out = [], 0, [], []
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count() or 2) as pool:
        for name, count, code, output, seconds in pool.map(run, work):
            cases += count
            left_out += skipped.in_output(output)
            times.append((seconds, name))
            if code != 0:
                failed.append(name)
                print(f"FAILED ({code}): {name}\n{output}", flush=True)
    with open(past + ".new", "w") as file:
        json.dump({**before, **{name: seconds for seconds, name in times}}, file)
    os.replace(past + ".new", past)
    for seconds, name in sorted(times, reverse=True)[:8]:
        print(f"{seconds:7.1f} s  {name}")
    print(skipped.summary(left_out))
    print(f"{cases} cases of {len(work)} suites in {time.monotonic() - begin:.0f} s, "
          + (f"{len(failed)} failed: " + ", ".join(failed) if failed else "all passed"))
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
