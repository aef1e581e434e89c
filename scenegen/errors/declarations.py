"""Problems with what a spec declares and states: objects, regions, supports, labels, requirements."""

from __future__ import annotations

from scenegen.errors.diagnostic import NEAREST, Kind

# objects and regions
BARE_NUMBER = "a bare number is in {unit}: write {number} {small}, or {number} {large} if you mean it"

NO_OBJECTS = Kind("no-objects", "there are no objects", "none is declared", "declare them: object mug, plate")
TOO_MANY_OBJECTS = Kind("too-many-objects", "more than {limit:,} objects", help="declare fewer")
EMPTY_ARRAY = Kind("empty-array", "an array cannot have {count} elements", "it has one or more", "{instead}")
UNKNOWN_ASSET = Kind(
    "unknown-asset",
    (
        "{asset:?}{path} has no asset `{name}`",
        "no asset of {path} has the category `{name}`",
        "the library has no `{name}`",
    ),
    help=(
        NEAREST,
        "it has {some:list}[[ and {more:,} more]]",
        "{path:?}it has {known:list}",
        '{path:?}write category = "{name}" below the assets that have it',
        "the library has {known:list}",
    ),
)
STANDS_IN = Kind(
    "stands-in",
    "the library has no `{name}`: a block of 5 cm stands in for it",
    "",
    (
        "{inferred:?}did you mean `{meant}`?",
        "did you mean `{meant}`? if the name is right, give it a shape: object {name} = {meant}",
    ),
    severity="warning",
)
NOT_A_SHAPE = Kind(
    "not-a-shape",
    ("{path:?}this is no outline", "{usages:?}this is no shape", "this is no region"),
    ("{path:?}", "{usages:?}expected what the object looks like", "expected a shape with its place"),
    (
        'write {kind}("{path}", box(length, width, height))',
        NEAREST,
        "write the name of an asset, or {usages}",
        "write rect(left, bottom, right, top), circle((x, y), radius) or polygon([(x, y), ...])",
    ),
)
UNKNOWN_ARM = Kind(
    "unknown-arm",
    ("no arm `{name}` comes along", "it is not said which arm this is"),
    help='write the name of an arm that comes along: {known:list}, or that of a file: arm("my_arm.toml")',
)
UNUSABLE_ARM = Kind("unusable-arm", "{path} is no arm: {reason}", help="`scenegen explain arms` has the format")
FILE_WITHOUT_QUOTES = Kind("file-without-quotes", "{what} is named in double quotes", help="write {usage}")
UNLIKELY_SHAPE = Kind(
    "unlikely-shape",
    (
        "{path} measures {size:,.3g} m",
        "this measures {largest:,.4g} m",
        "{path} lies {distance:,.3g} m from its origin, which is where the object is",
    ),
    help=(
        "a bare number is in metres: write {mended}, or {written} m if you mean it",
        "if its numbers are centimetres, {remedy}",
        'poses are those of the origin: move the mesh to it, or write asset("NAME") with center = true in assets.toml',
    ),
    severity="note",
)
UNUSABLE_SHAPE_FILE = Kind(
    "unusable-shape-file",
    ("`{name}` would measure {size:.3g} m", "{path} cannot be used: {reason}"),
    help=("{hint}", "`scale` in the index is how many metres a unit of its file is{size:?}"),
)
ASSET_INDEX = Kind(
    "asset-index",
    ("{path} cannot be used: {reason}", "there is no {path}"),
    ("{reason:?}", "this asset is looked up in it"),
    (
        "`scenegen explain assets` shows what an index has{reason:?}",
        '`scenegen explain assets` shows how to write one; of an index in a folder write asset("folder/{name}")',
    ),
)
SIZE_OUT_OF_RANGE = Kind(
    "size-out-of-range",
    (
        "{what} cannot be {size:g} m",
        "a region cannot be {level:g} m above the table",
        "{what} is too far out",
    ),
    (
        "sizes lie between {least:g} and {most:,.0f} m",
        "heights lie between 0 and {most:,.0f} m",
        "the limit is {limit:,.0f} m",
    ),
)
WRONG_CAMERA = Kind(
    "wrong-camera",
    (
        "{place:?}{place} of a camera is a point in space",
        "{angle:?}a camera cannot have a field of view of {angle:g} deg",
        "{most:?}no picture has sides of {width:g}:{height:g}",
        "{thing:?}the camera is inside of `{thing}`",
        "{below:?}the camera is not above the table",
        "the camera looks at its own place",
    ),
    ("{place:?}expected three coordinates", "{angle:?}", "{most:?}", "{thing:?}", "{below:?}", "the eye is here, too"),
    (
        "{place:?}write (x, y, z); z is the height above the table: (0.5, -0.6, 0.7)",
        "{angle:?}it is the angle of the picture's height, more than 0 and less than 180 deg: fov 60 deg",
        "{most:?}write width:height, such as 4:3; neither is more than {most:g} times the other",
        "{thing:?}let it look from outside, or move `{thing}`",
        "{below:?}heights are above the table: at (0.5, -0.6, 0.7)",
        "let it look at the table: looks at (0.5, 0.5, 0)",
    ),
)
BLIND_CAMERA = Kind(
    "blind-camera",
    "`{name}` looks away from everything that can be on the table",
    "no scene has an object in its picture",
    "let it look at the workspace: looks at (0.5, 0.5, 0)",
    severity="warning",
)
WRONG_SHARES = Kind(
    "wrong-shares",
    ("{share:?}{share:g} is no share of a silhouette", "no share is {least:g} % or more and {most:g} % or less"),
    "",
    ("{share:?}shares lie between 0 % and 100 %", "write the smaller share first"),
)
WRONG_CORNERS = Kind(
    "wrong-corners",
    (
        "{given:?}a polygon has three corners or more",
        "{list:?}a polygon takes one list of corners",
        "this polygon is not convex",
    ),
    ("{given} given", "{list:?}", "or its corners are not in order"),
    (
        "{given:?}",
        "{list:?}put the corners in a list: polygon([(0, 0), (1, 0), (0, 1)])",
        "split it into convex parts, each a region of its own: inside(a, left) | inside(a, right)",
    ),
)
FLAT_RECTANGLE = Kind(
    "flat-rectangle",
    ("this rectangle's {side}", "this rectangle is flat"),
    "rect(left, bottom, right, top)",
    ("write {mended}", "give it some width and height"),
)
EMPTY_INTERVAL = Kind(
    "empty-interval",
    ("{narrow:?}this interval of {axis} is too narrow", "this interval of {axis} is empty"),
    ("{narrow:?}numbers of a computer are too coarse for it", "the first end must be smaller"),
    ("write {swapped}", "give it some width"),
)
WORKSPACE_OF_ITSELF = Kind("workspace-of-itself", "the workspace cannot be measured by itself")
MEASURED_TOO_EARLY = Kind(
    "measured-too-early",
    "a declaration cannot measure objects",
    "the shapes of objects are not known yet",
    ("{instead}", "write numbers and constants here"),
)
WRONG_NUMBER_OF_PLACES = Kind(
    "wrong-number-of-places",
    (
        "{objects} objects stand on {surfaces} surfaces",
        "{count} objects stand in {count} places",
        "one object stands in one place",
    ),
    ("{surfaces} given", "{given} given"),
    (
        "{objects:?}name one surface, or one for each object",
        "write a list of {count} points: at [(0.2, 0.5), ...]",
        "write at (0.5, 0.5)",
    ),
)
NO_FREE_OBJECT = Kind(
    "no-free-object",
    "no object is free",
    "all objects are held in place by `at`",
    "leave out `at` for objects that move",
)

