"""Options of commands, and the options and arguments that several commands share."""

from __future__ import annotations

import copy
import dataclasses
import inspect
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import typer

from scenegen.errors import DataError, RequestError, Source, Span
from scenegen.errors.files import SPEC_NOT_FOUND
from scenegen.validation import options_of

Command = TypeVar("Command", bound=Callable[..., Any])


def option(help: str, metavar: str | None = None, *, default: Any = None, flags: str = "", **more: Any) -> Any:
    """An option of a command, the default of a parameter. It is called like the parameter unless `flags`, separated by
    spaces, are given; `default=...` for an option that must be given; `more` is what typer.Option takes."""
    shown = default is not ... and default is not None and default is not False
    return typer.Option(default, *flags.split(), help=help, metavar=metavar, show_default=shown, **more)


def argument(help: str, metavar: str, *, default: Any = ..., **more: Any) -> Any:
    """An argument of a command, as `option` is an option."""
    return typer.Argument(default, help=help, metavar=metavar, show_default=False, **more)


def as_typed(parameter: inspect.Parameter) -> inspect.Parameter:
    """The parameter of a command as typer takes it: an option is called like it, a flag that is not given is False, and
    whole numbers may be written as `whole` takes them."""
    if not isinstance(parameter.default, typer.models.OptionInfo):
        return parameter
    given = copy.copy(parameter.default)
    dashes = "-" if len(parameter.name) == 1 else "--"
    given.param_decls = given.param_decls or (f"{dashes}{parameter.name.replace('_', '-')}",)
    if parameter.annotation is bool and given.default is None:
        given.default = False
    if parameter.annotation in (int, int | None) and given.parser is None and given.min is None:
        given.parser, given.metavar = whole, given.metavar or "N"
    return parameter.replace(default=given)


def asking(kind: type, **defaults: Any) -> Callable[[Command], Command]:
    """A command with an option for each field of a dataclass that has one (`scenegen.validation.Option`), before its
    own that may be left out. It gets what was typed by the fields' names, as its `**typed`; `defaults` are those that
    the fields do not have."""

    def extend(command: Command) -> Command:
        signature = inspect.signature(command, eval_str=True)
        own = [one for one in signature.parameters.values() if one.kind is not one.VAR_KEYWORD]
        first = [one for one in own if isinstance(one.default, typer.models.ArgumentInfo) or one.default.default is ...]
        fields = []
        for name, (kept, given) in options_of(kind).items():
            more = {"default": defaults[name]} if name in defaults else {}
            default = field_option(kind, name, rich_help_panel=given.panel, **more)
            typed = kept if given.typed is None else given.typed
            fields.append(inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation=typed, default=default))
        others = [one.replace(kind=one.KEYWORD_ONLY) for one in own if one not in first]
        command.__signature__ = signature.replace(parameters=[*first, *fields, *others])  # type: ignore[attr-defined]
        return command

    return extend


def field_option(kind: type, name: str, help: str | None = None, **changes: Any) -> Any:
    """The option of a field of a dataclass, for another command with a `help` and `default` of its own."""
    usual = {one.name: one.default for one in dataclasses.fields(kind)}[name]
    _, given = options_of(kind)[name]
    more: dict[str, Any] = {"default": None if usual is dataclasses.MISSING or given.typed is not None else usual}
    if hints := given.choices or given.hints:
        more["autocompletion"] = choices(*hints)
    if given.unit == "s":
        more["parser"] = seconds
    metavar = "SECONDS" if given.unit == "s" else given.metavar
    return option(given.help if help is None else help, metavar, **{**more, **changes})


def choices(*names: str) -> Callable[[str], list[str]]:
    """What a shell completes an option's value to."""
    return lambda incomplete: [name for name in names if name.startswith(incomplete)]


