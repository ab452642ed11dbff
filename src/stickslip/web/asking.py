"""Check the content of requests: JSON of limited size, texts, numbers. Errors are one line and a status."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Awaitable, Callable
from typing import Any, cast

from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response

from stickslip.core.errors import InputError, StickslipError
from stickslip.web.projects import NotThere

Handler = Callable[[Request], Awaitable[Response]]
Table = dict[tuple[str, str], Handler]
"""Handlers by method and path."""
MOST_JSON = 2**20


class Refused(Exception):
    """A request that is refused with a status."""

    def __init__(self, status: int, message: str) -> None:
        super().__init__(message)
        self.status = status


def answered(handler: Handler) -> Handler:
    """Return the handler, with its errors as answers of one line."""

    async def answer(request: Request) -> Response:
        try:
            return await handler(request)
        except Refused as refused:
            return complaint(refused.status, refused)
        except NotThere as error:
            return complaint(404, error)
        except InputError as error:
            return complaint(400, error)
        except StickslipError as error:
            return complaint(422, error)
        except ClientDisconnect:
            return complaint(400, "the connection was closed before the upload was complete")
        except Exception as error:
            # The details are printed for the owner of the server; the page only learns that there was an error.
            print(f"stickslip: {type(error).__name__}: {error}", file=sys.stderr)
            return complaint(500, "internal error of stickslip; see the terminal")

    return answer


def complaint(status: int, what: object) -> JSONResponse:
    """Return an error for the page."""
    return JSONResponse({"error": " ".join(str(what).split())}, status)


async def body(request: Request) -> dict[str, Any]:
    """Return the request's JSON object.

    Raises
    ------
    Refused
    """
    if request.headers.get("content-type", "").partition(";")[0].strip().lower() != "application/json":
        raise Refused(415, "send JSON, with the content type application/json")
    content = bytearray()
    async for chunk in request.stream():
        content += chunk
        if len(content) > MOST_JSON:
            raise Refused(413, f"the request is larger than {MOST_JSON} bytes")
    try:
        data: Any = json.loads(content or b"{}")
    except (ValueError, RecursionError):
        raise Refused(400, "this is not JSON") from None
    if not isinstance(data, dict):
        raise Refused(400, "send a JSON object")
    return cast("dict[str, Any]", data)


def text(data: dict[str, Any], key: str, default: str | None = None) -> str:
    """Return a text of the request.

    Raises
    ------
    Refused
    """
    value = data.get(key, default)
    if not isinstance(value, str):
        raise Refused(400, f"{key} must be a text")
    return value


def number(value: object, name: str) -> float:
    """Return a finite number of the request.

    Raises
    ------
    Refused
    """
    try:
        if isinstance(value, bool):
            raise TypeError
        out = float(cast("Any", value))
    except (TypeError, ValueError, OverflowError):
        raise Refused(400, f"{name} must be a number") from None
    if not math.isfinite(out):
        raise Refused(400, f"{name} must be a finite number")
    return out


def chosen_names(value: object, name: str, allowed: tuple[str, ...] | None = None) -> list[str]:
    """Return a list of allowed texts.

    Raises
    ------
    Refused
    """
    items: list[Any] = cast("list[Any]", value) if isinstance(value, list) else [None]
    if len(items) > 100 or not all(isinstance(v, str) for v in items):
        raise Refused(400, f"{name} must be a list of texts")
    if allowed is not None and (odd := [v for v in items if v not in allowed]):
        raise Refused(400, f"{name}: {odd[0][:80]!r} is not one of {', '.join(allowed)}")
    return items
