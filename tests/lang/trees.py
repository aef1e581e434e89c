"""Random syntax trees: everything the grammar can say, whether or not it means anything; and trees as text."""

from dataclasses import fields

from hypothesis import strategies as st

from scenegen.lang.syntax import ast
from scenegen.lang.syntax.tokens import KEYWORDS, TEMPORAL

ids = st.one_of(
    st.sampled_from("a b mug plate x theta m cm e5 inside objects _ A1".split()),
    st.from_regex(r"[A-Za-z_][A-Za-z0-9_]{0,6}", fullmatch=True).filter(lambda word: word not in KEYWORDS),
)
names = ids.map(ast.Name)
numbers = st.from_regex(r"[0-9]{1,3}(\.[0-9]{1,3})?([eE][+-]?[0-9])?", fullmatch=True)
quantities = st.builds(ast.Quantity, numbers, st.sampled_from(["", "m", "cm", "mm", "rad", "deg", "turn"]))
texts = st.text(
    st.characters(exclude_characters='"\n\0\v\f\x1c\x1d\x1e\x85\u2028\u2029', exclude_categories=["Cs"]), max_size=6
).map(ast.Text)
leaves = st.one_of(names, quantities, texts, st.booleans().map(ast.Truth), st.just(ast.Name("workspace")))


def tuples(of, least=0, most=3):
    return st.lists(of, min_size=least, max_size=most).map(tuple)


@st.composite
def comparisons(draw, below):
    operands = draw(tuples(below, least=2))
    signs = st.sampled_from(["<=", ">="])
    return ast.Compare(operands, tuple(draw(signs) for _ in operands[1:]))


@st.composite
def weighted(draw, below):
    pairs = draw(tuples(st.tuples(below, below), least=1))
    return ast.Weighted(tuple(one for one, _ in pairs), tuple(weight for _, weight in pairs))


def nodes(below):
    arguments = st.builds(ast.Argument, st.none() | names, below)
    domains = st.one_of(below, st.builds(ast.Range, below, below))
    return st.one_of(
        st.builds(ast.Point, tuples(below, least=2)),
        st.builds(ast.List, tuples(below)),
        weighted(below),
        st.builds(ast.Call, names, tuples(arguments)),
        st.builds(ast.Member, below, names),
        st.builds(ast.Index, below, below),
        st.builds(ast.Negative, below),
        st.builds(ast.Binary, st.sampled_from("+-*/"), below, below),
        comparisons(below),
        st.builds(ast.Not, below),
        st.builds(ast.And, tuples(below, least=2)),
        st.builds(ast.Or, tuples(below, least=2)),
        st.builds(ast.Implies, below, below),
        st.builds(ast.Quantifier, st.sampled_from(["forall", "exists"]), tuples(names, least=1), domains, below),
    )


def operators(below):
    """The ladder alone: where parentheses are needed, and where not."""
    return st.one_of(
        st.builds(ast.Negative, below),
        st.builds(ast.Binary, st.sampled_from("+-*/"), below, below),
        st.builds(ast.Compare, st.tuples(below, below), st.just(("<=",))),
        st.builds(ast.Not, below),
        st.builds(ast.And, st.tuples(below, below)),
        st.builds(ast.Or, st.tuples(below, below)),
        st.builds(ast.Implies, below, below),
    )


expressions = st.recursive(leaves, nodes, max_leaves=12)
ladders = st.recursive(st.just(ast.Name("a")), operators, max_leaves=8)
small = st.recursive(leaves, nodes, max_leaves=4)
intervals = st.builds(ast.Interval, small, small)
declarations = st.builds(ast.Declaration, names, *[st.none() | small] * 3)
parameters = st.builds(ast.Parameter, names, st.none() | small)
drawn = st.one_of(
    names,
    st.builds(ast.Index, names, small),
    st.builds(ast.Call, names, tuples(st.builds(ast.Argument, st.none() | names, small))),
)
statements = st.one_of(
    st.builds(ast.Workspace, intervals, intervals),
    st.builds(ast.Objects, tuples(declarations, least=1)),
    st.builds(ast.Region, names, small),
    st.builds(ast.Constant, names, small),
    st.builds(ast.Usually, tuples(drawn, least=1), small),
    st.builds(ast.Definition, names, tuples(parameters), small),
    st.builds(ast.Require, small),
    st.builds(ast.Import, texts),
    st.builds(ast.Label, names, small),
)

# ---- with time: its words are no names there
timed_ids = ids.filter(lambda word: word not in TEMPORAL)
windows = st.none() | st.builds(ast.Interval, quantities, quantities)


def over_time(below):
    """The ladder with the operators of time."""
    words = st.sampled_from(["always", "eventually"])
    return st.one_of(
        operators(below),
        st.builds(ast.Temporal, words, windows, below),
        st.builds(ast.Temporal, st.sampled_from(["next", "initially", "finally"]), st.none(), below),
        st.builds(ast.Until, st.sampled_from(["until", "until_with"]), windows, below, below),
        st.builds(ast.Quantifier, st.just("forall"), st.just((ast.Name("p"),)), st.just(ast.Name("objects")), below),
    )


timed_ladders = st.recursive(st.just(ast.Name("a")), over_time, max_leaves=8)
rates = st.builds(ast.Quantity, numbers, st.sampled_from(["s", "ms", "min", "m/s", "cm/s", "deg/s", "rad/s", "turn/s"]))
timed_statements = st.one_of(
    st.builds(ast.Label, timed_ids.map(ast.Name), timed_ladders),
    st.builds(ast.Require, timed_ladders),
    st.builds(ast.Moves, st.sampled_from(["one", "all"]).map(ast.Name)),
    st.builds(ast.Constant, timed_ids.map(ast.Name), rates),
)
horizons = st.one_of(
    st.builds(ast.Time, quantities, st.just(ast.Name("steps"))),
    st.builds(ast.Time, rates, st.none(), st.builds(ast.Interval, rates, rates)),
)


def dump(module: ast.Module, *, places: bool = False) -> str:
    """The tree, one node a line, indented; with `places`, each node's character range. For golden files."""
    out: list[str] = []
    roots: list[ast.Node] = list(module.statements) if module.bare is None else [module.bare]
    stack: list[tuple[ast.Node, int, str]] = [(node, 0, "") for node in reversed(roots)]
    while stack:
        node, depth, role = stack.pop()
        below: list[tuple[ast.Node, int, str]] = []
        words = [type(node).__name__]
        for item in fields(node):
            value = getattr(node, item.name)
            if item.name in ("start", "end"):
                continue
            if isinstance(value, ast.Node):
                below.append((value, depth + 1, item.name))
            elif isinstance(value, tuple) and any(isinstance(part, ast.Node) for part in value):
                below.extend((part, depth + 1, item.name) for part in value)
            elif value is not None and value != ():
                words.append(
                    " ".join(value)
                    if isinstance(value, tuple)
                    else repr(value)
                    if isinstance(value, str)
                    else str(value)
                )
        where = f" @{node.start}-{node.end}" if places else ""
        out.append("  " * depth + (f"{role}: " if role else "") + " ".join(words) + where)
        stack.extend(reversed(below))
    return "\n".join(out) + "\n"
