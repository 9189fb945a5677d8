"""Tasks: `nox --list` names them, `nox -s lint` runs one. `.ci/run` does all of it from a bare clone."""

from pathlib import Path

import nox

nox.options.default_venv_backend = "venv"
nox.options.reuse_existing_virtualenvs = True
nox.options.sessions = ["lint", "words", "types", "tests"]

#: The versions of `.ci/run` and `.pre-commit-config.yaml`; a test compares them.
LINTERS = ("ruff==0.17.5", "snakefmt==2.1.0", "codespell==2.4.1", "proselint==0.16.0")
PYRIGHT = "pyright==1.1.414"
UV = "uv==0.13.9"


@nox.session
def lint(session: nox.Session) -> None:
    """Style, formatting, spelling and prose."""
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


@nox.session
def words(session: nox.Session) -> None:
    """Look for words of our own in pages, messages and public docstrings."""
    session.install("-r", "envs/requirements.txt")
    session.run("python", "docs/plain_words.py")


@nox.session
def types(session: nox.Session) -> None:
    """Types, with everything installed that is imported."""
    session.install("-r", "envs/checks.txt", PYRIGHT)
    session.run("pyright")


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
    session.install("build==1.6.1")
    session.run("python", "-m", "build", *session.posargs)


@nox.session
def settings(session: nox.Session) -> None:
    """Write the files that are generated from the settings."""
    session.install("-r", "envs/requirements.txt")
    session.run("python", "docs/settings_pages.py", env={"PYTHONPATH": "scripts"})
