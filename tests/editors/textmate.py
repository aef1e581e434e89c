"""A tokenizer for TextMate grammars, as far as ours goes: match, begin/end, captures, includes from the repository.

It works as editors do: line by line, with a stack of open begin/end rules. At each place the earliest match wins, of
several at one place the one that stands first, the end of the open rule before all. Python's `re` stands in for
Oniguruma, so the grammar keeps to what both understand alike.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from typing import Any

Rule = dict[str, Any]


@dataclass(frozen=True)
class Token:
    text: str
    scopes: tuple[str, ...]


@cache
def _compiled(pattern: str) -> re.Pattern[str]:
    return re.compile(pattern)


class Grammar:
    def __init__(self, grammar: Rule) -> None:
        self.grammar = grammar
        self.repository: dict[str, Rule] = grammar["repository"]

    def _rules(self, patterns: list[Rule]) -> list[Rule]:
        """The rules of a list of patterns, includes and groups without a rule of their own resolved."""
        found: list[Rule] = []
        waiting = list(reversed(patterns))
        while waiting:
            rule = waiting.pop()
            if "include" in rule:
                name = rule["include"]
                rule = self.grammar if name in ("$self", "$base") else self.repository[name.removeprefix("#")]
            if "match" in rule or "begin" in rule:
                found.append(rule)
            else:
                waiting.extend(reversed(rule["patterns"]))
        return found

    def tokenize(self, text: str) -> list[list[Token]]:
        """The tokens of each line."""
        stack: list[Rule] = [self.grammar]
        return [self._line(line + "\n", stack) for line in text.split("\n")]

    def _line(self, line: str, stack: list[Rule]) -> list[Token]:
        out: list[Token] = []
        at = done = 0
        entered: list[tuple[int, int]] = []  # where rules were opened without taking anything, against endless loops

        def emit(end: int, *more: str) -> None:
            nonlocal done
            if end > done:
                outer = [rule["name"] for rule in stack[1:] if "name" in rule]
                out.append(Token(line[done:end], (*outer, *(one for one in more if one))))
                done = end

        while at < len(line):
            top = stack[-1]
            choices: list[tuple[int, int, re.Match[str], Rule | None]] = []
            if "end" in top:
                found = _compiled(top["end"]).search(line, at)
                if found is not None:
                    choices.append((found.start(), -1, found, None))
            for order, rule in enumerate(self._rules(top["patterns"])):
                found = _compiled(rule.get("match") or rule["begin"]).search(line, at)
                if found is not None:
                    choices.append((found.start(), order, found, rule))
            if not choices:
                break
            start, _, found, rule = min(choices, key=lambda one: one[:2])
            emit(start)
            if rule is None:
                self._captures(found, top.get("endCaptures", {}), "", emit)
                stack.pop()
            elif "begin" in rule:
                stack.append(rule)
                self._captures(found, rule.get("beginCaptures", {}), "", emit)
                assert found.end() > start or (start, id(rule)) not in entered, "a rule that opens for ever"
                entered.append((start, id(rule)))
            else:
                assert found.end() > start, f"a match of nothing: {rule['match']}"
                self._captures(found, rule.get("captures", {}), rule.get("name", ""), emit)
            at = found.end()
        emit(len(line))
        return [Token(one.text.rstrip("\n"), one.scopes) for one in out if one.text != "\n"]

    def _captures(self, found: re.Match[str], captures: dict[str, Rule], name: str, emit: Any) -> None:
        """What a match covers, in pieces where its groups have scopes of their own; groups do not nest."""
        whole = captures.get("0", {}).get("name", "")
        for number in sorted(int(key) for key in captures if key != "0"):
            start, end = found.span(number)
            if start >= 0:
                emit(start, name, whole)
                emit(end, name, whole, captures[str(number)]["name"])
        emit(found.end(), name, whole)


def report(lines: list[list[Token]]) -> str:
    """One token a line: its text and its scopes, innermost last; spaces are left out."""
    out: list[str] = []
    for number, tokens in enumerate(lines, start=1):
        for token in tokens:
            if token.text.strip():
                scopes = " ".join(one.removesuffix(".scenegen") for one in token.scopes)
                out.append(f"{number:>3} {token.text:<24} {scopes}".rstrip())
    return "\n".join(out) + "\n"
