"""Friction laws and control laws of a mapping in the place of a file: what names them there, and their tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import chain, count
from pathlib import Path
from typing import Any, cast

from stickslip.control.read_law import read
from stickslip.control.registry import control_law
from stickslip.control.written import NameOf
from stickslip.core import code_approval
from stickslip.core.control_spec import ControlLaw
from stickslip.core.errors import ConfigError, InputError
from stickslip.core.spec import Law
from stickslip.models import plugins
from stickslip.models.model import Model
from stickslip.models.tables import written
from stickslip.verbs.identification import IdentificationResult
from stickslip.verbs.plain_given import Place, absolute, mapping_at, plain
from stickslip.verbs.recommendation import RecommendationResult

MODEL = "a Model, what `identify` or `recommend` returned, or a mapping such as {'law': 'coulomb', 'fc': 0.3}"
LONGEST = 64
"""Letters of a name."""


def insist_on_home(law: Law | ControlLaw, at: Place) -> None:
    """Refuse a law that no file can name: it lives in memory alone, or its file has changed since.

    Raises
    ------
    ConfigError
    """
    plain_law: Law | ControlLaw = law.variants.get((), law)
    if plain_law.path:
        ran: bytes = plain_law.home[1][1] if plain_law.home else b""
        try:
            same = Path(plain_law.path).read_bytes() == ran
        except OSError:
            same = False
        if not same:
            raise ConfigError(
                f"{at}: law {law.name!r} was read from {plain_law.path}, which is gone or has changed since; restore "
                "the file, or make the object anew"
            )
        code_approval.asked_for(plain_law.path, ran)  # It has run here, as an object's.
        return
    try:
        if isinstance(law, ControlLaw):
            known: object = read(control_law(law.name).having(**law.chosen))
        else:
            known = plugins.law(law.name).having(**law.chosen)
    except InputError:
        known = None
    if known is not law:
        raise ConfigError(
            f"{at}: law {law.name!r} lives in memory alone, where no file finds it again; write it in a file of its "
            f"own, and name that, '{law.name}.py'"
        )


def model_table(model: Model, at: Place) -> dict[str, Any]:
    """The table of a friction law; one with a slip rule of its own is the content of a model's file."""
    insist_on_home(model.law, at)
    if "slip_rule" in model.law.chosen:
        return {"law": {"model": model_content(model, at)}}
    return plain(written(model), at)


def model_content(model: Model, at: Place) -> dict[str, Any]:
    """What a model's file says."""
    insist_on_home(model.law, at)
    chosen = dict(model.law.chosen)
    content = written(model)
    parameters = {k: v for k, v in content.items() if k != "law" and k not in chosen}
    return plain(
        {"law": content["law"], **({"choices": chosen} if chosen else {}), "parameters": parameters}, at
    )


def model_of(value: Any, at: Place) -> Model | None:
    """The law of what holds one."""
    if isinstance(value, (IdentificationResult, RecommendationResult)):
        with at.blamed():
            return value.model
    return value if isinstance(value, Model) else None


def friction_table(value: Any, at: Place) -> dict[str, Any]:
    """The table of a friction law, given as one or as what holds one.

    Raises
    ------
    InputError
    """
    if (model := model_of(value, at)) is not None:
        return model_table(model, at)
    table = mapping_at(value, at, MODEL)
    law: Any = table.get("law")
    here = at.key("law")
    if isinstance(law, Mapping) and set(cast("Mapping[Any, Any]", law)) == {"model"}:
        law, here = cast("Mapping[Any, Any]", law)["model"], here.key("model")
        if isinstance(law, str):
            return plain({**table, "law": {"model": absolute(law)}}, at)
    if (model := model_of(law, here)) is not None:  # Whose values the table may change or scale.
        table["law"] = {"model": model_content(model, here)}
    return plain(table, at)


@dataclass
class HeldLaws:
    """[laws.NAME]: what the mapping gives, and what its controllers hold, each under a name that means nothing else.

    Attributes
    ----------
    models : dict of str to Model
        By name, for laws that are equal to have one.
    taken : set of str
        Names that may not be given.
    held : dict of str to dict
        The tables that controllers add.
    """

    models: dict[str, Model] = field(default_factory=dict[str, Model])
    taken: set[str] = field(default_factory=set[str])
    held: dict[str, dict[str, Any]] = field(default_factory=dict[str, dict[str, Any]])

    @staticmethod
    def of(content: Mapping[str, Any], at: Place) -> HeldLaws:
        """Names that a controller's table uses may mean a machine's own model, and are not given to another."""
        own: Any = content.get("laws", {})
        given = dict(cast("Mapping[Any, Any]", own)) if isinstance(own, Mapping) else {}
        users = (content.get(key) for key in ("controllers", "comparisons", "responses", "drives"))
        named = chain.from_iterable(map(_texts_in, users))
        models = ((name, model_of(value, at.key("laws").key(str(name)))) for name, value in given.items())
        return HeldLaws({name: model for name, model in models if model is not None}, {*given, *named})

    def namer(self, at: Place) -> NameOf:
        """What names the laws of the controller that stands there."""
        return lambda model: self._name(model, at.last, at)

    def _name(self, model: Model, owner: str, at: Place) -> str:
        for name, one in self.models.items():
            if one == model:
                return name
        law = model.law.name
        wanted = chain((law, f"{owner}-{law}"), (f"{owner[: LONGEST // 2]}-{law}-{i}" for i in count(2)))
        name = next(n for n in wanted if len(n) <= LONGEST and n not in self.taken)
        self.models[name] = model
        self.taken.add(name)
        self.held[name] = model_table(model, at)
        return name


def _texts_in(value: Any) -> Iterator[str]:
    """Every text in a value."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        yield from chain.from_iterable(map(_texts_in, cast("Mapping[Any, Any]", value).values()))
    elif isinstance(value, (list, tuple)):
        yield from chain.from_iterable(map(_texts_in, cast("list[Any]", value)))
