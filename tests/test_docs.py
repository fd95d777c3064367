# SPDX-License-Identifier: Apache-2.0
"""What the documents name exists: linked files and headings, files and modules of the tree, what modules define, arguments,
options.
"""

import ast
import json
import re
from functools import cache
from graphlib import TopologicalSorter
from itertools import pairwise, takewhile
from pathlib import Path
from zipfile import ZipFile

import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = ("neuralocks_core", "usd", "dcc_addon", "benchmarks", "examples", "docs", "tests")
DOCUMENTS = ["README.md", "CREDITS.md", *sorted(f"docs/{path.name}" for path in (ROOT / "docs").glob("*.md"))]
FILES = [path.relative_to(ROOT).as_posix() for folder in FOLDERS for path in (ROOT / folder).rglob("*.*")]


def defined(path: Path) -> set[str]:
    """Names that a module, or a class in it, defines or imports."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.ImportFrom):
            names |= {each.asname or each.name for each in node.names}
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names |= {each.id for target in targets for each in ast.walk(target) if isinstance(each, ast.Name)}
            names |= {each.attr for target in targets for each in ast.walk(target) if isinstance(each, ast.Attribute)}
    return names


@cache
def modules() -> dict[str, set[str]]:
    """Module or package -> what it defines; modules of the same name count as one."""
    found: dict[str, set[str]] = {}
    for folder in FOLDERS[:3]:
        for path in (ROOT / folder).rglob("*.py"):
            own, above = (path.parent, path.parents[1]) if path.stem == "__init__" else (path, path.parent)
            found.setdefault(own.stem, set()).update(defined(path))
            found.setdefault(above.name, set()).add(own.stem)
    return found


@cache
def classes() -> dict[str, set[str]]:
    """Class -> its fields, methods and what its methods set, including those of its base classes; classes of the same name count as
    one.
    """
    own: dict[str, set[str]] = {}
    bases: dict[str, set[str]] = {}
    for path in (path for folder in FOLDERS[:3] for path in (ROOT / folder).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.ClassDef):
                own.setdefault(node.name, set()).update(members(node))
                bases.setdefault(node.name, set()).update(base.id for base in node.bases if isinstance(base, ast.Name))

    def whole(name: str) -> set[str]:
        return own.get(name, set()).union(*map(whole, bases.get(name, ())))

    return {name: whole(name) for name in own}


def members(node: ast.ClassDef) -> set[str]:
    """What is in the body of a class, and what its methods set on `self`."""
    names = {each.name for each in node.body if isinstance(each, ast.FunctionDef)}
    for each in node.body:
        if isinstance(each, ast.Assign | ast.AnnAssign):
            targets = each.targets if isinstance(each, ast.Assign) else [each.target]
            names |= {target.id for target in targets if isinstance(target, ast.Name)}
    stored = (each for each in ast.walk(node) if isinstance(each, ast.Attribute) and isinstance(each.ctx, ast.Store))
    return names | {each.attr for each in stored if isinstance(each.value, ast.Name) and each.value.id == "self"}


@pytest.mark.parametrize("document", DOCUMENTS)
def test_what_is_named_exists(document):
    text = (ROOT / document).read_text("utf-8")
    links = [link for link in re.findall(r"\]\(([^)#\s]+)\)", text) if "://" not in link]
    missing = [link for link in links if not ((ROOT / document).parent / link).exists()]
    known = modules()
    for code in re.findall(r"`([^`\n]+)`", text):
        missing += [
            name
            for name in re.findall(r"[\w/]+\.(?:py|h\.in|c\.in|c|md|png|gif)\b", code)
            if not any(file == name or file.endswith(f"/{name}") for file in (*FILES, "README.md", "CREDITS.md"))
        ]
        for dotted in re.findall(r"(?<![\w./])[a-z_]+(?:\.[A-Za-z_]\w*)+\b(?!/)", code):
            for owner, name in pairwise(dotted.split(".")):
                if owner in known and name not in known[owner] and name not in ("py", "json", "c", "usdc"):
                    missing.append(dotted)
        for owner, field in re.findall(r"(?<![\w./])([A-Z]\w*)\.([A-Za-z_]\w*)", code):
            if owner in classes() and field not in classes()[owner]:
                missing.append(f"{owner}.{field}")
    assert not missing


def anchor(heading: str) -> str:
    """As GitHub turns headings into anchors: lower case, spaces as hyphens, without other signs."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


@pytest.mark.parametrize("document", DOCUMENTS)
def test_headings_that_are_linked_are_there(document):
    for file, linked in re.findall(r"\]\(([^)#:\s]*)#([^)\s]+)\)", (ROOT / document).read_text("utf-8")):
        there = ((ROOT / document).parent / file if file else ROOT / document).read_text("utf-8")
        headings = re.findall(r"^#+ (.+)$", re.sub(r"^```.*?^```", "", there, flags=re.M | re.S), re.M)
        assert linked in set(map(anchor, headings)), (file, linked)


