"""What a text means, and what is wrong with it: while it is typed; and how rare each phi is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from functools import lru_cache
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from scenegen.api.rarity import LabelRarity, RarityLevel, rarity
from scenegen.api.spec import Spec
from scenegen.editors.lsp.answers import Page, Question, answer
from scenegen.editors.lsp.document import Document
from scenegen.errors import RequestError, SpecError
from scenegen.errors.program import NO_MESSAGE
from scenegen.errors.requests import NO_BOUND_ON_STEPS
from scenegen.lang.spec import CheckedSpec
from scenegen.page.jobs.describe import describe, meshes_of, numbers_data, plain
from scenegen.page.jobs.source import give_way, inside, path_of, run_calmly, spec_of, wanted_counts, with_numbers
from scenegen.resources import grammar_file

FEATURES = ("hover", "completion", "definition", "formatting", "symbols")


def assist(message: dict[str, Any]) -> Iterator[Any]:
    """The answer to one question, as the Language Server Protocol has it."""
    feature = message.get("feature")
    if feature not in FEATURES:
        raise RequestError(NO_MESSAGE(reason="an unknown feature"))
    line, character = int(message.get("line", 0)), int(message.get("character", 0))
    found = answer(page_of(message), Question(str(feature), line, character))
    yield _locate(found, Path(message["root"])) if feature == "definition" and found else found


def _locate(found: dict[str, Any], root: Path) -> dict[str, Any]:
    """A place with what the page can open of it: the `path` of a file in the folder, or whether it is the prelude."""
    file = Path(unquote(urlsplit(found["uri"]).path)).resolve()
    inside = file.is_relative_to(root.resolve())
    return {
        "range": found["range"],
        "name": file.name,
        "path": file.relative_to(root.resolve()).as_posix() if inside else None,
        "prelude": file == grammar_file("prelude.spec").resolve(),
    }


def page_of(message: dict[str, Any]) -> Page:
    """The text of a message as the language server's features take it."""
    path, text, root = path_of(message), str(message["text"]), Path(message["root"])
    if "import" in text:
        return _page(path, text, root)
    return _kept(path, text, root)


def _page(path: Path, text: str, root: Path) -> Page:
    return Page(Document(text, path, root=root), path.as_uri())


_kept = lru_cache(maxsize=2)(_page)


def check(message: dict[str, Any]) -> Iterator[Any]:
    """First what the spec is about (None where it is wrong), then its meshes where the message says which ones the page
    has, then its problems as a language server puts them."""
    page = page_of(message)
    found = page.document.check_result
    described = None
    if isinstance(found, CheckedSpec):
        try:
            family = Spec(found)
            spec, numbers = with_numbers(family, wanted_counts(message))
            described = {**describe(spec), "numbers": numbers_data(family, numbers)}
        except SpecError:  # phi beyond what computers can hold: a problem that the list tells
            described = None
    yield {"spec": described}
    have = message.get("have")
    if described is not None and have is not None and (meshes := meshes_of(spec, set(have))):
        yield {"meshes": meshes}
    # what clashes takes as long to find out as scenes, which somebody waits for
    problems = run_calmly(lambda: answer(page, Question("diagnostics")))
    if described is not None and spec.over_time is not None:
        problems = [*(problems or []), *_unbounded_problems(page, spec)]
    yield {"problems": [{**one, "message": inside(one["message"], message["root"])} for one in problems or []]}


def _unbounded_problems(page: Page, spec: Spec) -> list[dict[str, Any]]:
    """A warning for each object of which nothing says how far it moves in a step: then no motions can be sampled."""
    from scenegen.sampling.motions.scores import unbounded_objects

    assert spec.over_time is not None
    found = []
    for name in unbounded_objects(spec.over_time, *spec.definition.box()):
        told = NO_BOUND_ON_STEPS(name=name)
        places = [one for one in page.document.index.declarations if one.name == name.partition("[")[0]]
        start, end = (places[0].start, places[0].end) if places else (0, 0)
        message = f"{told.title}\nhelp: {told.help}"
        found.append({"range": page.span(start, end), "message": message, "code": told.code, "severity": 2})
    return found


def label_range(message: dict[str, Any]) -> Iterator[Any]:
    """One part per label, in the order of the spec. The labels of a spec over time share most of the work."""
    give_way()
    spec = spec_of(message)
    if spec.over_time is not None:
        yield from map(rarity_data, rarity(spec).labels)
        return
    for label in spec.labels:
        found = rarity(spec, label)
        yield rarity_data(found.labels[0])


def rarity_data(one: LabelRarity) -> dict[str, Any]:
    """The rarity of one label as plain data; logarithms to base 10, None where too few scenes tell."""
    return {
        "label": one.label,
        "bounds": plain(one.bounds),
        "reached": list(one.reached),
        "curve": [_point(level) for level in one.curve],
        "bands": [asdict(band) for band in one.bands],
        "whole": list(one.whole),
    }


def _point(level: RarityLevel) -> list[float | None]:
    return [
        level.phi,
        None if level.above is None else level.above.log10,
        None if level.below is None else level.below.log10,
    ]
