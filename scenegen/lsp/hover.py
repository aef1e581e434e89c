"""Hover texts for the place under the cursor, in Markdown."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from scenegen.lang import ast
from scenegen.lang.print import print_expr
from scenegen.lang.tokens import KEYWORDS as RESERVED
from scenegen.lang.tokens import Token
from scenegen.lsp import facts, vocabulary
from scenegen.lsp.document import Document
from scenegen.lsp.expand import Extent, extents, of_constant
from scenegen.lsp.names import Binding, Occurrence
from scenegen.primitives.units import ANGLE, LENGTH, quantity

LONGEST = 80  # characters of a formula that a hover repeats


@dataclass(frozen=True, slots=True)
class Hover:
    """Markdown about characters `start` to `end`."""

    markdown: str
    start: int
    end: int


def hover(document: Document, offset: int) -> Hover | None:
    """The meaning of the name or sign at an offset, and the values of the formula around it; None if there is
    nothing."""
    token = _token(document, offset)
    if token is None:
        return None
    found = next((one for one in document.index.between(token.start, token.end) if one.start == token.start), None)
    around = extents(document, _place(document, token, found))
    parts = _about_name(document, found, around) if found is not None else _about_token(token)
    start, end = token.start, token.end
    formula = next((one for one in around if one.kind == "formula"), None)
    if found is not None and found.role == "declaration" and found.local is not None and found.local.kind == "label":
        formula = next((one for one in reversed(around) if one.kind == "formula"), None)
        parts += [_phi(formula)] if formula is not None else []
    elif formula is not None and not (found is not None and found.role == "declaration"):
        parts.append(_phi(formula, written=formula.node.start < start or formula.node.end > end))
        if found is None and token.text not in RESERVED and token.kind != "number":
            start, end = formula.node.start, formula.node.end
    return Hover("\n\n".join(parts), start, end) if parts else None


def _token(document: Document, offset: int) -> Token | None:
    """The token at an offset, or else the name or number that ends there."""
    statement = document.index.statement(offset)
    touching = [one for one in statement.tokens if one.start <= offset <= one.end] if statement is not None else []
    under = next((one for one in touching if offset < one.end), None)
    return under or next((one for one in touching if one.kind in ("name", "number")), None)


def _place(document: Document, token: Token, found: Occurrence | None) -> int:
    """The offset whose expressions are of interest: of a label its formula."""
    if found is not None and found.role == "declaration" and found.local is not None and found.local.kind == "label":
        statement = document.index.statement(token.start)
        if statement is not None and len(statement.tokens) > 2:
            return statement.tokens[2].start
    return token.start


# ---- names


def _about_name(document: Document, found: Occurrence, around: Sequence[Extent]) -> list[str]:
    binding = document.meaning(found)
    own = next((one for one in around if _stands_for(one.node, found)), None)
    value = [_number(own)] if own is not None and own.kind != "formula" else []
    match found.role:
        case "member" if found.name in vocabulary.MEMBERS:
            return [f"`.{found.name}`: {vocabulary.MEMBERS[found.name]}", *value]
        case "asset":
            return [f"**asset** `{found.name}`", facts.asset(found.name)]
        case "value" if binding is None and found.name in vocabulary.BUILT_IN:
            facts_ = facts.workspace(document) if found.name == "workspace" else facts.objects(document)
            return [f"**built in** `{found.name}`: {vocabulary.BUILT_IN[found.name]}", facts_]
        case "call" if binding is None and found.name in vocabulary.functions():
            usage, meaning = vocabulary.functions()[found.name]
            return [_code(usage), meaning, *value]
        case _:
            return _about(document, binding, value) if binding is not None else []


def _stands_for(node: ast.Expr, found: Occurrence) -> bool:
    """Whether the name is the head of the expression: the name itself, the function of a call, the member behind a
    dot."""
    match node:
        case ast.Call(function):
            return function.start == found.start
        case ast.Member(_, member):
            return member.start == found.start
        case _:
            return isinstance(node, ast.Name) and node.start <= found.start and found.end <= node.end


def _about(document: Document, binding: Binding, value: list[str]) -> list[str]:
    told = [vocabulary.remark(binding)] if binding.kind not in ("parameter", "variable") else []
    told = [words for words in told if words]
    written = _shortened(" ".join(binding.source.text[binding.opens : binding.closes].split()))
    match binding.kind:
        case "definition":
            usage, formula = vocabulary.usage(binding)
            where = "" if binding.source is document.source else f"\n\n*{binding.source.name}*"
            return [_code(usage), *told, f"= `{_shortened(formula)}`{where}", *value]
        case "object":
            what = "array" if binding.is_array else "object"
            note = " (not declared: inferred from its use)" if binding.inferred else ""
            return [f"**{what}** `{binding.name}`{note}", *told, facts.thing(document, binding)]
        case "constant":
            extent = of_constant(document, binding.name)
            return [_code(written), *told, *([_number(extent)] if extent is not None else value)]
        case "region":
            return [_code(written), *told, *facts.region(document, binding.name)]
        case "label":
            return [f"**label** `{binding.name}`", *told]
        case "parameter":
            return [f"**parameter** `{written}` of `{binding.owner}`", *value]
        case "variable":
            colon = binding.source.text.find(":", binding.closes)
            quantifier = " ".join(binding.source.text[binding.opens : colon].split())
            return [f"**variable** `{binding.name}` of `{_shortened(quantifier)}`", *value]


def _about_token(token: Token) -> list[str]:
    if token.text in vocabulary.KEYWORDS:
        return [f"**{token.text}**: {vocabulary.KEYWORDS[token.text]}"]
    if token.kind == "number":
        number = token.text.rstrip("acdegmnrtu").rstrip()
        suffix = token.text[len(number) :].strip()
        amount, unit = quantity(number, suffix)
        if unit == ANGLE:
            return [f"{token.text} = {amount:.6g} rad = {math.degrees(amount):.6g} deg"]
        return [f"{token.text} = {amount:.6g} m"] if unit == LENGTH and suffix != "m" else []
    return []


# ---- numbers


def _phi(extent: Extent, written: bool = False) -> str:
    ((low, high),) = extent.intervals
    of = f" of `{_shortened(print_expr(extent.node))}`" if written else ""
    if low == high and math.isinf(low):
        return f"phi{of}: {'holds' if low > 0 else 'fails'} in every scene"
    unit = f" {extent.unit}" if extent.unit is not None and str(extent.unit) else ""
    uses = f", over {extent.count} uses" if extent.count > 1 else ""
    verdict = ", never satisfied" if high < 0.0 else ", always satisfied" if low >= 0.0 else ""
    return f"phi{of} in [{low:.4g}, {high:.4g}]{unit}{uses}{verdict}"


def _number(extent: Extent) -> str:
    unit = f" {extent.unit}" if extent.unit is not None and str(extent.unit) else ""
    texts = [f"{low:.6g}" if low == high else f"[{low:.4g}, {high:.4g}]" for low, high in extent.intervals]
    uses = f", over {extent.count} uses" if extent.count > 1 else ""
    if extent.kind == "point":
        return f"= ({', '.join(texts)}){unit}{uses}"
    constant = all(low == high for low, high in extent.intervals)
    degrees = f" = {math.degrees(extent.intervals[0][0]):.6g} deg" if constant and extent.unit == ANGLE else ""
    return f"{'=' if constant else 'in'} {texts[0]}{unit}{degrees}{uses}"


def _code(text: str) -> str:
    return f"```spec\n{text}\n```"


def _shortened(text: str) -> str:
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."
