"""Who may talk to the server: names, origins, tokens, and how much anybody may send.

A page of another origin must not fly our vehicles: its requests carry another Origin, and a name that was made to point
here (DNS rebinding) is no name that we answer to. Every answer forbids the browser whatever the page does not need.
"""

from __future__ import annotations

import ipaddress
import secrets
from hashlib import sha256

from starlette.datastructures import URL, Headers, MutableHeaders, QueryParams
from starlette.requests import cookie_parser
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

MOST_BODY = 4096
"""Bytes of a request: an intent has about 100."""
HEADERS = {
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "connect-src 'self'; manifest-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cross-origin-resource-policy": "same-origin",
}
"""Beside these, what does not say how long it may be kept is not kept at all."""


class Guard:
    """ASGI middleware that lets through what may talk to us."""

    def __init__(self, app: ASGIApp, *, names: frozenset[str], token: str | None) -> None:
        """Guard an application.

        Args:
            app: What is guarded.
            names: Host names that we answer to, beside numeric addresses where a token is asked for.
            token: What has to be shown; None where only this computer can connect.
        """
        self._app = app
        self._names = names
        self._token = token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or hand it on."""
        if scope["type"] != "http":
            return

        async def with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers.update(HEADERS)
                headers.setdefault("cache-control", "no-store")
            await send(message)

        refusal = self._find_refusal(scope)
        if refusal is not None:
            await refusal(scope, receive, with_headers)
            return
        await self._app(scope, receive, with_headers)

    def _find_refusal(self, scope: Scope) -> Response | None:
        headers = Headers(scope=scope)
        host = headers.get("host", "")
        if not self._is_own_name(host):
            return PlainTextResponse(f"this server does not answer to the name {host[:80]!r}", 421)
        if not _is_same_origin(headers, host):
            return PlainTextResponse("requests of other pages are not taken", 403)
        if not _is_small(headers):
            return PlainTextResponse(f"expected at most {MOST_BODY} bytes of a known length", 413)
        if self._token is None or self._has_token(headers):
            return None
        return self._admit_by_token(scope)

    def _is_own_name(self, host: str) -> bool:
        name = _name_of(host)
        if name in self._names:
            return True
        if self._token is None:
            return False
        try:
            ipaddress.ip_address(name.strip("[]"))
        except ValueError:
            return False
        return True

    def _has_token(self, headers: Headers) -> bool:
        kind, _, value = headers.get("authorization", "").partition(" ")
        if kind.lower() == "bearer" and self._is_token(value.strip()):
            return True
        return self._token is not None and self._is_token(
            cookie_parser(headers.get("cookie", "")).get(cookie_name_for(self._token), "")
        )

    def _is_token(self, value: str) -> bool:
        return self._token is not None and secrets.compare_digest(value.encode(), self._token.encode())

    def _admit_by_token(self, scope: Scope) -> Response:
        """Take the token of the address that the terminal showed, once, and keep it as a cookie."""
        value = QueryParams(scope["query_string"]).get("token", "")
        if scope["method"] == "GET" and scope["path"] == "/" and self._is_token(value):
            answer = RedirectResponse(URL(scope=scope).path, 303)
            answer.set_cookie(cookie_name_for(value), value, httponly=True, samesite="strict", path="/")
            return answer
        text = "a token is needed: open the address that ends in /?token=..., or send 'Authorization: Bearer ...'"
        return PlainTextResponse(text, 401, {"www-authenticate": "Bearer"})


def cookie_name_for(token: str) -> str:
    """Return what a browser keeps a token as: it does not tell two flights on one computer apart by their ports."""
    return f"faultline_{sha256(token.encode()).hexdigest()[:12]}"


def _name_of(host: str) -> str:
    """Return a Host without its port.

    >>> _name_of("localhost:8080"), _name_of("[::1]:8080"), _name_of("10.0.0.7")
    ('localhost', '[::1]', '10.0.0.7')
    """
    if host.startswith("["):
        return host.partition("]")[0] + "]"
    return host.rpartition(":")[0].lower() if ":" in host else host.lower()


def _is_same_origin(headers: Headers, host: str) -> bool:
    origin, site = headers.get("origin"), headers.get("sec-fetch-site")
    if origin is not None and origin not in {f"http://{host}", f"https://{host}"}:
        return False
    return site in {None, "same-origin", "none"}


def _is_small(headers: Headers) -> bool:
    """Return whether a body has a length, and a small one; a request without a body says nothing of it."""
    if "transfer-encoding" in headers:
        return False
    length = headers.get("content-length", "0")
    return length.isascii() and length.isdigit() and int(length) <= MOST_BODY