# formulas
CONSTANT_LABEL = Kind(
    "constant-label",
    ("`{name}` is constant", "what `require` demands is the same in every scene"),
    ("{name:?}its value is the same in every scene", "no free object takes part"),
    ("{name:?}say something about the objects, for instance: leftOf(mug, plate)", "leave it out"),
    "[[held in place by `at`: {held:list}]][[there is nothing that can hide {alone:quoted}]]",
)
IMPOSSIBLE_REQUIREMENT = Kind(
    "impossible-requirement", "this can never hold", "no scene meets it", ("{meant}", "remove it")
)
STANDS_ELSEWHERE = Kind(
    "stands-elsewhere",
    "`{relation}({name}, {lower})` holds in no scene: `{name}` stands on {stands:list}",
    "`{name}` was not declared to stand on `{lower}`",
    (
        "let it stand there in some scenes: {example}",
        "let it stand there: `on {lower}` where it is declared, or `on any of [...]`",
    ),
    severity="warning",
)
ALWAYS_SATISFIED = Kind(
    "always-satisfied",
    (
        "every scene satisfies `{name}`: phi is at least {least:.4g}",
        "`{part}` holds in every scene: its margin is at least {least:.4g}",
        "`{part}` holds in no scene: its margin is at most {most:.4g}",
    ),
    "",
    (
        BARE_NUMBER,
        "make it stricter, or leave it out",
    ),
    severity="warning",
)
CANNOT_BE_SATISFIED = Kind(
    "cannot-be-satisfied",
    "`{name}` can never be satisfied[[ with {counted}]][[: phi is at most {most:.4g}]]",
    "{clash}",
    (BARE_NUMBER, "{meant}", "change one of the parts that clash"),
    "{others}",
    severity="warning",
)
REQUIREMENT_CANNOT_BE_MET = Kind(
    "requirement-cannot-be-met",
    "what the spec requires can never be met[[ with {counted}]]",
    "{clash}",
    (BARE_NUMBER, "{meant}", "change one of the parts that clash"),
    "{others}",
    severity="warning",
)
HARDLY_SATISFIED = Kind(
    "hardly-satisfied",
    "`{name}` can hardly be satisfied[[ with {counted}]][[: phi is at most {most:.4g}]]",
    "{clash}",
    ("{meant}", "change one of the parts that clash"),
    "{others}",
    severity="warning",
)
REQUIREMENT_HARDLY_MET = Kind(
    "requirement-hardly-met",
    "what the spec requires can hardly be met[[ with {counted}]]",
    "{clash}",
    ("{meant}", "change one of the parts that clash"),
    "{others}",
    severity="warning",
)
NOT_LOOKED_AT = Kind(
    "not-looked-at",
    "after {seconds:g} s of CPU time the search for scenes that satisfy the labels of {file} ended",
    help="`scenegen range {file}` looks longer",
    note="what the messages above do not say, was not found out",
    severity="note",
)
NEVER_SATISFIED = Kind(
    "never-satisfied",
    (
        "no {motion} that satisfies `{name}` was found",
        "no scene that satisfies `{name}` was found; where phi reaches, `scenegen check` shows part by part",
    ),
    help=(
        "{motion:?}let objects move faster or in more steps, or change one of its parts",
        "change one of its parts",
    ),
    severity="warning",
)
HEADING_COMPARED = Kind(
    "heading-compared",
    "a heading is compared as a number: it jumps from 2 pi to 0 at EAST",
    "just after EAST theta({name}) is 0, just before it 6.28",
    "write angle({name}, NORTH, 20 deg), or wrap the difference: abs(wrap(theta({name}) - NORTH)) <= 20 deg",
    severity="warning",
)
SPEC_TOO_LARGE = Kind(
    "spec-too-large",
    ("quantifiers take more than {limit:,} rounds in all", "{file} {reason}"),
    help=(
        "{limit:?}use fewer objects, or fewer quantifiers inside each other",
        "use fewer objects, or smaller definitions and quantifiers",
    ),
)

