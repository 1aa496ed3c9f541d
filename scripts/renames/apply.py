"""Renames functions, methods and classes across the tree: `python -m scripts.renames.apply LIST...` (`pip install ty`).

A list has a line for each: `path.py:Class.method new_name`. A language server finds definitions, imports and uses, so
that other things of the same name stay as they are. All is looked up before anything is written. What it cannot see is
in strings: names in documents, targets of monkeypatch, `__all__` (`exported.txt`). The lists beside this file are names
that are agreed and not applied yet; `*-files.txt` are the moves of files that go with them, afterwards.
"""

from __future__ import annotations

import ast
import json
import re
import shutil
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterable, Mapping
from itertools import count
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlparse

ROOT = Path(__file__).resolve().parents[2]
Edits = dict[Path, dict[tuple[int, int, int], str]]
"""By file, then by line and the columns where a name begins and ends (in UTF-16 units): the new name."""


class Server:
    """A language server that is asked over its standard input."""

    def __init__(self, command: list[str]) -> None:
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=ROOT)
        if self._process.stdin is None or self._process.stdout is None:
            raise OSError(f"{command[0]}: no pipes")
        self._stdin, self._stdout = self._process.stdin, self._process.stdout
        self._numbers = count(1)
        self._opened: set[Path] = set()
        root = {"uri": ROOT.as_uri(), "name": ROOT.name}
        capabilities = {"workspace": {"workspaceEdit": {"documentChanges": True}}}
        self._request(
            "initialize",
            {"processId": None, "rootUri": root["uri"], "workspaceFolders": [root], "capabilities": capabilities},
        )
        self._send({"method": "initialized", "params": {}})

    def find_edits(self, path: Path, line: int, column: int, new_name: str) -> Iterable[tuple[Path, dict[str, Any]]]:
        """Yield every edit that renames what is defined there.

        Raises:
            LookupError: the server refuses.
        """
        if path not in self._opened:
            self._opened.add(path)
            text = path.read_text(encoding="utf-8")
            document = {"uri": path.as_uri(), "languageId": "python", "version": 1, "text": text}
            self._send({"method": "textDocument/didOpen", "params": {"textDocument": document}})
        position = {"line": line, "character": column}
        found = self._request(
            "textDocument/rename",
            {"textDocument": {"uri": path.as_uri()}, "position": position, "newName": new_name},
        )
        for change in found.get("documentChanges") or []:
            for edit in change["edits"]:
                yield Path(unquote(urlparse(change["textDocument"]["uri"]).path)), edit
        for uri, edits in (found.get("changes") or {}).items():
            for edit in edits:
                yield Path(unquote(urlparse(uri).path)), edit

    def close(self) -> None:
        """End the server."""
        self._process.terminate()
        self._process.wait()

    def _request(self, method: str, params: Mapping[str, Any]) -> dict[str, Any]:
        number = next(self._numbers)
        self._send({"id": number, "method": method, "params": params})
        while True:
            message = self._receive()
            if "method" in message and "id" in message:  # a question of the server's own
                self._send({"id": message["id"], "result": None})
            elif message.get("id") == number:
                if not message.get("result"):
                    raise LookupError(str(message.get("error", "nothing to rename there")))
                result: dict[str, Any] = message["result"]
                return result

    def _send(self, message: Mapping[str, Any]) -> None:
        body = json.dumps({"jsonrpc": "2.0", **message}).encode()
        self._stdin.write(b"Content-Length: %d\r\n\r\n%s" % (len(body), body))
        self._stdin.flush()

    def _receive(self) -> dict[str, Any]:
        length = 0
        while line := self._stdout.readline().strip():
            name, _, value = line.partition(b":")
            length = int(value) if name.lower() == b"content-length" else length
        message: dict[str, Any] = json.loads(self._stdout.read(length))
        return message


def locate(path: Path, name: str) -> tuple[int, int]:
    """Return line and column, from 0, of a definition such as `Class.method`.

    Raises:
        LookupError: it is not there.
    """
    text = path.read_text(encoding="utf-8")
    body: list[ast.stmt] = ast.parse(text).body
    place = None
    for part in name.split("."):
        place = next((one for one in body if part in _defined(one)), None)
        if place is None:
            raise LookupError(f"{path}: expected a definition of {name}")
        body = getattr(place, "body", [])
    if place is None:
        raise LookupError(f"{path}: expected a name")
    line = text.split("\n")[place.lineno - 1]
    found = re.compile(rf"\b{re.escape(name.rpartition('.')[2])}\b").search(line, place.col_offset)
    if found is None:
        raise LookupError(f"{path}: expected {name} in line {place.lineno}")
    return place.lineno - 1, found.start()


def _defined(statement: ast.stmt) -> list[str]:
    match statement:
        case ast.FunctionDef(name) | ast.AsyncFunctionDef(name) | ast.ClassDef(name):
            return [name]
        case ast.Assign(targets):
            return [target.id for target in targets if isinstance(target, ast.Name)]
        case ast.AnnAssign(ast.Name(name)):
            return [name]
        case _:
            return []


def write_edits(edits: Edits) -> int:
    """Write the files anew; return how many places changed."""
    for path, places in edits.items():
        lines = [line.encode("utf-16-le") for line in path.read_text(encoding="utf-8").split("\n")]
        for (line, begin, end), new_name in sorted(places.items(), reverse=True):
            lines[line] = lines[line][: 2 * begin] + new_name.encode("utf-16-le") + lines[line][2 * end :]
        path.write_text("\n".join(line.decode("utf-16-le") for line in lines), encoding="utf-8")
    return sum(map(len, edits.values()))


def main(lists: list[str]) -> None:
    """Apply the lists; what cannot be found is printed and left."""
    found = shutil.which("ty")
    if found is None or not lists:
        raise SystemExit("usage: python -m scripts.renames.apply LIST... (needs: pip install ty)")
    server = Server([found, "server"])
    edits: Edits = defaultdict(dict)
    for line in (line for name in lists for line in Path(name).read_text(encoding="utf-8").splitlines()):
        if not (words := line.partition("#")[0].split()):
            continue
        file, _, name = words[0].partition(":")
        try:
            for path, edit in server.find_edits(ROOT / file, *locate(ROOT / file, name), words[1]):
                begin, end = edit["range"]["start"], edit["range"]["end"]
                edits[path][begin["line"], begin["character"], end["character"]] = edit["newText"]
        except (LookupError, OSError) as error:
            print(f"{words[0]}: {error}", file=sys.stderr)
    server.close()
    print(f"{write_edits(edits)} places in {len(edits)} files")


if __name__ == "__main__":
    main(sys.argv[1:])
