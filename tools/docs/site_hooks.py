"""What the site needs beyond its pages: links to files outside docs/, folders in the navigation, commands' help.

MkDocs calls these functions by their names; mkdocs.yml names this file.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files, InclusionLevel
from mkdocs.structure.pages import Page

from vcc.cli.app import COMMANDS, RENDERERS, ZOO, app, documented

ROOT = Path(__file__).parents[2]
ELSEWHERE = "repository"
"""The site's folder for files of the repository that pages link to."""
COMMAND_LINE = "<!-- the command line's help -->"
WIDEST_COMMAND = 90
"""Characters of a line of shell on the page of commands."""
_LINK = re.compile(r"(\]\()([^)\s]+)(\))")


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """List pages of a folder in the navigation: ``gallery/`` is its index, then all in that one's order."""
    for entry in config.nav or []:
        for title, target in entry.items():
            if isinstance(target, str) and target.endswith("/"):
                entry[title] = [target + name for name in _pages(ROOT / "docs" / target)]
    return config


def _pages(folder: Path) -> list[str]:
    linked = [target for _, target, _ in _LINK.findall((folder / "index.md").read_text(encoding="utf-8"))]
    order = ["index.md", *linked]
    names = sorted(path.name for path in folder.glob("*.md"))
    return sorted(names, key=lambda name: order.index(name) if name in order else len(order))


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the files outside docs/ that pages link to, and what those link to in turn."""
    waiting = [(file.src_uri, Path(file.abs_src_path or "")) for file in files.documentation_pages()]
    waiting += [(f"{ELSEWHERE}/{name}", ROOT / name) for name in ("CHANGELOG.md", "CONTRIBUTING.md")]
    while waiting:
        uri, path = waiting.pop()
        if uri not in files.src_uris:
            files.append(_outside(config, uri))
        if path.suffix != ".md":
            continue
        for _, target, _ in _LINK.findall(_without_code(path.read_text(encoding="utf-8"))):
            found = _on_site(uri, target)
            if found and found.startswith(ELSEWHERE) and found not in files.src_uris:
                waiting.append((found, _in_repository(found)))
    return files


def on_page_markdown(markdown: str, *, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Point links that leave docs/ to their copies on the site, and put in the command line's help."""
    here = page.file.src_uri

    def pointed(match: re.Match[str]) -> str:
        before, target, after = match.groups()
        found = _on_site(here, target)
        if found is None:
            return match[0]
        _, mark, heading = target.partition("#")
        return before + posixpath.relpath(found, posixpath.dirname(here) or ".") + mark + heading + after

    markdown = _LINK.sub(pointed, markdown)
    return markdown.replace(COMMAND_LINE, _command_line()) if COMMAND_LINE in markdown else markdown


def _outside(config: MkDocsConfig, uri: str) -> File:
    path = _in_repository(uri)
    content: str | bytes = path.read_text(encoding="utf-8") if path.suffix == ".md" else path.read_bytes()
    file = File.generated(config, uri, content=content)
    file.inclusion = InclusionLevel.INCLUDED
    return file


def _in_repository(uri: str) -> Path:
    """The file that is shown at a place of the site."""
    inside = uri.removeprefix(f"{ELSEWHERE}/")
    return ROOT / inside if inside != uri else ROOT / "docs" / uri


def _on_site(here: str, target: str) -> str | None:
    """Where on the site a relative link leads that leaves docs/, or comes from outside; None for all others."""
    file = target.partition("#")[0]
    if not file or "://" in target or target.startswith("mailto:"):
        return None
    path = posixpath.normpath(posixpath.join(_in_repository(here).relative_to(ROOT).parent.as_posix(), file))
    comes_from_outside = here.startswith(f"{ELSEWHERE}/")
    if path.startswith("docs/"):
        return path.removeprefix("docs/") if comes_from_outside else None
    return f"{ELSEWHERE}/{path}"


def _without_code(text: str) -> str:
    return re.sub(r"^```.*?^```", "", text, flags=re.M | re.S)


def _command_line() -> str:
    """Help on every command, as Markdown by cyclopts itself, with the examples that it leaves out."""
    text = app.generate_docs(output_format="markdown")
    contents, commands = text.index("## Table of Contents"), text.index("**Commands**")  # the site has its own
    text = text[text.index("\n") : contents] + text[commands:]  # and the page its title
    text = re.sub(r"^(#+ vcc --([\w-]+))$", r"\1 {#vcc-\2}", text, flags=re.M)  # what it links to
    for group, listed in (("vcc", COMMANDS), ("vcc synth", RENDERERS), ("vcc zoo", ZOO)):
        for name in listed:
            _, examples = documented(f"vcc.cli{group[3:].replace(' ', '.')}", name)
            usage = re.compile(rf"```console\n{group} {name}[ \n].*?```\n", re.DOTALL)
            shown = "\nFor example:\n\n```\n" + "\n".join(map(_broken, examples)) + "\n```\n"
            text = usage.sub(lambda found, shown=shown: found[0] + shown, text, count=1)
    return text


def _broken(command: str) -> str:
    """A command on lines that a page has room for, broken before options."""
    first, *options = re.split(r" (?=--?[a-z])", command)
    lines = [first]
    for option in options:
        if len(lines[-1]) + len(option) > WIDEST_COMMAND:
            lines.append(f"    {option}")
        else:
            lines[-1] += f" {option}"
    return " \\\n".join(lines)
