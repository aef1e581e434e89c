"""Problems with what a spec says of where things usually are."""

from __future__ import annotations

from scenegen.errors.diagnostic import NEAREST, Kind

NOT_A_DISTRIBUTION = Kind(
    "not-a-distribution",
    (
        "{mixture:?}recorded poses cannot be one of several distributions",
        "{nested:?}a mixture cannot be part of another one",
        "{headings:?}recorded poses are those of things, not of headings alone",
        "{name:?}no distribution is called `{name}`",
        "this is no distribution",
    ),
    ("{mixture:?}", "{nested:?}", "{headings:?}", "expected {expected}"),
    (
        "{mixture:?}let one statement say all of a thing: usually mug ~ poses(...)",
        "{nested:?}write all of its parts in one list, with weights",
        "{headings:?}name the thing alone: usually {thing} ~ poses(...)",
        "{region:?}write uniform({region})",
        NEAREST,
        "write normal((0.4, 0.3), 5 cm), normal(saucer, 3 cm), uniform(left), a mixture [uniform(left): 7, ...: 3] or "
        'poses("logs.csv", 1 cm, 5 deg); of headings normal(NORTH, 10 deg), uniform(80 deg, 100 deg)',
    ),
)
WRONG_PRIOR = Kind(
    "wrong-prior",
    (
        "{held:?}`{held}` is held in place",
        "{mixed:?}a statement is about places or about headings",
        "{twice:?}`{twice}` has two statements about its place",
        "{turned:?}`{turned}` has two statements about its heading",
        "`usually` is about things and their headings",
    ),
    (
        "{held:?}",
        "{mixed:?}this is the other one",
        "{first:?}the other one is at {first}",
        "expected an object, an array or theta(...)",
    ),
    (
        "{held:?}leave out `at` in its declaration, or this statement",
        "{mixed:?}write two statements: usually mug ~ ... and usually theta(mug) ~ ...",
        "{first:?}write a mixture: [normal((0.4, 0.3), 5 cm): 7, normal((0.7, 0.3), 5 cm): 3]",
        "write usually mug ~ normal((0.4, 0.3), 5 cm), or usually theta(mug) ~ normal(NORTH, 10 deg)",
    ),
)
PRIOR_OUTSIDE = Kind(
    "prior-outside",
    (
        "{region:?}`{region}` is outside of where `{thing}` can be",
        "{deviations:?}this is {deviations:.3g} deviations[[{relative:?} or more]] away from where `{thing}` can be",
        "{far:?}this can be more than {far}",
        "none of the {rows:,} recorded rows has all things where they can be",
    ),
    "that is [{left:g}, {right:g}] x [{bottom:g}, {top:g}]",
    (
        "{rows:?}places are in metres, in the frame of the spec's workspace",
        "{far:?}write what is near, such as plate or theta(plate) + 10 deg",
        "say where it usually is on the table; `scenegen check` prints the workspace",
    ),
)
CIRCULAR_PRIOR = Kind(
    "circular-prior",
    (
        "{way:?}these things are relative to each other in a circle",
        "{switch:?}where things usually are cannot depend on which surface is taken",
        "{step:?}where things usually are when a motion begins cannot depend on how they move",
        "`{name}` is relative to itself",
    ),
    "{way}",
    (
        "{way:?}let one of them be relative to nothing: usually {name} ~ normal((0.4, 0.3), 5 cm)",
        "{switch:?}take a number that is the same on all of them",
        "{step:?}take a number of where they are, such as x(mug)",
        "name another thing, or a point; what poses have to fulfil is said by `require`",
    ),
)
WRONG_SPREAD = Kind(
    "wrong-spread",
    (
        "{turn:?}headings cannot turn by more than half a turn in either direction",
        "{wide:?}headings from {low:g} to {high:g} deg are more than a turn",
        "{low:?}there are no headings from {low:g} up to {high:g} deg",
        "{what} is from {least:g} to {most:g} {unit}",
    ),
    ("{turn:?}", "{low:?}", "this one is {width:g} {unit}"),
    (
        "{turn:?}for any heading write 180 deg",
        "{mended:?}counter-clockwise from the first to the second: write uniform({mended})",
        "{low:?}write at most a turn: uniform(0 deg, 360 deg)",
        "what is held is declared: object mug at (0.4, 0.3, NORTH); what is anywhere needs no `usually`",
    ),
)
WRONG_POSES = Kind(
    "wrong-poses",
    (
        "{most:?}{rows:,} rows of poses are more than {most:,}",
        "{given:?}a row has a pose for each of {things:quoted8}",
        "{listed:?}this is no recorded pose",
        "{file} has no recorded poses: {reason}",
        "recorded poses are those of a file",
    ),
    ("{given:?}this one has {given}", "{listed:?}expected {expected}"),
    (
        "{most:?}keep every tenth, or those that differ most",
        "{given:?}write {wanted} of them in each row: [[(0.1, 0.2, 30 deg), (0.3, 0.2, 0)], ...]",
        "{listed:?}write (x, y, theta), in metres and radians: poses([(0.1, 0.2, 30 deg), ...], 1 cm, 5 deg)",
        "{file:?}a row is a scene: columns mug.x, mug.y in metres and mug.theta in radians of every thing",
        'write poses("logs.csv", 1 cm, 5 deg)',
    ),
)
