"""XML of strangers: nothing is expanded, nothing is fetched, and the size is limited."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from missions.errors import NetworkError
from missions.files import printable

if TYPE_CHECKING:
    from lxml import etree

MOST_BYTES = 100_000_000


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
    parser = etree.XMLParser(
        resolve_entities=False, load_dtd=False, no_network=True, huge_tree=False, remove_comments=True, remove_pis=True
    )
    try:
        root = etree.fromstring(content, parser)
    except (etree.XMLSyntaxError, ValueError) as reason:
        line = getattr(reason, "lineno", None)
        place = f"{source}: line {line}" if line else f"{source}: content"
        words = printable(getattr(reason, "msg", None) or str(reason)) or "it is empty"
        if "ntit" in words:  # of an entity that is unknown, or of too many
            words = "entities are not expanded"
        raise NetworkError(f"{place}: expected XML: {words}") from reason
    if root.getroottree().docinfo.doctype:
        raise NetworkError(f"{source}: content: expected XML without a document type (DOCTYPE)")
    return root


def tag_of(element: etree._Element) -> str:
    """Return the name of an element without its namespace; empty for what is no element."""
    tag = element.tag
    return tag.rpartition("}")[2] if isinstance(tag, str) else ""


def children(element: etree._Element, *tags: str) -> Iterator[etree._Element]:
    """Yield the children of some names, in any namespace."""
    return (child for child in element if tag_of(child) in tags)


def text_of(element: etree._Element, tag: str) -> str:
    """Return the text of the first child of a name; empty if there is none."""
    child = next(children(element, tag), None)
    return printable(child.text or "") if child is not None else ""


def line_of(element: etree._Element) -> str:
    """Return where an element stands in its file."""
    return f"line {element.sourceline}"