# imports
SPEC_WITHOUT_FILE = Kind(
    "spec-without-file",
    "a spec without a file cannot read files",
    help="save it as a .spec file and load that",
)
CANNOT_READ_IMPORT = Kind(
    "cannot-read-import",
    ("cannot read {path}: {reason}", "{what:?}{path} is not a file", "cannot find {path}"),
    help=(
        "{reason:?}beside it are {beside:list}",
        "{reason:?}the path is relative to this file",
        "name {what}",
    ),
)
OUTSIDE_FOLDER = Kind(
    "outside-folder",
    "a spec cannot read outside its folder",
    "this is {path}",
    "copy it there, or name a wider folder with <root>; the folder is {folder}",
)
IMPORT_CYCLE = Kind("import-cycle", "{path} imports itself", "this closes a circle of imports")
NOTHING_TO_IMPORT = Kind(
    "nothing-to-import",
    "{path} has no statements to import",
    "it is one unnamed formula",
    "give its formula a name there: task: ...",
)

# what objects stand on
NO_FLAT_TOP = Kind(
    "no-flat-top", "nothing can stand on `{name}`", "it has no flat top", "name another object, or a region"
)
STANDS_ON_ITSELF = Kind(
    "stands-on-itself",
    "`{name}` cannot stand on itself",
    help=("{circle:?}let one of them stand on something else, or on the table", "name another object"),
    note="each stands on the next: {circle}",
)
DOES_NOT_FIT = Kind(
    "does-not-fit",
    (
        "{height:?}`{name}` is too tall for `{surface}`",
        "{rim:?}`{name}` does not lie on `{surface}`",
        "`{name}` does not fit into `{surface}`",
    ),
    (
        "it is {height:.4g} cm high, and there are {clear:.4g} cm",
        "{rim:?}it fits inside",
        "this surface is too small for it",
    ),
    (
        "{height:?}use another level",
        "{rim:?}write `{name} on {carrier}`",
        "write `{name} on {carrier}`: it stands on the rim",
        "use a larger one",
    ),
)
WRONG_DRAWERS = Kind(
    "wrong-drawers",
    (
        "{share:?}a drawer cannot be open by {given:g}",
        "{drawers} drawers take {drawers} shares",
        "{shares:?}a cabinet cannot have {given} drawers: it has 1 to {most}",
        "a cabinet cannot have {given} drawers",
    ),
    ("{share:?}the share of its length, from 0 to 1", "{shares:?}{given} given", "it has 1 to {most}"),
    (
        "{share:?}write open = 0.6 for 60 %",
        "{shares:?}give each drawer its share, the lowest first: open = [0, 0, 0.6]",
    ),
)
DRAWER_NOT_OPEN = Kind(
    "drawer-not-open",
    "{drawer} of `{carrier}` is open by {share:.0f} %: {reach:.2g} cm of it can be reached",
    "`{name}` needs {need:.3g} cm",
    ("{above}open it by {least:g} to 1: {mended}", "open it by {least:g} to 1: {mended}"),
)
NOT_ON_SURFACE = Kind(
    "not-on-surface",
    "`{name}` is not held on `{surface}`",
    "`{surface}` is elsewhere",
    "move it, or what carries it",
)
OUTSIDE_WORKSPACE = Kind(
    "outside-workspace",
    ("`{name}` stands outside of the workspace", "this place is outside the workspace"),
    "the workspace is {workspace}",
    ("{name:?}move the region that it stands on", "move it, or widen the workspace"),
)
STACKED_AND_APART = Kind(
    "stacked-and-apart",
    "`{upper}` stands on `{lower}`, and this keeps their footprints apart",
    help="require noCollision() instead of noOverlap(): things may then stand on and in each other",
)
WRONG_CHOICE = Kind(
    "wrong-choice",
    (
        "{found:?}`any of` takes a list of surfaces",
        "`{surface}` is in this list twice",
        "{nested:?}a choice cannot stand inside a choice",
        "there is nothing to choose from",
    ),
    (
        "this is {found}",
        "{surface:?}",
        "{nested:?}its surfaces belong into the one list",
        "this list is empty",
    ),
    (
        "write on any of [{written}, workspace], or on {written}",
        "{surface:?}name each surface once",
        "write on any of [{surfaces}]",
        "{nested:?}name all surfaces in one list: on any of [a, b, c]",
        "name the surfaces: on any of [a, b]",
    ),
)
WRONG_WEIGHT = Kind(
    "wrong-weight",
    (
        "{low:?}a weight is from {low:g} to {high:g}",
        "{weight:?}a weight is a number above 0",
        "{twice:?}{twice} is in this list twice",
        "{alone:?}there is one number here, whatever its weight",
        "{rounds:?}these weights are too fine",
        "weights cannot stand here",
    ),
    (
        "{weight:?}this one is {weight:g}",
        "{rounds:?}their shares come out even after {rounds:,} scenes; {limit:,} is the limit",
    ),
    (
        "{low:?}only their proportion counts: write [a: 7, b: 3]",
        "{weight:?}leave out what is never taken",
        "{twice:?}write each number once",
        "{alone:?}for {least} to {most} of them write {name}[{least}..{most}]",
        "{rounds:?}write small whole numbers: [a: 7, b: 3]",
        "weights stand in `object cup on any of [tray: 7, workspace: 3]` and in `object block[3: 1, 5: 2]`",
    ),
)
TOO_MANY_CASES = Kind(
    "too-many-cases",
    "there are more than {limit:,} ways in which things can stand here",
    help="let fewer of the things below or on top choose what they stand on",
)
LEVEL_COUNT = Kind(
    "level-count",
    (
        "{count:?}the heights of `{name}` are not as many as its levels",
        "the number of levels of a region cannot be drawn",
    ),
    "{count} named, {levels} given",
    (
        "{count:?}write one height for each: region {name}[2] = rect(...) at 30 cm, 60 cm",
        "write {name}[{levels}]",
        "give each level its height: region {name}[2] = ... at 30 cm, 60 cm",
    ),
)
LEVELS_INTERSECT = Kind(
    "levels-intersect",
    "`{name}` and `{other}` share space",
    "their heights differ by {apart:.3g} cm, and a board is {board:.3g} cm thick",
    "move one of them up, or aside",
)


