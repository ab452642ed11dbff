"""From tables of a TOML file to friction models."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from stickslip.core.config import Table
from stickslip.core.control_spec import ControlLaw
from stickslip.core.errors import ConfigError
from stickslip.core.spec import Described, Law
from stickslip.models import plugins
from stickslip.models.model import Model


def models(tables: Mapping[str, Table], laws: Mapping[str, Law | ControlLaw]) -> dict[str, Model]:
    """Read named models; one may be ``like`` another of them, with other values or scaled ones.

    Parameters
    ----------
    tables : mapping of str to Table
    laws : mapping of str to Law
        Laws from files, by name; the registered ones are known anyway.
    """
    done: dict[str, Model] = {}
    own = friction_laws(laws)
    for name in tables:
        _resolve(name, tables, own, done, ())
    return {name: done[name] for name in tables}


def friction_laws(laws: Mapping[str, Law | ControlLaw]) -> dict[str, Law]:
    """Those of the laws that are friction laws."""
    return {name: law for name, law in laws.items() if isinstance(law, Law)}


def _resolve(
    name: str,
    tables: Mapping[str, Table],
    laws: Mapping[str, Law],
    done: dict[str, Model],
    chain: tuple[str, ...],
) -> Model:
    if name not in done:
        with tables[name] as table:
            base: Model | None = None
            if table.has("like"):
                like = table.choice(
                    "like", [n for n in tables if n != name], family=".".join(table.path[:-1])
                )
                if like in chain:
                    raise table.error(
                        "like", f"closes a circle ({' -> '.join((*chain, name, like))}); give a law"
                    )
                base = _resolve(like, tables, laws, done, (*chain, name))
            done[name] = model(table, laws, base)
    return done[name]


def model(table: Table, laws: Mapping[str, Law], base: Model | None = None) -> Model:
    """Read a law, its choices and its parameters; `base` fills what the table leaves out."""
    scale: dict[str, Any] = {}
    if table.has("scale"):
        with table.table("scale") as factors:
            scale = {key: factors.number(key, "") for key in factors.values}
    with table.blamed():
        if isinstance(table.values.get("law"), dict):
            with table.table("law") as file:
                base = _modelled(file)
        law = base.law if base else _law(table, laws)
        options = {c.name for c in law.choices}
        given = table.rest()
        choices = {k: v for k, v in given.items() if k in options and isinstance(v, str)}
        if "slip_rule" in choices:
            raise table.error("slip_rule", "belongs to the whole run; give it at the top of the file")
        variant = law.having(**choices)
        kept = {
            f.name for f in variant.fields
        }  # another curve leaves the parameters of the former one behind
        inherited: dict[str, Any] = base.parameters._asdict() if base else {}
        values = {k: v for k, v in inherited.items() if k in kept}
        values.update({k: v for k, v in given.items() if k not in choices})
        refuse_unknown(table, values, variant, options)
        found = Model(law, choices, **values)
        found = found.scaled(**scale) if scale else found
        # A model that a file holds has been remarked upon as it was read.
        return found if base and found.parameters == base.parameters else found.warn(table.label())


def _modelled(table: Table) -> Model:
    """What ``model`` names: a model's file, or a table with the content of one."""
    if isinstance(table.values.get("model"), dict):
        return Model.from_table(table.table("model"))
    return Model.from_file(table.document.locate(table.text("model")))


def refuse_unknown(
    table: Table, values: Mapping[str, Any], described: Described, others: Iterable[str] = ()
) -> None:
    """Refuse what is no parameter, before Python takes it for an argument of its own."""
    names = [f.name for f in described.fields]
    for key in values:
        if key not in names:
            remedy = described.remedy_for(key, others)
            raise ConfigError(f"{table.label(key)}: {described.name} has no parameter {key!r}; {remedy}")


def written(model: Model) -> dict[str, Any]:
    """The table of a model: its law, choices and parameters. A law that is not registered is named by its file."""
    law = model.law
    name = law.name if law.name in plugins.law_names() else str(law.written["step"].__code__.co_filename)
    return {**model.as_dict(), "law": name}


def _law(table: Table, laws: Mapping[str, Law]) -> Law:
    name = table.text("law")
    if name.endswith(".py"):
        return plugins.law(str(table.document.locate(name)), table.label("law"))
    if name in laws:
        return laws[name]
    return plugins.law(table.choice("law", (*plugins.law_names(), *laws)))
