#!/usr/bin/env -S uv run --script
# /// script
# dependencies = ["nox"]
# ///
"""What CI runs, by part: nox --list. Each session has a virtual environment of its own, made new.

    pipx run nox           # or: pip install nox && nox
    nox -s lint docs
    nox -s tests -- tests/optics -x

Sessions run the commands of README as they are written there, so that the two cannot differ.
"""

import re
import shutil
from pathlib import Path

import nox

ROOT = Path(__file__).parent
PINNED = ("-c", str(ROOT / "constraints.txt"))
nox.needs_version = ">=2025.2"
nox.options.default_venv_backend = "uv|virtualenv"
nox.options.stop_on_first_error = True


def readme_command(program: str) -> list[str]:
    """The two commands of the line of README that installs this package and runs a program."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    line = re.search(rf"^(pip install .*) && ({program}\b.*)$", text, re.M)
    assert line, f"README has no line that installs and runs {program}"
    return [line[1], line[2]]


def run_line(session: nox.Session, line: str, *more: str) -> None:
    """Run a line of README through the shell, which reads its quotation marks as a user's shell does."""
    session.run("bash", "-c", f'{line} "$@"', "bash", *more, external=True)


@nox.session
def front(session: nox.Session) -> None:
    """Check the types of the bench's front end; the tests compare the module built from it."""
    if shutil.which("npm") is None:
        session.skip("npm is not installed")
    session.chdir(ROOT / "bench" / "front")
    install = ("npm", "ci", "--ignore-scripts", "--no-fund", "--no-audit", "--fetch-retries", "1")
    session.run(*install, "--fetch-timeout", "60000", external=True)
    session.run("npm", "run", "check", external=True)


@nox.session
def tests(session: nox.Session) -> None:
    """Run README's test command; arguments after -- go to pytest."""
    install, test = readme_command("pytest")
    run_line(session, install)
    run_line(session, test, *session.posargs)


@nox.session
def lint(session: nox.Session) -> None:
    """Run ruff, mypy, the style check of the texts and sp-repo-review."""
    groups = nox.project.dependency_groups(nox.project.load_toml(ROOT / "pyproject.toml"), "lint")
    session.install("-e", ".[bench]", "xarray", "anywidget", *groups, *PINNED)
    session.run("ruff", "check", ".")
    session.run("ruff", "format", "--check", ".")
    session.run("mypy")
    session.run("python", "tools/words.py")
    session.run("zizmor", "--offline", "--quiet", ".github")
    session.run("repo-review", ".")


@nox.session
def demo(session: nox.Session) -> None:
    """Run README's first command, in an environment with nothing else."""
    install, demo = readme_command("vcc demo")
    run_line(session, install)
    session.chdir(session.create_tmp())
    run_line(session, demo)


@nox.session
def docs(session: nox.Session) -> None:
    """Build the site with README's command; warnings are errors."""
    install, build = readme_command("mkdocs")
    run_line(session, install)
    run_line(session, build, "--site-dir", str(Path(session.create_tmp()) / "site"))


if __name__ == "__main__":
    nox.main()
