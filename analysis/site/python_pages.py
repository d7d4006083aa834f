"""The pages of the Python package: its functions and classes from their docstrings, and its notebooks with their outputs."""

from __future__ import annotations

import ast
import base64
import html
import inspect
import re
from pathlib import Path
from typing import Any, Union

#: The parts of the page, in the order of use; every public name appears in one of them.
PARTS = {
    "Scenes": ["scene", "builtin_scenes", "load", "shapes", "Scene", "Body", "elements", "PlanChange"],
    "Playing a scene": ["World", "Hierarchy", "Audit", "Step", "padded", "counters"],
    "Strategies": ["strategies", "describe"],
    "The broad phase of a simulator": ["BroadPhase"],
    "A strategy of one's own": ["Strategy", "Parameter", "SceneView", "BodyView", "register", "check", "Verdict", "small_scenes"],
    "Trees as arrays": ["Tree", "refit", "overlapping", "primitive_bounds"],
    "Studies and results": ["plan", "run", "Run", "results"],
    "Errors": ["KbvhError", "ConfigError", "InputError"],
}
Function = Union[ast.FunctionDef, ast.AsyncFunctionDef]


def prose(text: str) -> list[str]:
    """Returns a docstring as Markdown: examples become blocks of code, all else stays."""
    lines: list[str] = []
    code = False
    for line in inspect.cleandoc(text).split("\n"):
        if line.startswith(">>>") and not code:
            lines += ["", "```python"]
            code = True
        elif code and not line.strip():
            lines.append("```")
            code = False
        lines.append(line)
    return [*lines, "```", ""] if code else [*lines, ""]


def signature(name: str, function: Function) -> str:
    """Returns a call as one writes it: without self."""
    given = ast.parse(ast.unparse(function)).body[0]
    assert isinstance(given, (ast.FunctionDef, ast.AsyncFunctionDef))
    if given.args.args and given.args.args[0].arg in ("self", "cls"):
        del given.args.args[0]
    returns = f" -> {ast.unparse(given.returns)}" if given.returns and name[:1].islower() else ""
    return f"{name}({ast.unparse(given.args)}){returns}"


def block(call: str) -> list[str]:
    return ["```python", call, "```", ""]


def decorated(function: Function, by: str) -> bool:
    return any(by in ast.unparse(decorator) for decorator in function.decorator_list)


def of_class(name: str, node: ast.ClassDef) -> list[str]:
    """Returns the part about a class: its constructor, its fields, its methods."""
    methods = [item for item in node.body if isinstance(item, (ast.FunctionDef, ast.AsyncFunctionDef))]
    fields = [item for item in node.body if isinstance(item, ast.AnnAssign) and not ast.unparse(item.target).startswith("_")]
    made = next((item for item in methods if item.name == "__init__"), None)
    lines = [f"### {name}", ""]
    if made:
        lines += block(signature(name, made))
    elif fields:
        lines += block(f"{name}({', '.join(ast.unparse(item) for item in fields)})")
    lines += prose(ast.get_docstring(node) or "")
    for item in methods:
        said = ast.get_docstring(item)
        if item.name.startswith("_") or not said or decorated(item, ".setter"):
            continue
        if decorated(item, "property"):
            call = f"{item.name}: {ast.unparse(item.returns)}" if item.returns else item.name
        else:
            call = signature(item.name, item)
        lines += [f"#### {name}.{item.name}", "", *block(call), *prose(said)]
    return lines


def definitions(package: Path) -> dict[str, ast.AST]:
    """Returns the classes and functions of a package by name; those of its stub only where nothing else defines them."""
    found: dict[str, ast.AST] = {}
    for file in [*sorted(package.glob("*.py")), *sorted(package.glob("*.pyi"))]:
        for node in ast.parse(file.read_text()).body:
            if isinstance(node, (ast.ClassDef, ast.FunctionDef)):
                found.setdefault(node.name, node)
    return found


