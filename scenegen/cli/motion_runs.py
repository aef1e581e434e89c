"""`scenegen sample` of a spec over time: motions."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from scenegen.errors.motions import NOT_FOR_MOTIONS
from scenegen.formats.locations import names_set

if TYPE_CHECKING:
    from scenegen.api.motions import MotionSet
    from scenegen.api.spec import Spec
    from scenegen.processes.reserve import Reserve
    from scenegen.sampling.request import SampleRequest


def sample_motions(
    spec: Spec,
    request: SampleRequest,
    source: Path,
    out: str | None,
    refused: Mapping[str, object],
    render: Path | None,
    reserve: Reserve,
) -> None:
    """`refused` are options that only scenes have, with their values. Raises what the API raises, RequestError for
    one of those that is given, and OutputError for places that cannot be written to."""
    from scenegen.api.motions import draw_motions
    from scenegen.cli.output import complain, detail, print_error
    from scenegen.cli.streams import check_output, write_data
    from scenegen.errors import RequestError
    from scenegen.formats.files import check_folder, check_writable
    from scenegen.formats.motions.table import format_of
    from scenegen.needs import need

    given = {**refused, "out": out is not None and names_set(out)}
    for argument, value in given.items():
        if value:
            raise RequestError(NOT_FOR_MOTIONS(argument=argument, value=out if argument == "out" else None))
    path = None if out is None else Path(out)
    if path is None:
        check_output()
    else:
        format_of(path)
        check_writable(path, source)
    if render is not None:
        check_folder(render, path)
        need("pybullet", "to draw pictures")
    found = draw_motions(spec, request, reserve=reserve)
    complain(*found.warnings)
    detail(f"sampled {len(found)} motions")
    if path is None:
        write_data(found.dump())
    else:
        found.save(path)
    print_error(summary(found, path))
    if render is not None:
        made = found.figures(render, "gif", "strip")
        print_error(f"drew {len(made)} figures in {render}")


def summary(found: MotionSet, path: Path | None) -> str:
    """What was drawn, and where it is."""
    info = found.header.sampler
    ranges = ", ".join(f"{name} {min(values):.4g} .. {max(values):.4g}" for name, values in found.phi.items())
    rare = info.get("log10_probability")
    drawn = str(info["method"]) + ("" if rare is None else f"; log10 of their probability {rare:.2f}")
    share = info.get("effective_share")
    if share is not None and share < 1.0:
        drawn += f"; worth about {max(1, round(share * len(found))):,} independent ones"
    what = "motion" if len(found) == 1 else "motions"
    return f"{len(found):,} {what}{'' if path is None else f' in {path}'}: phi of {ranges} ({drawn})"
