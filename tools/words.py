"""Check the words of pages, docstrings, comments and messages: python tools/words.py.

The tables list unclear expressions and plain ones in their place. The check fails with the line of each, and for
sentences of pages with more than 60 words.
"""

from __future__ import annotations

import io
import re
import sys
import tokenize
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
EVERYWHERE = {
    r"foret(?:ell|ells|old|elling)": "estimate",
    r"by turns": "alternately",
    r"made anew": "recomputed",
    r"at the prompt": "on the command line",
    r"gives? back": "return",
    r"has it that": "a plain statement",
    r"no number any more": "NaN",
    r"whose way": "a plain statement",
    r"tells": "report, state, show",
    r"(?:is|are) told": "is reported",
    r"(?:is|are) (?:said|asked) (?:of|for)": "a plain statement",
    r"knows": "a plain statement of what is supported",
    r"(?:nobody|somebody)": "a plain statement",
    r"(?:is|are|was|were) looked at": "is read, is evaluated",
    r"at one time": "at the same time",
    r"(?:can|to) be had": "is available",
    r"by itself": "alone",
    r"it is that": "a plain statement",
    r"to the bit": "bit for bit",
}
"""Expressions, and what to write, in pages and in the source."""
ON_PAGES = {
    r"(?:is|are) answered by": "returns",
    r"takes? for granted": "assumes",
}
"""Further ones, on pages alone."""
LONGEST = 60
"""Words of a sentence; lists in parentheses count."""
GENERATED = ("docs/gallery/", "docs/notebooks/", "src/vcc/gallery/")
"""Pages that programs write, and the texts that they are made from."""
_CODE = re.compile(r"^```.*?^```|`[^`\n]*`|<!--.*?-->|^    .*?$|^\|.*?$|https?://\S+", re.M | re.S)


def main() -> int:
    """Print what is found; the exit code is 1 if there is any."""
    pages = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").rglob("*.md"))]
    pages = [page for page in pages if not generated(page)]
    found = [line for page in pages for line in of_page(page)]
    sources = [path for path in sorted((ROOT / "src").rglob("*.py")) if not generated(path)]
    found += [line for path in sources for line in of_source(path)]
    print("\n".join(found) or f"{len(pages)} pages and the source: no words of the list")
    return 1 if found else 0


def generated(path: Path) -> bool:
    """Whether a program writes a page, or writes pages from a source."""
    return path.relative_to(ROOT).as_posix().startswith(GENERATED)


def of_page(path: Path) -> Iterator[str]:
    """What is found on a page, code and tables left out."""
    text = _CODE.sub(lambda block: "\n" * block[0].count("\n"), path.read_text(encoding="utf-8"))
    yield from listed(text, EVERYWHERE | ON_PAGES, path, 1)
    for paragraph in re.finditer(r"(?:^(?!#|\s*[-*] ).+\n)+", text, re.M):
        for sentence in re.split(r"(?<=[.:;?!])\s", paragraph[0]):
            if len(sentence.split()) > LONGEST:
                line = text.count("\n", 0, paragraph.start()) + 1
                yield f"{path.relative_to(ROOT)}:{line}: a sentence of {len(sentence.split())} words"


def of_source(path: Path) -> Iterator[str]:
    """What is found in comments and strings of a module."""
    for token in tokenize.generate_tokens(io.StringIO(path.read_text(encoding="utf-8")).readline):
        if token.type in (tokenize.COMMENT, tokenize.STRING) or token.type == getattr(
            tokenize, "FSTRING_MIDDLE", -1
        ):
            yield from listed(token.string, EVERYWHERE, path, token.start[0])


def listed(text: str, words: dict[str, str], path: Path, first: int) -> Iterator[str]:
    """Each expression of the list, with its line."""
    for expression, instead in words.items():
        for match in re.finditer(rf"\b{expression}\b", text, re.I):
            line = first + text.count("\n", 0, match.start())
            yield f"{path.relative_to(ROOT)}:{line}: {match[0]!r}: write {instead}"


if __name__ == "__main__":
    sys.exit(main())
