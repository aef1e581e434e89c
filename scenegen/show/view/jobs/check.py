"""What a text means, and what is wrong with it: while it is typed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from scenegen.api.spec import Spec
from scenegen.editors.lsp.answers import Page, Question, answer
from scenegen.errors import SpecError
from scenegen.errors.time import NO_BOUND_ON_STEPS
from scenegen.lang.spec import CheckedSpec
from scenegen.show.view.jobs.assist import page_of
from scenegen.show.view.jobs.describe import describe, numbers_data
from scenegen.show.view.jobs.meshes import meshes_of
from scenegen.show.view.jobs.source import calmly, inside, wanted_counts, with_numbers


def check(message: dict[str, Any]) -> Iterator[Any]:
    """First what the spec is about (None where it is wrong), then its meshes where the message says which ones the page
    has, then its problems as a language server puts them."""
    page = page_of(message)
    found = page.document.checked
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
    problems = calmly(lambda: answer(page, Question("diagnostics")))
    if described is not None and spec.over_time is not None:
        problems = [*(problems or []), *_unbounded(page, spec)]
    yield {"problems": [{**one, "message": inside(one["message"], message["root"])} for one in problems or []]}


def _unbounded(page: Page, spec: Spec) -> list[dict[str, Any]]:
    """A warning for each object of which nothing says how far it moves in a step: then no motions can be sampled."""
    from scenegen.sampling.motions.scores import unbounded

    assert spec.over_time is not None
    found = []
    for name in unbounded(spec.over_time, *spec.declared.box()):
        told = NO_BOUND_ON_STEPS(name=name)
        places = [one for one in page.document.index.declarations if one.name == name.partition("[")[0]]
        start, end = (places[0].start, places[0].end) if places else (0, 0)
        message = f"{told.title}\nhelp: {told.help}"
        found.append({"range": page.span(start, end), "message": message, "code": told.code, "severity": 2})
    return found
