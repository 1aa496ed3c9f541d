"""XML of strangers: nothing is expanded, nothing is fetched, and the size is limited."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import TYPE_CHECKING

from missions.errors import NetworkError
from missions.files import to_printable

if TYPE_CHECKING:
    from lxml import etree

MOST_BYTES = 100_000_000
UNDECLARED = "NS_ERR_UNDEFINED_NAMESPACE"
"""Of a prefix such as xsi: or gx: without its xmlns, as editors leave it; Google Earth and GDAL read over it."""
_PAGE = re.compile(rb"(?:\xef\xbb\xbf)?\s*(?:<!--.*?-->\s*)?<(?:!doctype\s+html|html)\b", re.IGNORECASE | re.DOTALL)
_TITLE = re.compile(rb"<title>(.*?)</title>", re.IGNORECASE | re.DOTALL)


def root_of(content: bytes, source: str) -> etree._Element:
    """Return the root of an XML document.

    Raises:
        NetworkError: it is none, too large, or declares a document type, which no format here has and bombs need.
    """
    try:
        from lxml import etree
    except ImportError:  # who uses this package alone may go without
        raise NetworkError(f"{source}: XML needs lxml: pip install lxml") from None
    if len(content) > MOST_BYTES:
        raise NetworkError(f"{source}: content: expected XML of at most {MOST_BYTES // 1_000_000} MB")
    _refuse_page(content, source)
    try:
        root = _parse_root(content)
    except (etree.XMLSyntaxError, ValueError) as reason:
        line = getattr(reason, "lineno", None)
        place = f"{source}: line {line}" if line else f"{source}: content"
        words = to_printable(getattr(reason, "msg", None) or str(reason)) or "it is empty"
        if "EntityRef: " in words:
            words = "a bare &, which XML writes as &amp;"
        elif "ntit" in words:  # of an entity that is unknown, or of too many
            words = (
                f"entities are not expanded ({words})" if words.startswith("Entity '") else "entities are not expanded"
            )
        raise NetworkError(f"{place}: expected XML: {words}") from reason
    if root.getroottree().docinfo.doctype:
        raise NetworkError(f"{source}: content: expected XML without a document type (DOCTYPE)")
    return root


def _refuse_page(content: bytes, source: str) -> None:
    if _PAGE.match(content[:4096]):
        title = _TITLE.search(content[:4096])
        words = "" if title is None else f": {to_printable(title[1].decode('utf-8', 'replace'))[:100]!r}"
        raise NetworkError(f"{source}: content: expected a map's data, got a page of HTML such as a server's{words}")


def _parse_root(content: bytes) -> etree._Element:
    """Return the root; prefixes that are not declared are read over."""
    from lxml import etree

    options = {
        "resolve_entities": False, "load_dtd": False, "no_network": True, "huge_tree": False,
        "remove_comments": True, "remove_pis": True,
    }  # fmt: skip
    parser = etree.XMLParser(**options)
    try:
        return etree.fromstring(content, parser)
    except etree.XMLSyntaxError:
        if {error.type_name for error in parser.error_log} != {UNDECLARED}:
            raise
    root = etree.fromstring(content, etree.XMLParser(**options, recover=True))
    for element in root.iter():
        if isinstance(element.tag, str) and not element.tag.startswith("{"):
            element.tag = element.tag.rpartition(":")[2]
    return root


def tag_of(element: etree._Element) -> str:
    """Return the name of an element without its namespace; empty for what is no element."""
    tag = element.tag
    return tag.rpartition("}")[2] if isinstance(tag, str) else ""


def iterate_children(element: etree._Element, *tags: str) -> Iterator[etree._Element]:
    """Yield the children of some names, in any namespace."""
    return (child for child in element if tag_of(child) in tags)


def read_child_text(element: etree._Element, tag: str) -> str:
    """Return the text of the first child of a name; empty if there is none."""
    child = next(iterate_children(element, tag), None)
    return to_printable(child.text or "") if child is not None else ""


def line_of(element: etree._Element) -> str:
    """Return where an element stands in its file."""
    return f"line {element.sourceline}"
