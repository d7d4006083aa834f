"""CITATION.cff, versions and templates: fields that the format knows, and one version everywhere."""

import re
import unittest
from pathlib import Path

import paths

try:
    import yaml
except ImportError:  # comes with snakemake
    yaml = None

ROOT = paths.HERE.parents[1]
#: Citation File Format 1.2.0: keys of the file, of a reference, of persons and of entities, as far as this file may use them.
FILE = {
    "cff-version", "message", "title", "authors", "abstract", "keywords", "license", "version", "type", "references",
    "date-released", "doi", "identifiers", "repository-code", "url", "commit", "preferred-citation", "contact",
}  # fmt: skip
REFERENCE = {"type", "title", "authors", "year", "number", "institution", "doi", "url", "journal", "volume", "pages", "month"}
PERSON = {"family-names", "given-names", "name-particle", "name-suffix", "alias", "affiliation", "orcid", "email", "website"}
ENTITY = {"name", "address", "city", "country", "date-start", "date-end", "email", "website", "orcid", "alias"}
TYPES = {"software", "dataset"}


def faults(citation):
    """Returns what the format forbids."""
    found = [f"{key} is no key of the file" for key in set(citation) - FILE]
    found += [f"{key} is missing" for key in ("cff-version", "message", "title", "authors") if not citation.get(key)]
    if citation.get("cff-version") != "1.2.0":
        found.append("cff-version is not 1.2.0")
    if citation.get("type", "software") not in TYPES:
        found.append(f"type {citation['type']}")
    if not isinstance(citation.get("version"), str):
        found.append("the version is no text")
    for entry in [citation, *citation.get("references", [])]:
        if entry is not citation:
            found += [f"{key} is no key of a reference" for key in set(entry) - REFERENCE]
            found += [f"a reference without {key}" for key in ("type", "title", "authors") if key not in entry]
        for author in entry.get("authors", []):
            if not (set(author) <= PERSON or set(author) <= ENTITY and author.get("name")):
                found.append(f"{author} is neither a person nor an entity")
    return found


class Citation(unittest.TestCase):
    def setUp(self):
        if yaml is None:
            self.skipTest("python3-yaml is not installed")
        self.citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())

    def test_is_of_the_format(self):
        self.assertEqual(faults(self.citation), [])

    def test_faults_are_seen(self):
        for key, value in (("title", None), ("licence", "MIT"), ("version", 0.1), ("type", "program"), ("authors", [{"who": 1}])):
            self.assertNotEqual(faults(self.citation | {key: value}), [], key)

    def test_version_is_that_of_the_build(self):
        built = re.search(r"project\(kbvh VERSION ([0-9.]+)", (ROOT / "CMakeLists.txt").read_text())
        self.assertEqual(self.citation["version"], built.group(1))


class Pages(unittest.TestCase):
    def test_files_that_contributing_names_are_there(self):
        text = (ROOT / "CONTRIBUTING.md").read_text()
        for target in re.findall(r"\]\(([^)#]+)[^)]*\)", text):
            self.assertTrue((ROOT / target).exists(), target)
        for path in re.findall(r"`((?:experiments|strategies|analysis|tests|core)/[\w./-]*)", text):
            self.assertTrue((ROOT / path).exists(), path)

    def test_templates_have_a_name_and_a_purpose(self):
        templates = list(Path(ROOT / ".github/ISSUE_TEMPLATE").glob("*.md"))
        self.assertEqual(len(templates), 4)
        for template in templates:
            self.assertRegex(template.read_text(), r"\A---\nname: .+\nabout: .+\n---\n", template.name)

    def test_the_container_runs_the_two_commands(self):
        text = (ROOT / "Containerfile").read_text()
        for command in ("experiments/reproduce", "tests/run", "experiments/setup"):
            self.assertIn(command, text)
            self.assertTrue((ROOT / command).exists())


if __name__ == "__main__":
    unittest.main()
