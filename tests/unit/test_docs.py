"""What the docs name is there: functions by their dotted path, files by theirs."""

import ast
import re

from support import ROOT, SCRIPTS

PAGES = [*sorted((ROOT / "docs").rglob("*.md")), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]

#: Folders that a path in the docs may begin with; ``<name>`` in one stands for any name.
FOLDERS = ("bench", "config", "docs", "envs", "scripts", "tests", "workflow")


#: Suffixes of files that may tell how to install something.
TEXTS = {"", ".css", ".def", ".j2", ".js", ".md", ".py", ".rst", ".smk", ".toml", ".txt", ".yaml"}

#: What `cccd` offers by a name of its own; `cccd.api` has it.
PUBLIC = {
    node.value
    for node in ast.walk(ast.parse((SCRIPTS / "cccd" / "__init__.py").read_text(encoding="utf-8")))
    if isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value.isidentifier()
}


def members(body):
    """What a module's or a class's body defines, by name."""
    found = {}
    for node in body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            found[node.name] = node
        elif isinstance(node, ast.Assign):
            found |= {target.id: node for target in node.targets if isinstance(target, ast.Name)}
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            found[node.target.id] = node
    return found


def is_there(dotted):
    """Whether a package, a module, or something that a module defines has this name; nothing is imported."""
    path, parts = SCRIPTS, dotted.split(".")
    if parts[0] == "cccd" and parts[1:2] and parts[1] in PUBLIC:
        if len(parts) == 2:
            return True
        parts.insert(1, "api")
    while parts and (path / parts[0]).is_dir():
        path /= parts.pop(0)
    if not parts:
        return (path / "__init__.py").is_file()
    module = path / f"{parts.pop(0)}.py"
    if not module.is_file():
        return False
    body = ast.parse(module.read_text(encoding="utf-8")).body
    for name in parts:
        node = members(body).get(name)
        if node is None:
            return False
        body = getattr(node, "body", [])
    return True


def quoted(page, pattern):
    """Texts in backticks that match as a whole, fenced code left out."""
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    return {found for found in re.findall(r"`([^`\n]+)`", text) if re.fullmatch(pattern, found)}


def test_what_is_not_there_is_noticed():
    assert not is_there("cccd.Surface.wirte")
    assert not is_there("cccd.surface.loft.loft")
    assert not is_there("cccd.geometry.mesh.Mesh.weight")
    assert not is_there("cccd.surfaces")


def test_every_function_that_a_page_names_is_there():
    wrong = {
        (page.name, name)
        for page in PAGES
        for name in quoted(page, r"cccd(_\w+)?(\.\w+)+")
        if not is_there(name)
    }
    assert wrong == set()


def test_every_file_that_a_page_names_is_there():
    wrong = {
        (page.name, name)
        for page in PAGES
        for name in quoted(page, rf"({'|'.join(FOLDERS)}|cccd\w*)/[\w./<>-]*")
        if not any(list(folder.glob(re.sub("<[^>]*>", "*", name))) for folder in (ROOT, SCRIPTS))
    }
    assert wrong == set()


def test_nobody_is_told_to_install_somebody_else_s_package():
    # the public registry's "cccd" is another program; ours is `cccd-surfaces`, from the checkout
    folders = (ROOT / name for name in ("docs", "envs", "profiles", "scripts", "workflow"))
    files = [*ROOT.glob("*"), *(path for folder in folders for path in folder.rglob("*"))]
    texts = [path for path in files if path.suffix in TEXTS and path.is_file()]
    told = re.compile(r"pip install\s+(-\S+\s+)*['\"]?cccd\b(?!-)|\bcccd\[")
    assert {path.name for path in texts if told.search(path.read_text(errors="ignore"))} == set()


def test_the_walks_name_their_functions_in_full():
    walks = ROOT / "docs" / "walks.md"
    assert len(quoted(walks, r"cccd(_\w+)?(\.\w+)+")) > 50
    rules = "\n".join(
        path.read_text(encoding="utf-8") for path in (ROOT / "workflow" / "rules").glob("*.smk")
    )
    stages = re.findall(r"\*\*`(\w+)`\*\*", walks.read_text(encoding="utf-8"))
    named = r"rule {0}:|as {0} with|\"{0}\""
    assert {stage for stage in stages if not re.search(named.format(stage), rules)} == set()
