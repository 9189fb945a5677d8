"""Words of our own do not reach people: pages, messages and public docstrings use the field's terms."""

import ast
import inspect
import re
from pathlib import Path

import cccd

ROOT = Path(__file__).parents[2]
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


def test_private_words_are_noticed():
    assert found("what the scan cuts runs on beyond it, beside the others") == ["runs on beyond", "beside"]
    assert found("the job runs on a cluster; `beside` is code") == []


def test_pages_use_the_field_s_words():
    folders = {"": "*.md", "config": "*", "docs": "**/*.md", "workflow": "*.md", "workflow/report": "*.[jr]*"}
    pages = [page for folder, names in folders.items() for page in (ROOT / folder).glob(names)]
    assert len(pages) > 50
    bad = {str(page.relative_to(ROOT)): found(page.read_text(encoding="utf-8")) for page in pages}
    assert {page: words for page, words in bad.items() if words} == {}


def test_messages_use_the_field_s_words():
    paths = SCRIPTS.rglob("*.py")
    bad = {str(path.relative_to(SCRIPTS)): [w for m in messages(path) for w in found(m)] for path in paths}
    assert {path: words for path, words in bad.items() if words} == {}


def test_public_docstrings_use_the_field_s_words():
    bad = {}
    for name in cccd.__all__:
        value = getattr(cccd, name)
        parts = {name: value}
        if inspect.isclass(value):
            parts |= {f"{name}.{part}": member for part, member in vars(value).items() if part[0] != "_"}
        bad |= {
            part: found(inspect.getdoc(member) or "") for part, member in parts.items() if callable(member)
        }
    assert {part: words for part, words in bad.items() if words} == {}
