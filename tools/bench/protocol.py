"""Write ``bench/front/src/protocol.ts`` from the records of `vcc.bench.messages`.

python tools/bench/protocol.py            # writes the file
python tools/bench/protocol.py --print    # prints it instead
"""

from __future__ import annotations

import argparse
import inspect
import re
import types
import typing
from pathlib import Path
from typing import Any

from vcc.bench import messages

TARGET = Path(__file__).parents[2] / "bench" / "front" / "src" / "protocol.ts"
HEAD = """/** Written by tools/bench/protocol.py from vcc/bench/messages.py: change that. */

export type Value = null | boolean | number | string | Value[] | { [name: string]: Value };
export type Table = { [name: string]: Value };
/** A path in the document, without "camera": ["elements", 0, "z"]. */
export type Where = (string | number)[];
"""
PLAIN = {int: "number", float: "number", str: "string", bool: "boolean", type(None): "null", Any: "Value"}


def as_typescript(hint: Any) -> str:
    """The TypeScript type of a Python type."""
    origin, inside = typing.get_origin(hint), typing.get_args(hint)
    if hint in PLAIN:
        return PLAIN[hint]
    if typing.is_typeddict(hint):
        return str(hint.__name__)
    if origin is typing.Literal:
        return " | ".join(f'"{each}"' for each in inside)
    if origin in (typing.Union, types.UnionType):
        return " | ".join(as_typescript(each) for each in inside)
    if origin is list:
        one = as_typescript(inside[0])
        return f"({one})[]" if "|" in one else f"{one}[]"
    if origin is tuple:
        return f"[{', '.join(map(as_typescript, inside))}]"
    if origin is dict:
        return "Table" if inside == (str, Any) else f"{{ [name: string]: {as_typescript(inside[1])} }}"
    raise TypeError(f"no TypeScript type for {hint}")


def interface(record: Any) -> str:
    """A record as an interface, with its docstring."""
    hints = typing.get_type_hints(record, vars(messages), include_extras=True)
    lines, words = [], _words_of_fields(record)
    for name, hint in hints.items():
        optional = typing.get_origin(hint) is typing.NotRequired
        inner = typing.get_args(hint)[0] if optional else hint
        if name in words:
            lines.append(f"  /** {words[name][:1].upper()}{words[name][1:]} */")
        lines.append(f"  {name}{'?' if optional else ''}: {as_typescript(inner)};")
    summary = (inspect.getdoc(record) or "").split("\n\n", maxsplit=1)[0].replace("\n", " ").replace("``", "`")
    return f"/** {summary} */\nexport interface {record.__name__} {{\n" + "\n".join(lines) + "\n}\n"


def _words_of_fields(record: Any) -> dict[str, str]:
    said = (inspect.getdoc(record) or "").partition("\nArgs:\n")[2]
    entries = re.split(r"\n    (?=\w+: )", "\n" + said)[1:]
    return {name: " ".join(words.split()) for name, words in (entry.split(": ", 1) for entry in entries)}


def protocol() -> str:
    """The whole file."""
    records = [each for each in vars(messages).values() if typing.is_typeddict(each)]
    union = [
        *(f'  | ({{ is: "{name}" }} & {record.__name__})' for name, record in messages.FROM_BENCH.items()),
        "  | Answer",
    ]
    answers = [
        f'  | {{ is: "answer"; what: "{what}" }} & {record.__name__}' for what, record in messages.ANSWERS.items()
    ]
    return "\n".join(
        [
            HEAD,
            *map(interface, records),
            "export type Answer =\n" + "\n".join(answers) + ";\n",
            "export type FromHost =\n" + "\n".join(union) + ";\n",
        ]
    )


def main() -> None:
    """Write the file, or print it."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--print", action="store_true", help="print it instead")
    if asked.parse_args().print:
        print(protocol(), end="")
    else:
        TARGET.write_text(protocol(), encoding="utf-8")


if __name__ == "__main__":
    main()