def test_the_index_of_the_ablations_names_each_section():
    index, *sections = re.split(r"^##+ ", (ROOT / "docs/ablations.md").read_text("utf-8"), flags=re.M)
    headings = [each.splitlines()[0] for each in sections]
    assert len(headings) > 30 and not [each for each in headings if f"(#{anchor(each)})" not in index]


@cache
def arguments() -> dict[str, set[str]]:
    """Keyword arguments of functions, classes and `Class.method`s; those of the same name count as one."""
    found: dict[str, set[str]] = {}

    def add(name, node):
        taken = {each.arg for each in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)}
        found.setdefault(name, set()).update(taken)

    for path in (path for folder in FOLDERS[:3] for path in (ROOT / folder).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.FunctionDef):
                add(node.name, node)
            elif isinstance(node, ast.ClassDef):
                fields = {each.target.id for each in node.body if isinstance(each, ast.AnnAssign)}
                found.setdefault(node.name, set()).update(fields)
                for method in (each for each in node.body if isinstance(each, ast.FunctionDef)):
                    add(node.name if method.name == "__init__" else f"{node.name}.{method.name}", method)
    return found


@pytest.mark.parametrize("document", DOCUMENTS)
def test_arguments_that_are_named_can_be_given(document):
    for code in re.findall(r"`([^`\n]+)`", (ROOT / document).read_text("utf-8")):
        for name, given in re.findall(r"([A-Za-z_][\w.]*)\(([^()]*\w=[^()]*)\)", code):
            # The name before a dot may be a class or a module.
            known = arguments().get(name) or arguments().get("" if name[0].isupper() else name.split(".")[-1], set())
            assert set(re.findall(r"(\w+)=", given)) <= known, code


def test_the_map_names_modules_that_are_there():
    """`docs/architecture.md`, Where things are: whatever is code in a table names a module or a folder."""
    map_ = (ROOT / "docs/architecture.md").read_text("utf-8").split("## Where things are")[1].split("\n## ")[0]
    rows = [line for line in map_.splitlines() if line.startswith("|")]
    named = {name for row in rows for code in re.findall(r"`([\w/]+)`", row) for name in code.rstrip("/").split("/")}
    assert len(named) > 80 and named <= set(modules()), named - set(modules())


@pytest.mark.parametrize(
    ("package", "section"),
    [("neuralocks_core", "Where things are"), ("usd", "Where things are"), ("dcc_addon", "The Blender add-on")],
)
def test_every_module_is_on_the_map(package, section):
    """Top-level modules and folders; except in the core, also the modules in folders."""
    text = (ROOT / "docs/architecture.md").read_text("utf-8").split(f"## {section}")[1].split("\n## ")[0]
    named = {word for code in re.findall(r"`([^`\n]+)`", text) for word in re.findall(r"\w+", code)}
    folders = {path.parent for path in (ROOT / package).rglob("*/__init__.py")}
    there = {path.stem for path in (ROOT / package).glob("[!_]*.py")} | {folder.name for folder in folders}
    if package != "neuralocks_core":
        there |= {path.stem for folder in folders for path in folder.glob("[!_]*.py")}
    assert there <= named, there - named


@pytest.mark.parametrize(
    ("package", "table"),
    [
        ("neuralocks_core", "\n`neuralocks_core/`"),
        ("usd", "\n`usd/`"),
        ("dcc_addon", "\n## The Blender add-on"),
        ("dcc_addon/services", "\n| **`services/`**"),
        ("dcc_addon/scene", "\n| **`scene/`**"),
    ],
)
def test_nothing_imports_what_stands_further_down_the_map(package, table):
    """Rows are folders, or the top-level modules that they name; a folder of which other rows name parts is its own modules."""
    folder = ROOT / package
    text = (ROOT / "docs/architecture.md").read_text("utf-8").split(table)[1]
    lines = text[text.index("\n|") :].split("\n\n")[0].splitlines()[1:]
    part = takewhile(lambda row: "**" not in row, lines) if "**" in table else lines
    rows = [row.split("|") for row in part]
    named = [re.findall(r"`([\w/]+)/`", where) for _, where, _, _ in rows]
    parted = {name.split("/")[0] for names in named for name in names if "/" in name}
    order = []
    for names, (_, _, what, _) in zip(named, rows, strict=True):
        folders = [name for name in names if (folder / name).is_dir()]
        alone = [name for name in re.findall(r"`(\w+)`", what) if (folder / f"{name}.py").exists()]
        if folders:
            below = {name: "*.py" if name in parted else "**/*.py" for name in folders}
            order.append([path for name, files in below.items() for path in sorted((folder / name).glob(files))])
        elif alone:
            order.append([folder / f"{name}.py" for name in alone])
    there = {path for part in folder.glob("*/__init__.py") for path in part.parent.rglob("*.py")}
    assert {path for row in order for path in row} >= there
    for place, row in enumerate(order):
        below = {dotted_name(path) for later in order[place + 1 :] for path in later}
        for path in row:
            assert not imported(path) & below, path


