"""One page a public name of the package, and their list."""

from __future__ import annotations

import inspect

from pages import GENERATED, table, write

import stickslip

FOLDER = GENERATED / "api"
FURTHER = {
    "stickslip.studies.study": ("load", "load_run", "run", "execute", "select"),
    "stickslip.studies.result": ("StudyResult", "Run"),
    "stickslip.report": ("write",),
    "stickslip.report.law_pictures": ("draw_law",),
    "stickslip.rigs.loop": ("Loop",),
    "stickslip.rigs.rig": ("RigKind", "Limits", "Capabilities", "Watchdog", "setpoints"),
    "stickslip.rigs.files": ("read_rig",),
    "stickslip.core.errors": (),
}
"""Modules besides the package's own names, and what of them is shown; () shows the whole module."""

WHOLE = ("Controller",)
"""Classes whose inherited members are shown too."""


def make() -> None:
    """Write the pages."""
    names = sorted(stickslip.__all__, key=str.lower)
    shown = [("stickslip", name) for name in names]
    shown += [(module, name) for module, ours in FURTHER.items() for name in ours]
    for module, name in shown:
        write(FOLDER / f"{module}.{name}.md", page(module, name))
    write(
        FOLDER / "stickslip.core.errors.md",
        "# stickslip.core.errors\n\n```{eval-rst}\n.. automodule:: stickslip.core.errors\n"
        "   :members:\n   :show-inheritance:\n```\n",
    )
    write(FOLDER / "index.md", index(shown))


def page(module: str, name: str) -> str:
    """The page of one class or function."""
    found = getattr(__import__(module, fromlist=[name]), name)
    directive = "autoclass" if inspect.isclass(found) else "autofunction"
    members = "\n   :members:" if inspect.isclass(found) else ""
    members += "\n   :inherited-members:" if name in WHOLE else ""
    return (
        f"# {module}.{name}\n\n```{{eval-rst}}\n.. {directive}:: {module}.{name}{members}\n```\n\n"
        "Symbols and units: [nomenclature](../nomenclature.md).\n"
    )


def index(shown: list[tuple[str, str]]) -> str:
    """All names with the first line of their docstrings."""
    rows = []
    for module, name in shown:
        found = getattr(__import__(module, fromlist=[name]), name)
        said = (inspect.getdoc(found) or "").splitlines()[0].replace("`", "")
        label = f"ss.{name}" if module == "stickslip" else f"{module}.{name}"
        rows.append((f"[`{label}`]({module}.{name}.md)", said))
    rows.append(("[`stickslip.core.errors`](stickslip.core.errors.md)", "The exception tree"))
    pages = "\n".join([*(f"{module}.{name}" for module, name in shown), "stickslip.core.errors"])
    return f"""# Python

`import stickslip as ss` costs nothing: every name is loaded when it is first used.

{table(["name", "what it is"], rows)}

```{{toctree}}
:hidden:

{pages}
```
"""
