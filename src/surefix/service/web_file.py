"""Answer a browser that asks for a file of a page."""

from __future__ import annotations

from collections.abc import Mapping

from fastapi import HTTPException, Request, Response

from surefix.service.web_pages import Page

__all__ = ["file_answer"]


def file_answer(files: Mapping[str, Page], name: str, request: Request) -> Response:
    """Give a file packed where the browser can unpack it, and nothing where it has it already.

    Raises
    ------
    HTTPException
        404: there is no such file.
    """
    found = files.get(name)
    if found is None:
        raise HTTPException(404, "no such page")
    headers = {"etag": found.tag, "cache-control": "no-cache", "vary": "accept-encoding"}
    if request.headers.get("if-none-match") == found.tag:
        return Response(status_code=304, headers=headers)
    if "gzip" not in request.headers.get("accept-encoding", ""):
        return Response(found.content, headers=headers, media_type=found.kind)
    headers["content-encoding"] = "gzip"
    return Response(found.packed, headers=headers, media_type=found.kind)
