"""The table of export targets, made from the targets."""

from __future__ import annotations

from pages import GENERATED, table, write

from stickslip.exports import TARGETS, target_named


def make() -> None:
    """Write one row a target: what it is, what it carries, what it asks for, in what it was tried."""
    rows: list[tuple[str, ...]] = []
    for name in TARGETS:
        t = target_named(name)
        asked = ", ".join(f"`{s.name}`" + (" (needed)" if s.default is None else "") for s in t.settings)
        rows.append((f"`{name}`", t.title, t.carries, asked, t.tried))
    head = ("`--to`", "what", "carries", "`--set`", "tried in")
    write(GENERATED / "targets.txt", table(head, rows) + "\n")