def parse_counts(options: list[str] | None) -> dict[str, str]:
    """The numbers of `--count` options as typed, e.g. ["block=5"], or assets, ["mug=025_mug"]: the spec knows which.
    Raises RequestError with a caret."""
    from scenegen.errors.requests import ARGUMENT_SYNTAX, GIVEN_TWICE

    found: dict[str, str] = {}
    for text in options or ():
        here = Span(Source("count", text, argument=True), 0, len(text))
        name, _, number = (part.strip() for part in text.partition("="))
        if not name or not number:
            example = "--count block=5; of an object of a category the asset: --count mug=025_mug"
            example += f"; for that many scenes: -n {text}" if text.isdecimal() else ""
            raise RequestError(ARGUMENT_SYNTAX(here, what="a number of things", form="NAME=NUMBER", example=example))
        if name in found:
            raise RequestError(GIVEN_TWICE(here, what=f"the number of `{name}`"))
        found[name] = number
    return found


def whole(text: str | int) -> int:
    """A whole number as typed: 1000000, 1_000_000 or 1e6. Raises typer.BadParameter."""
    try:
        return int(text)
    except ValueError:
        value = float(text) if re.fullmatch(r"\d+(\.\d+)?[eE]\+?\d{1,2}", str(text)) else 0.5
        if not value.is_integer():
            raise typer.BadParameter(f"'{text}' is not a whole number; write 1000, 1_000 or 1e3") from None
        return int(value)


def seconds(text: str | float) -> float:
    """A span of time as typed: seconds, or with a unit of the language, 90s or 2min. Raises typer.BadParameter."""
    from scenegen.geometry.primitives import quantity

    found = re.fullmatch(r"\s*(.*?)\s*(ms|s|min|)\s*", str(text))
    try:
        return quantity(*found.groups())[0] if found else float(text)
    except ValueError:
        raise typer.BadParameter(f"'{text}' is no time; write seconds, 60, or a unit: 90s, 2min") from None


def metres(text: str | float) -> float:
    """A length as typed: 2cm, 20mm or 0.02. Raises typer.BadParameter."""
    return _measure(text, r"mm|cm|m", "no length; write 2cm, 20mm or metres: 0.02")


def radians(text: str | float) -> float:
    """An angle as typed: 15deg, or radians. Raises typer.BadParameter."""
    return _measure(text, r"deg|rad", "no angle; write 15deg, or radians: 0.26")


def errors_of_placing(text: str) -> tuple[float, float]:
    """A length and an angle as typed: 1.5cm,15deg. Raises typer.BadParameter."""
    length, _, angle = str(text).partition(",")
    return metres(length), radians(angle or 0.0)


def _measure(text: str | float, units: str, wrong: str) -> float:
    from scenegen.geometry.primitives import quantity

    found = re.fullmatch(rf"\s*(.*?)\s*({units}|)\s*", str(text))
    try:
        return quantity(*found.groups())[0] if found else float(text)
    except ValueError:
        raise typer.BadParameter(f"'{text}' is {wrong}") from None


def spec_names(incomplete: str) -> list[str]:
    """What a shell completes a spec's name to: shipped ones, where no file begins like that (it completes files)."""
    from scenegen.resources import shipped_specs

    start = Path(incomplete + "x")
    try:
        if any(start.parent.glob(f"{start.name[:-1]}*")) and incomplete:
            return []
    except (OSError, ValueError):
        return []
    return [name for name in shipped_specs() if name.startswith(incomplete)]


def option_called(word: str, context: Any) -> str | None:
    """The option of a command, such as -n, that a word would be with its dashes."""
    options = (option for one in context.command.params for option in one.opts if option.startswith("-"))
    return next((option for option in options if option.lstrip("-") == word), None)


