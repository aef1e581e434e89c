"""Models of a spec that draws how many things there are, or which: a folder with an ordinary model for each
combination of numbers.

The number of things is uniform whatever phi is wanted, so the models get equal shares of the scenes, as the members of
the spec do in the exact samplers (scenegen.sampling.numbered). Nothing about the shares has to be learned.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from pathlib import Path

from scenegen.api.model import Model, read_model
from scenegen.api.spec import Spec, check_spec, load
from scenegen.errors import DataError
from scenegen.errors.models import MODEL_FOLDER, NO_MODEL_OF_NUMBER
from scenegen.formats.files import ensure_folder, write_whole
from scenegen.lang.counts import file_stem, written
from scenegen.lang.spec import CheckedSpec
from scenegen.validation import as_path

SPEC = "numbers.spec"  # the spec that draws numbers, in a folder of models


class ModelFamily(Model):
    """Models by the numbers of things in their scenes. What is asked of one model is answered by that of the most
    things; scenes come from all."""

    def __init__(self, spec: Spec, members: Mapping[str, Model]) -> None:
        """`members` are the models by the SHA-256 of their specs."""
        self.spec = spec
        self._members = dict(members)
        self.trained = list(self._members.values())[-1].trained

    def __repr__(self) -> str:
        return f"<ModelFamily {self.name} of {self.spec.declared.name}, {len(self._members)} models>"

    @property
    def each(self) -> tuple[tuple[dict[str, int], Model], ...]:
        return tuple((numbers, self.of(member.checked)) for numbers, member in self.spec.members)

    def of(self, checked: CheckedSpec) -> Model:
        return self._members[checked.sha256]

    def with_counts(self, counts: Mapping[str, int | str]) -> Model:
        """The models of these numbers of things, by name; with all of them one model. Raises RequestError as
        `Spec.with_counts` does."""
        spec = self.spec.with_counts(counts)
        if not spec.counts:
            return self.of(spec.checked)
        return ModelFamily(spec, {one.checked.sha256: self.of(one.checked) for _, one in spec.members})

    def in_steps(self, steps: int) -> ModelFamily:
        """The same models, each taking `steps` evaluations of its network for a scene. Raises RequestError as
        `Model.in_steps` does."""
        return ModelFamily(self.spec, {key: one.in_steps(steps) for key, one in self._members.items()})

    def with_spec(self, spec: Spec) -> ModelFamily:
        """Models of labels that are added to their specs, for a spec that draws the same numbers."""
        pairs = zip(spec.members, self.each, strict=True)
        other = copy.copy(self)
        other.spec = spec
        other._members = {one.checked.sha256: model.with_spec(one) for (_, one), (_, model) in pairs}
        return other


def is_family(path: Path) -> bool:
    """Whether a path is a folder of models; what no path can be called is none."""
    try:
        return (path / SPEC).is_file()
    except (OSError, ValueError):
        return False


def model_file(path: Path, numbers: Mapping[str, int]) -> Path:
    """The file of these numbers of things in a folder of models; of no numbers `path` itself, a model file."""
    return path / f"{file_stem(numbers)}.safetensors" if numbers else path


def load_model(path: str | Path, spec: Spec | None = None) -> Model:
    """Read a model file, or a folder of models of a spec that draws numbers of things. Raises DataError for anything
    but a whole one, and for one of another spec than `spec`."""
    if spec is not None:
        check_spec(spec)
    found = as_path("path", path)
    return _load_family(found, spec) if is_family(found) else read_model(found, spec)


def _load_family(path: Path, spec: Spec | None) -> ModelFamily:
    """Raises DataError, also where a model is missing."""
    found = load(path / SPEC)
    if spec is not None and spec.declared.sha256 != found.declared.sha256:
        raise DataError(MODEL_FOLDER(path=path, spec=spec.declared.name))
    members: dict[str, Model] = {}
    for numbers, member in found.members:
        file = model_file(path, numbers)
        if not file.exists():
            raise DataError(NO_MODEL_OF_NUMBER(path=file, counted=written(numbers)))
        members[member.checked.sha256] = read_model(file, member)
    return ModelFamily(found, members)


def family_files(spec: Spec, folder: Path) -> list[tuple[dict[str, int], Spec, Path]]:
    """The numbers, spec and file of every model of a folder, whose spec is written. Raises OutputError."""
    ensure_folder(folder)
    write_whole(folder / SPEC, spec.source.encode())
    return [(numbers, member, model_file(folder, numbers)) for numbers, member in spec.members]
