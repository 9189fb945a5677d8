"""Name words of our own that reach people: pages, messages and public docstrings use the field's terms.

`python docs/plain_words.py` prints each place, and fails where there is one.
"""

import ast
import inspect
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SCRIPTS = ROOT / "scripts"

#: What readers stumbled over, and what to write instead.
PRIVATE = {
    r"undrawn": "not annotated",
    r"aslant": "leaning",
    r"regain\w*|giv\w+ back": "shrinkage compensation",
    r"stray(s|ed)?": "outlier",
    r"runs? on (in|beyond|until|into)": "continues, is extended",
    r"goes on|go on": "continues",
    r"(is|are|be|was|were) told|told (of|in|by|apart|from)": "is reported, is distinguished",
    r"tells?": "reports, shows",
    r"says? of": "reports about",
    r"it is (not )?said": "name who reports it",
    r"beside": "next to, compared with",
    r"so (many|far)(?! as)": "the number, the distance",
    r"anew": "again",
    r"nobody (said|says|drew|looked)": "is not given, is not annotated",
}
WORDS = re.compile(r"\b(" + "|".join(PRIVATE) + r")\b", re.IGNORECASE)


def found(text):
    """Private words of a text, code left out."""
    text = re.sub(r"```.*?```|`[^`\n]*`|\]\([^)]*\)", " ", text, flags=re.DOTALL)
    return [match[0] for match in WORDS.finditer(" ".join(text.split()))]


def messages(path):
    """Sentences that a module may print or raise: strings of three words and more, docstrings left out."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    described = (ast.Module, ast.ClassDef, ast.FunctionDef)
    docstrings = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, described) and node.body and isinstance(node.body[0], ast.Expr)
    }
    for node in ast.walk(tree):
        if not isinstance(node, ast.Constant) or not isinstance(node.value, str) or id(node) in docstrings:
            continue
        if node.value.count(" ") >= 2:
            yield node.value


def texts():
    """Yield every page, module's messages and public docstring, and what to call it."""
    folders = {"": "*.md", "config": "*", "docs": "**/*.md", "workflow": "*.md", "workflow/report": "*.[jr]*"}
    for page in (page for folder, names in folders.items() for page in (ROOT / folder).glob(names)):
        yield str(page.relative_to(ROOT)), page.read_text(encoding="utf-8")
    for path in SCRIPTS.rglob("*.py"):
        yield from ((str(path.relative_to(ROOT)), message) for message in messages(path))
    sys.path.insert(0, str(SCRIPTS))
    import cccd

    for name in cccd.__all__:
        value = getattr(cccd, name)
        parts = {name: value}
        if inspect.isclass(value):
            parts |= {f"{name}.{part}": member for part, member in vars(value).items() if part[0] != "_"}
        yield from (
            (part, inspect.getdoc(member) or "") for part, member in parts.items() if callable(member)
        )


def main() -> int:
    """Print the words; 1 where there is one."""
    bad = [f"{place}: {', '.join(words)}" for place, text in texts() if (words := found(text))]
    print(*bad, sep="\n", end="\n" * bool(bad))
    return int(bool(bad))


if __name__ == "__main__":
    sys.exit(main())