def dotted_name(path: Path) -> str:
    """A module as it is imported."""
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def imported(path: Path) -> set[str]:
    """What a module imports, wherever in it: modules, and names in them. Types in annotations do not count."""
    tree = ast.parse(path.read_text("utf-8"))
    typed = {
        id(each)
        for node in tree.body
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
        for each in ast.walk(node)
    }
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and id(node) not in typed:
            above = path.relative_to(ROOT).parts[: -node.level] if node.level else ()
            base = [*above, *(node.module.split(".") if node.module else [])]
            found |= {".".join(base), *(".".join([*base, each.name]) for each in node.names)}
    return found


@pytest.mark.parametrize("package", FOLDERS[:3])
def test_no_modules_import_each_other_in_a_circle(package):
    """Not even for types in annotations."""
    parts = {path: path.relative_to(ROOT).with_suffix("").parts for path in (ROOT / package).rglob("*.py")}
    names = {path: ".".join(each).removesuffix(".__init__") for path, each in parts.items()}
    graph = {name: set() for name in names.values()}
    for path, name in names.items():
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.ImportFrom):
                above = parts[path][: -node.level] if node.level else ()
                base = ".".join([*above, *filter(None, [node.module])])
                for each in node.names:  # a module of a package, or what a module defines
                    graph[name] |= {f"{base}.{each.name}" if f"{base}.{each.name}" in graph else base} & graph.keys()
    assert list(TopologicalSorter(graph).static_order())


@pytest.mark.parametrize("document", DOCUMENTS)
def test_commands_have_the_options_that_are_written(document):
    """In lines that begin with `neuralocks` and one of its commands."""
    typer = pytest.importorskip("typer")
    from usd.cli.app import app

    text = (ROOT / document).read_text("utf-8")
    for line in re.findall(r"neuralocks (?:rig )?[a-z]+[^#`\n]*", text):
        if not (written := set(re.findall(r"(?<!\w)--[a-z][a-z-]+", line))):
            continue
        command = typer.main.get_command(app)
        for word in line.split()[1:]:
            command = getattr(command, "commands", {}).get(word, command)
        options = {option for each in command.params for option in (*each.opts, *each.secondary_opts)}
        assert written <= options | {"--help"}, line


@pytest.mark.parametrize("document", DOCUMENTS)
def test_examples_import_what_is_there(document):
    text = (ROOT / document).read_text("utf-8")
    for example in re.findall(r"```python\n(.*?)```", text, re.S):
        for node in ast.walk(ast.parse(example)):
            if isinstance(node, ast.ImportFrom):
                module = (ROOT / node.module.replace(".", "/")).with_suffix(".py")
                assert {each.name for each in node.names} <= defined(module), node.module


def test_every_file_is_under_the_licence_that_the_credits_state():
    """GPL-3.0-or-later is what runs in Blender; all else, but for empty files, is Apache-2.0."""
    credits = (ROOT / "CREDITS.md").read_text("utf-8")
    assert all(f"`{name}" in credits for name in ("LICENSE`", "dcc_addon/`", "dcc_addon/LICENSE`", "blender_*.py`"))
    for path in (path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py")):
        folders = path.relative_to(ROOT).parts[:-1]
        blender = "dcc_addon" in folders or folders[:2] in {("tests", "addon"), ("tests", "blender")}
        if path.name.startswith("blender_") and folders[0] in ("examples", "benchmarks"):
            blender = True
        licence = "GPL-3.0-or-later" if blender else "Apache-2.0"
        if text := path.read_text("utf-8"):
            assert f"SPDX-License-Identifier: {licence}\n" in text[:100] and licence in credits, path


def test_the_credits_name_each_model_that_learned_from_hair_of_others():
    learned = []
    for path in sorted((ROOT / "neuralocks_core/shipped").glob("strands*.neuralocks")):
        with ZipFile(path) as model:
            card = json.loads(model.read("model.json"))
        if any("TressFX" in credit for credit in card["credits"]):
            learned.append("all styles" if path.stem == "strands" else f"{path.stem.removeprefix('strands_')} hair")
    told = re.search(
        r"those for (.+) also on the ponytail", " ".join((ROOT / "CREDITS.md").read_text("utf-8").split())
    )[1]
    assert told.split(" and for ") == learned