# in specs
TOO_MANY_COUNTS = Kind(
    "too-many-counts",
    (
        "{combinations:,} combinations with the assets of `{asset}`, more than {limit}",
        "{combinations:,} combinations of numbers, more than {limit}",
    ),
    "each is a spec of its own",
    ('{asset:?}take fewer assets, drawn by a seed: category("...", most = 4, seed = 1)', "narrow the range"),
)
MAY_BE_MISSING = Kind(
    "may-be-missing",
    "`{name}[{index}]` may be missing",
    "there are {least} to {most} of `{name}`",
    "write forall or exists over `{name}`, {name}.last, or raise the least number: {name}[{index}..{most}]",
)
ONE_NUMBER = Kind(
    "one-number",
    "there are always {least} of `{name}`",
    "this range has one number",
    "write {name}[{least}]",
    severity="warning",
)
NOT_A_CATEGORY = Kind("not-a-category", "this does not say of which category an object is", help="write {usage}")
NOT_OF_CATEGORY = Kind(
    "not-of-category",
    "`{name}` cannot be of a category: {what}",
    help='write {name} = asset("025_mug")',
)
DEPENDS_ON_NUMBER = Kind(
    "depends-on-number",
    ("{asset:?}{what} depends on which assets are drawn", "{what} depends on how many things there are"),
    "it is not the same with {counted} and with {most}",
    (
        "{asset:?}nothing stands on an object of a category: its heights differ",
        "write numbers here that do not depend on the number of things",
    ),
    note="scene files say it once, for all scenes",
)

