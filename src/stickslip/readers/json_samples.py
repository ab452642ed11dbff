"""Read JSON: a list of samples, with or without metadata; columns of numbers; or one sample per line."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

from stickslip.core.errors import InputError
from stickslip.readers import _sysid_json
from stickslip.readers._flatten import table_of
from stickslip.readers.table_columns import Format, Table


def recognise(head: bytes, path: Path) -> bool:
    """Accept a file that starts with a bracket or brace, unless its suffix is that of another format."""
    text = head.lstrip(b"\xef\xbb\xbf \t\r\n")
    return text[:1] == b"{" or (
        text[:1] == b"[" and path.suffix.lower() in (".json", ".jsonl", ".ndjson", "")
    )


def read(path: Path) -> Table:
    """Return the samples as columns, single values as constants."""
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: byte {error.start} is not UTF-8; save the file as UTF-8 text") from None
    tree = _parse(path, text)
    if _sysid_json.is_sysid(tree):
        return _sysid_json.table_of_tests(path, tree)
    if isinstance(tree, Mapping):
        parts = cast("Mapping[str, Any]", tree)
        if isinstance(parts.get("columns"), list) and isinstance(parts.get("data"), list):
            tree = _split(parts)
    return table_of("json", tree, path)


def _parse(path: Path, text: str) -> Any:
    try:
        return json.loads(text)
    except RecursionError:
        raise InputError(f"{path} is nested too deeply; write a list of samples") from None
    except ValueError as error:
        lines = [line for line in text.splitlines() if line.strip()]
        try:
            if len(lines) > 1:
                return [json.loads(line) for line in lines]
        except (ValueError, RecursionError):
            pass
        raise InputError(f"{path} is not JSON: {error}; correct the file there") from None


def _split(parts: Mapping[str, Any]) -> Any:
    """Read the layout of pandas: names of columns, and rows of values."""
    names = [str(name) for name in cast("list[Any]", parts["columns"])]
    rows = cast("list[Any]", parts["data"])
    if not all(isinstance(row, list) and len(cast("list[Any]", row)) == len(names) for row in rows):
        return parts
    return {name: [row[i] for row in rows] for i, name in enumerate(names)}


FORMAT = Format("json", "JSON", (".json", ".jsonl", ".ndjson"), recognise, read)