def public(package: Path) -> list[str]:
    """Returns the names in __all__."""
    for node in ast.parse((package / "__init__.py").read_text()).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
            return list(ast.literal_eval(node.value))
    raise SystemExit(f"{package}/__init__.py has no __all__")


def reference(package: Path) -> str:
    """Returns the page. Every public name must have its part."""
    names, known = public(package), definitions(package)
    listed = [name for part in PARTS.values() for name in part]
    if sorted(listed) != sorted(names):
        raise SystemExit(f"python_pages.PARTS differs from kbvh.__all__: {sorted(set(listed) ^ set(names))}")
    lines = [
        "# Python reference", "",
        "What `import kbvh` offers. Times are in seconds, positions in units of length; ids count from 0. "
        "[kbvh in Python](analysis/kbvh/README.md) tells how to install it, the [notebooks](notebooks.md) show it at work.", "",
    ]  # fmt: skip
    for title, part in PARTS.items():
        lines += [f"## {title}", ""]
        for name in part:
            node = known.get(name)
            if isinstance(node, ast.ClassDef):
                lines += of_class(name, node) if ast.get_docstring(node) else [f"### {name}", "", *error(name, node)]
            elif isinstance(node, ast.FunctionDef):
                lines += [f"### {name}", "", *block(signature(name, node)), *prose(ast.get_docstring(node) or "")]
            else:
                module = ast.parse((package / f"{name}.py").read_text())
                lines += [f"### {name}", "", *prose(ast.get_docstring(module) or "")]
                for item in module.body:
                    if isinstance(item, ast.FunctionDef) and not item.name.startswith("_"):
                        lines += [f"#### {name}.{item.name}", "", *block(signature(f"{name}.{item.name}", item)), *prose(ast.get_docstring(item) or "")]
    return "\n".join(lines)


def error(name: str, node: ast.ClassDef) -> list[str]:
    """Returns the sentence about an error of the compiled part."""
    meaning = {
        "KbvhError": "Any error of the library about its input; a ValueError.",
        "ConfigError": "A strategy, a parameter or a topology that does not exist or is out of its range.",
        "InputError": "A scene, a file or a change that cannot be used; the text names the place and the value.",
    }
    return [f"*An error, derived from `{ast.unparse(node.bases[0])}`.* {meaning[name]}", ""]


def output(data: dict[str, Any], name: str, folder: Path) -> list[str]:
    """Returns an output of a cell: a picture as a file of `folder`, else a table, else text."""
    text = data.get("text/plain", data.get("text", ""))
    text = "".join(text) if isinstance(text, list) else text
    if "image/png" in data:
        (folder / f"{name}.png").write_bytes(base64.b64decode(data["image/png"]))
        said = html.escape(re.sub(r"\s+", " ", text))
        return ["```{raw} html", f'<div class="output"><img src="{name}.png" alt="{said}"></div>', "```", ""]
    if "text/html" in data:
        markup = "".join(data["text/html"])
        markup = re.sub(r"<style.*?</style>", "", markup, flags=re.S).replace(' border="1"', "")
        return ["```{raw} html", f'<div class="output">{markup}</div>', "```", ""]
    return ["```text", *text.rstrip().split("\n"), "```", ""] if text.strip() else []


def notebook(cells: list[dict[str, Any]], name: str, folder: Path) -> str:
    """Returns a notebook as a page; its pictures become files of `folder`."""
    lines: list[str] = []
    for c, cell in enumerate(cells):
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            lines += [source, ""]
            continue
        lines += ["```python", source, "```", ""]
        for o, one in enumerate(cell.get("outputs", [])):
            if one["output_type"] == "error":
                raise SystemExit(f"{name}: cell {c} ends with {one['ename']}: {one['evalue']}")
            if one["output_type"] == "stream" and one["name"] == "stderr":
                continue
            lines += output(one.get("data", one), f"{name}-{c}-{o}", folder)
    return "\n".join(lines)
