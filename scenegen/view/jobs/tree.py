"""The formulas of a spec as trees for the page: what repeats is folded into one line, and every line knows the nodes of
the core that it stands for, so that values of a scene can be shown beside it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from scenegen.api.fold import Folded, Part
from scenegen.api.outline import Outline
from scenegen.errors import Span
from scenegen.lang.core import Atom, Core, Junction

MOST = 300  # lines of one label
MOST_NODES = 400  # nodes of one line whose values are looked at

Json = dict[str, Any]


class Trees:
    """`trees` maps each label, and `require`, to its tree; `shown` are the nodes whose values the page wants."""

    def __init__(self, outline: Outline) -> None:
        self.core: Core = outline.core
        self.trees: dict[str, Json] = {}
        self.groups: list[tuple[int, ...]] = []  # by the number of a line: the nodes that it stands for
        self.least: list[bool] = []  # whether the smallest of their values counts, or the largest
        folded = Folded(outline)
        for label in outline.labels:
            self.trees[label] = self._tree(folded, folded.root(label))

    def _tree(self, folded: Folded, root: Part) -> Json:
        made = self._line(root, True)
        waiting = [(root, made)]
        count = 1
        while waiting:
            part, line = waiting.pop(0)
            least = self._kind(part) != "one"
            for child in folded.children(part):
                count += 1
                if count > MOST:
                    line["more"] = line.get("more", 0) + 1
                    continue
                below = self._line(child, least)
                line["parts"].append(below)
                waiting.append((child, below))
        return made

    def _kind(self, part: Part) -> str:
        node = self.core.nodes[part.nodes[0]]
        return ("all" if node.kind == "min" else "one") if isinstance(node, Junction) else "atom"

    def _line(self, part: Part, least: bool) -> Json:
        number = len(self.groups)
        self.groups.append(part.nodes[:MOST_NODES])
        self.least.append(least)
        line = part.line
        return {
            "line": number,
            "kind": self._kind(part),
            "text": line.text,
            "margin": line.margin,
            "unit": line.unit,
            "count": part.count,
            "bounds": [line.low, line.high],
            "spans": spans(self.core, part.nodes[0]),
            "parts": [],
        }

    def values(self, values: Sequence[float]) -> list[float]:
        """The value of every line in one scene, given the value of every node."""
        return [
            (min if least else max)(values[node] for node in nodes)
            for nodes, least in zip(self.groups, self.least, strict=True)
        ]


def spans(core: Core, index: int) -> list[list[int]]:
    """Where in the main text an atom stands: its use first, then outwards. Empty where it stands in another file."""
    node = core.nodes[index]
    if not isinstance(node, Atom) or not node.spans:
        return []
    return [[one.start, one.end] for one in own(node.spans)]


def own(found: Sequence[Span]) -> list[Span]:
    """Those places that lie in the text itself: the outermost use always does, unless the label was imported."""
    main = found[-1].source
    return [one for one in found if one.source is main]