def find_spec(path: Path, context: Any = None) -> Path:
    """The file that a spec's name stands for: the file of that name, NAME.spec, or else the shipped spec NAME.

    Raises DataError if there is none, which names the option of the command in `context` that may be meant.
    """
    from scenegen.resources import shipped_specs
    from scenegen.scenes.files import is_stream

    if is_stream(path):
        return path
    try:
        if path.exists() or path.is_symlink() or path.suffix:
            return path
        own = path.with_name(f"{path.name}.spec")
        if own.is_file():
            return own
    except (OSError, ValueError):  # not a valid file name: opening it gives the error
        return path
    shipped = shipped_specs()
    if path.name != str(path):
        return path
    if path.name in shipped:
        return shipped[path.name]
    from scenegen.scenes.files import missing_help

    option = None if context is None else option_called(path.name, context)
    remedy = missing_help(path, "a spec") if option is None else f"an option begins with a dash: {option}"
    raise DataError(SPEC_NOT_FOUND(path=path, name=path.name, known=shipped, remedy=remedy))


def display_name(path: Path) -> str:
    """A spec's file as people name it: a shipped one by its name alone."""
    from scenegen.resources import shipped_specs
    from scenegen.scenes.files import is_stream

    if is_stream(path):
        return "<stdin>"
    return path.stem if path.is_absolute() and shipped_specs().get(path.stem) == path else str(path)


def _find(context: typer.Context, path: Path) -> Path:
    return find_spec(path, context)


def find_specs(context: typer.Context, paths: list[Path] | None) -> list[Path]:
    return [find_spec(path, context) for path in paths or ()]


SPEC_FILE = argument(
    "A spec file, the name of a shipped spec, or - for standard input.",
    "SPEC",
    callback=_find,
    autocompletion=spec_names,
)
SPEC_FILES = argument(
    "Spec files, names of shipped specs, or - for standard input.",
    "SPEC",
    callback=find_specs,
    autocompletion=spec_names,
)
ROOT = option("The folder that imports may read from; the spec's own if left out.", "DIR")
COUNT = option(
    "How many there are of things whose number the spec draws, or which asset; repeat for more.",
    "NAME=N",
)
POSES_OF = option(
    "The spec of a file that holds poses alone: .csv, .parquet, .json or .jsonl.",
    "SPEC",
    callback=lambda path: None if path is None else find_spec(path),
    autocompletion=spec_names,
)
MESHES_OPTION = option("The folder of the spec's meshes, assets and URDF files: objects as they are in these.", "DIR")
ENGINE = option(
    "What does many jobs: local processes, or a ray cluster. The bytes are the same.",
    default="local",
    autocompletion=choices("local", "ray"),
)
ADDRESS = option("The Ray cluster; default: $RAY_ADDRESS, or this machine.", "ADDR")
PICTURES = option("Draw so many scenes, from the first; default: all.")
WORKERS = option("Processes; default: one per core.")
JSON = option("Print one JSON document instead, with every digit.")
QUIET = option("Say nothing but errors and warnings.", flags="--quiet -q")
VERBOSE = option("Say what is being done, and how long it takes.", flags="--verbose -v")


def check_action(
    command: str, action: str, given: Collection[str], options: Mapping[str, tuple[Sequence[str], Sequence[str]]]
) -> None:
    """Raises RequestError for an unknown action of a command, and for options that are not those of the action;
    `options` are those that each action needs, and its others."""
    from scenegen.errors.requests import MISSING_ARGUMENT, OUT_OF_PLACE, UNKNOWN_CHOICE

    if action not in options:
        raise RequestError(UNKNOWN_CHOICE(what="action", name=action, known=options))
    needed, others = options[action]
    for name in given:
        if name not in (*needed, *others):
            of = ", ".join(f"`{one}`" for one, names in options.items() if name in (*names[0], *names[1]))
            raise RequestError(OUT_OF_PLACE(argument=name, rule=f"is an option of {of}", remedy="leave it out"))
    for name in needed:
        if name not in given:
            raise RequestError(MISSING_ARGUMENT(argument=name, question=f"see `scenegen {command} --help` on {action}"))
