"""Core formula -> the text of a function in C that computes phi of every label for many scenes."""

from __future__ import annotations

from dataclasses import dataclass

from scenegen.lang.core import Core, read_rows
from scenegen.lang.fold import fold
from scenegen.lang.headings import bare_rows
from scenegen.lang.interpret import Numbers
from scenegen.native.functions import DOUBLE, SINGLE, preamble
from scenegen.native.numbers import Functions, Lines, Number, made
from scenegen.pose import THETA, axis_of, row_count
from scenegen.primitives.namespace import turning

MOST_LINES = 4_000  # operations of a function


@dataclass(frozen=True, slots=True)
class Source:
    """The text of `long phi(const number *const *rows, number *const *phi, long count)`. `rows` are those of the
    storage that it reads, in this order, and `phi` a row for each of the labels. It returns 0, or something else where
    a coordinate was NaN or an angle too large for it, and phi is not to be used."""

    text: str
    rows: tuple[int, ...]
    labels: int


def write(core: Core, *, single: bool) -> Source:
    """The function for float64, or for float32 if `single`. Raises TooLargeError."""
    read = sorted(read_rows(core))
    lines = Lines(MOST_LINES)
    functions = Functions(lines)
    bare = bare_rows(core)
    rows = [Number(lines, f"row{row}") for row in range(row_count(len(core.objects)))]
    for row in bare:
        rows[row] = made(lines, "heading({})", rows[row])
    headings = [rows[row] for row in read if axis_of(row) == THETA]
    values = fold(core.nodes, Numbers(turning(functions, headings), rows))
    results = [made(lines, "{}", values[node]).name for node in core.labels.values()]
    constants = SINGLE if single else DOUBLE
    text = "\n".join(
        (
            preamble(constants),
            "long phi(const number *const *rows, number *const *phi, long count)",
            "{",
            "  bits bad = 0;",
            *(f"  const number *restrict in{row} = rows[{place}];" for place, row in enumerate(read)),
            *(f"  number *restrict out{place} = phi[{place}];" for place in range(len(results))),
            "#pragma omp simd reduction(|: bad)",
            "  for (long i = 0; i < count; i++) {",
            *(f"    number row{row} = in{row}[i];" for row in read),
            *(f"    {line}" for line in lines.lines),
            *(f"    out{place}[i] = {name};" for place, name in enumerate(results)),
            f"    bad |= {_bad([f'row{row}' for row in read], [angle.name for angle in functions.angles])};",
            "  }",
            "  return bad != 0;",
            "}\n",
        )
    )
    return Source(text, tuple(read), len(results))


def _bad(rows: list[str], angles: list[str]) -> str:
    """What says that a row is NaN, or an angle too large (or NaN, too). Two rows take one comparison."""
    rest = [row for row in rows if row not in angles]
    pairs = [f"__builtin_isunordered({a}, {b})" for a, b in zip(rest[::2], [*rest[1::2], *rest[-1:]], strict=False)]
    return " | ".join([*(f"!(FABS({angle}) <= LARGEST)" for angle in angles), *pairs]) or "0"