# in requests
NUMBERS_NOT_HERE = Kind(
    "numbers-not-here",
    (
        "{asset:?}{file} draws which asset `{name}` is: this takes specs in which the objects are fixed",
        "{file} draws how many things there are: this takes specs in which the numbers are fixed",
    ),
    help=(
        "fix it: `--count {name}={asset}`, or `with_counts` in Python",
        "fix them: `--count {name}={most}`, `with_counts` in Python, or {name}[{most}] in the spec",
    ),
)
WRONG_COUNT = Kind(
    "wrong-count",
    (
        "there cannot be {number} of `{name}`",
        "`{object}` cannot be the asset `{name}`",
        "the spec draws no number of `{name}`",
    ),
    help=(
        "{number:?}the spec draws {words}",
        "it draws each of them by itself: {each:list}",
        NEAREST,
        "{object:?}the spec draws one of {known:list}",
        "it draws the numbers of {known:list}",
        "it draws no number of things",
    ),
)
NUMBER_LEFT_OUT = Kind(
    "number-left-out",
    "scenes with {counted} are left out: {why}",
    help="the other numbers share its scenes",
    note="",
    severity="warning",
)
NO_NUMBER_POSSIBLE = Kind(
    "no-number-possible",
    "no scenes came with any number of things: with {counted}, {why}",
    help="ask for another range, or for other numbers",
    note="",
)

# in files
NUMBERS_DISAGREE = Kind(
    "numbers-disagree",
    "{scene} of {file} does not say the same of how many things there are as its poses do",
    help="the first elements of an array are there, as many as its count says, and no others",
)
ONE_FILE_MANY_NUMBERS = Kind(
    "one-file-many-numbers",
    "{path} cannot hold scenes that differ in how many things there are",
    "a file of {format} with all scenes has the same bodies in each",
    "name a folder as <out>, which gets a file for each scene",
)
NUMBERS_IN_FILE = Kind(
    "numbers-in-file",
    (
        "{asset:?}these scenes differ in which asset `{name}` is: {what} takes scenes of the same objects",
        "these scenes differ in how many things there are: {what} takes scenes of the same objects",
    ),
    help=(
        "sample them with one asset: `--count {name}={asset}`",
        "sample them with fixed numbers: `--count {name}={most}`",
    ),
)
