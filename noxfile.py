"""Tasks: `nox --list` names them, `nox -s lint` runs one.

`.ci/run`, pre-commit and GitHub's actions call them.
"""

from pathlib import Path

import nox

nox.options.default_venv_backend = "venv"
nox.options.reuse_existing_virtualenvs = True
nox.options.sessions = ["lint", "words", "rules", "types", "tests"]

LINTERS = (
    "ruff==0.17.5",
    "snakefmt==2.1.0",
    "codespell==2.4.1",
    "proselint==0.16.0",
    "check-jsonschema==0.39.0",
)
PYRIGHT = "pyright==1.1.414"
UV = "uv==0.13.9"
#: Files whose form others have laid down, by the name of its schema.
SCHEMAS = {
    "github-workflows": sorted(Path(".github/workflows").glob("*.yml")),
    "github-issue-forms": [Path(f".github/ISSUE_TEMPLATE/{name}.yml") for name in ("bug", "wish")],
    "dependabot": [Path(".github/dependabot.yml")],
    "citation-file-format": [Path("CITATION.cff")],
}


@nox.session
def lint(session: nox.Session) -> None:
    """Style, formatting, spelling, prose, and files with a schema."""
    session.install(*LINTERS)
    session.run("ruff", "check", ".")
    session.run("ruff", "format", "--check", ".")
    session.run("snakefmt", "--check", "Snakefile", "workflow")
    session.run("codespell")
    pages = [
        *Path().glob("*.md"),
        *Path("docs").glob("*.md"),
        "config/README.md",
        "docs/gallery",
        "docs/joss",
    ]
    session.run("proselint", "check", *map(str, pages))
    for schema, paths in SCHEMAS.items():
        session.run("check-jsonschema", "--builtin-schema", schema, *map(str, paths))


@nox.session
def words(session: nox.Session) -> None:
    """Look for words of our own in pages, messages and public docstrings."""
    session.install("-r", "envs/requirements.txt")
    session.run("python", "docs/plain_words.py")


@nox.session
def rules(session: nox.Session) -> None:
    """Snakemake's own linter."""
    session.install("-r", "envs/requirements.txt")
    session.run("snakemake", "--lint")


@nox.session
def types(session: nox.Session) -> None:
    """Types: `nox -s types -- --pythonpath PYTHON` takes an environment that has all of envs/checks.txt."""
    session.install(PYRIGHT, *([] if session.posargs else ["-r", "envs/checks.txt"]))
    session.run("pyright", *session.posargs)


@nox.session(venv_backend="none")
def audit(session: nox.Session) -> None:
    """Known vulnerabilities in what is pinned."""
    session.run(".ci/audit")


@nox.session
def tests(session: nox.Session) -> None:
    """All tests: `nox -s tests -- tests/unit` runs some."""
    session.install("-r", "envs/checks.txt")
    session.run("pytest", *session.posargs)


@nox.session
def lowest(session: nox.Session) -> None:
    """Make a surface and run some tests with the lowest versions that are declared."""
    session.install(UV)
    session.run(".ci/lowest", external=True)


@nox.session
def docs(session: nox.Session) -> None:
    """Build the documentation site into the folder ``site``."""
    session.install("-r", "envs/docs.txt")
    session.run("mkdocs", "build", "--strict", *session.posargs)


@nox.session
def wheel(session: nox.Session) -> None:
    """Build the wheel and the source archive into the folder ``dist``."""
    session.install("build==1.6.1", "twine==7.0.0")
    session.run("python", "-m", "build", *session.posargs)
    session.run("twine", "check", "--strict", *map(str, Path("dist").glob("*")))


@nox.session
def settings(session: nox.Session) -> None:
    """Write the files that are generated from the settings."""
    session.install("-r", "envs/requirements.txt")
    session.run("python", "docs/settings_pages.py", env={"PYTHONPATH": "scripts"})
