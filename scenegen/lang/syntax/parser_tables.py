"""The parser, from tables that were computed ahead of time.

Building an LALR parser from grammar/spec.lark takes Lark a quarter of a second, half of what `scenegen check` may take
in all; reading finished tables takes 10 ms. The tables are JSON beside the grammar, and are used only if they were made
from this very grammar text by this very version of Lark: otherwise the parser is built from the text. `make tables`
rewrites them and a test holds them equal to the grammar. See docs/adr/0001-parser-tables.md.
"""

from __future__ import annotations

import hashlib
import json
from functools import cache
from typing import Any

import lark

from scenegen.resources import grammar_file

TABLES = {False: "spec.tables.json", True: "time.tables.json"}  # without time, and with it
UNBOUNDED = (1 << 32) - 1  # how long a text may be that a terminal matches: from Python 3.11.7 on, Lark says 2^64
_TIMED, _UNTIMED = "//time ", "// untimed\n"  # what marks a line that counts with time only, without time only
_OPTIONS: dict[str, Any] = {"parser": "lalr", "maybe_placeholders": False, "keep_all_tokens": True}


def fingerprint(text: str) -> str:
    """What finished tables must have been made from."""
    return hashlib.sha256(f"lark {lark.__version__}\n{_OPTIONS}\n{text}".encode()).hexdigest()


def build(text: str, **options: Any) -> lark.Lark:
    """The parser of a grammar text, from scratch."""
    return lark.Lark(text, **_OPTIONS, **options)


def serialize(text: str) -> str:
    """The tables of a grammar text as JSON."""
    from lark.grammar import Rule
    from lark.lexer import TerminalDef

    data, memo = build(text).memo_serialize([TerminalDef, Rule])
    data["parser"]["parser"] = _numbered(data["parser"]["parser"])
    for entry in memo.values():
        if "_width" in entry.get("pattern", ()):
            entry["pattern"]["_width"] = [min(width, UNBOUNDED) for width in entry["pattern"]["_width"]]
    tables = {"fingerprint": fingerprint(text), "data": data, "memo": memo}
    return json.dumps(tables, separators=(",", ":"), sort_keys=True, ensure_ascii=True) + "\n"


def _numbered(table: dict[str, Any]) -> dict[str, Any]:
    """The parse table with tokens in alphabetical order and states as they are met from the start.

    Lark numbers both as sets happen to be ordered, which differs from run to run.
    """
    names = table["tokens"]
    moves = {
        state: sorted(((names[token], action) for token, action in row.items()), key=lambda move: str(move[0]))
        for state, row in table["states"].items()
    }
    order = dict.fromkeys(table["start_states"].values())
    queue = list(order)
    for state in queue:
        for _, (kind, argument) in moves[state]:
            if kind == 0 and argument not in order:  # a shift or goto, to that state
                order[argument] = None
                queue.append(argument)
    number = {state: index for index, state in enumerate(order)}
    token = {name: index for index, name in enumerate(sorted(names.values()))}
    return table | {
        "tokens": {index: name for name, index in token.items()},
        "states": {
            number[state]: {
                token[name]: (kind, argument if kind else number[argument]) for name, (kind, argument) in moves[state]
            }
            for state in order
        },
        "start_states": {name: number[state] for name, state in table["start_states"].items()},
        "end_states": {name: number[state] for name, state in table["end_states"].items()},
    }


def _whole_number_keys(pairs: dict[str, Any]) -> dict[Any, Any]:
    """JSON turned Lark's integer keys (parser states, memo entries) into strings."""
    return {int(key) if key.isdigit() else key: value for key, value in pairs.items()}


@cache
def grammar_text(timed: bool) -> str:
    """The grammar of specs without time, or of those with it: some lines of the one file count in one of them only."""
    lines = grammar_file("spec.lark").read_text(encoding="utf-8").splitlines(keepends=True)
    if timed:
        lines = [line for line in lines if not line.endswith(_UNTIMED)]
    return "".join(line.removeprefix(_TIMED) if timed else line for line in lines)


@cache
def _finished(timed: bool) -> Any:
    try:
        raw = grammar_file(TABLES[timed]).read_text(encoding="utf-8")
        tables = json.loads(raw, object_hook=_whole_number_keys)
        return tables if tables["fingerprint"] == fingerprint(grammar_text(timed)) else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def parser(transformer: Any, timed: bool = False) -> lark.Lark:
    """A parser that hands each reduced rule to the method of that name of `transformer`; `timed`, for a spec with
    time."""
    tables = _finished(timed)
    if tables is None:
        return build(grammar_text(timed), transformer=transformer)
    load: Any = lark.Lark._load_from_dict  # what Lark's own standalone parsers call
    loaded: lark.Lark = load(tables["data"], tables["memo"], transformer=transformer)
    return loaded


def main() -> None:
    """Rewrite the tables (`make tables`)."""
    for timed, name in TABLES.items():
        grammar_file(name).write_text(serialize(grammar_text(timed)), encoding="utf-8")


if __name__ == "__main__":
    main()
