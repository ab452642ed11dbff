"""Names to control laws and velocity estimators: built in, installed, or in files of one's own.

Built-in ones are named in `stickslip.control.laws.CONTROL_LAWS` and `stickslip.control.estimators.ESTIMATORS`; others
come from installed packages (entry point ``stickslip.control_laws``), or from a file whose name ends in ``.py``.
"""

from __future__ import annotations

import importlib
import os

from stickslip.control.estimators import ESTIMATORS
from stickslip.control.laws import CONTROL_LAWS
from stickslip.control.read_law import read
from stickslip.core.arguments import arguments_checked
from stickslip.core.config import Table
from stickslip.core.control_spec import ControlLaw
from stickslip.core.errors import ConfigError, LawError
from stickslip.core.spec import Law
from stickslip.models import plugins

BUILT_IN = {"stickslip.control.laws": CONTROL_LAWS, "stickslip.control.estimators": ESTIMATORS}
"""Folders of one file a law, and the names there"""


def control_law_names() -> tuple[str, ...]:
    """The name of every control law and velocity estimator."""
    builtin = (name for names in BUILT_IN.values() for name in names)
    return (*builtin, *plugins.installed("stickslip.control_laws"))


@arguments_checked
def control_law(name: str, named_by: str = "") -> ControlLaw:
    """The control law or velocity estimator of that name, or of the file of that path; `named_by` as in `law`.

    Raises
    ------
    UnknownName, LawError, CodeRefused
    """
    if name.endswith(".py"):
        return _control_law_in(*plugins.code_at(os.path.realpath(name), named_by))
    for folder, names in BUILT_IN.items():
        if name in names:
            found: ControlLaw = importlib.import_module(f"{folder}.{name}").CONTROL_LAW
            return found.coming_from(control_law, name)
    if name in (others := plugins.installed("stickslip.control_laws")):
        return read(others[name].load()).coming_from(control_law, name)
    raise plugins.unknown_law("control law", name, control_law_names())


def law_or_control_law(path: str, named_by: str = "") -> Law | ControlLaw:
    """What a file defines: a friction law or a control law; `named_by` and errors as in `law`."""
    file, code = plugins.code_at(os.path.realpath(path), named_by)
    made = vars(plugins.defined_in(file, code))
    return _control_law_in(file, code) if "CONTROL_LAW" in made else plugins.law_in(file, code)


def law_files(table: Table) -> dict[str, Law | ControlLaw]:
    """The laws and control laws in the files that ``plugins`` lists, by name."""
    found: dict[str, Law | ControlLaw] = {}
    for path in table.files("plugins"):
        with table.blamed():
            named_by = table.label("plugins")
            law = law_or_control_law(str(path), named_by) if path.suffix == ".py" else None
            if law is None:
                raise ConfigError(
                    f"{table.label('plugins')}: {path.name} is not a law file; its name must end in .py"
                )
            if law.name in found or law.name in (*plugins.law_names(), *control_law_names()):
                raise ConfigError(
                    f"{table.label('plugins')}: {path.name} defines {law.name!r}, which exists already"
                )
        found[law.name] = law
    return found


@plugins.made_once
def _control_law_in(path: str, code: bytes) -> ControlLaw:
    found = getattr(plugins.defined_in(path, code), "CONTROL_LAW", None)
    if not isinstance(found, ControlLaw):
        raise LawError(f"{path} defines no control law; end it with `CONTROL_LAW = ControlLaw(...)`")
    return read(found).coming_from(_control_law_in, path, code, path=path)
