"""XML that is written: names of strangers in it, and numbers with as many digits as they are worth."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING

from missions.exports.map_features import Position

if TYPE_CHECKING:
    from lxml import etree

_UNFIT = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Letters that XML 1.0 has no place for."""


def add_element(parent: etree._Element, tag: str, text: object = None, **attributes: str) -> etree._Element:
    """Return a new last child, of the parent's namespace unless the tag names another."""
    from lxml import etree

    space = parent.tag.partition("}")[0] + "}" if "}" not in tag else ""
    child = etree.SubElement(parent, f"{space}{tag}", {key: to_xml_text(value) for key, value in attributes.items()})
    if text is not None:
        child.text = to_xml_text(str(text))
    return child


def to_xml_text(text: str) -> str:
    r"""Return a text as XML can hold it.

    >>> to_xml_text("P41\x00-P42")
    'P41 -P42'
    """
    return _UNFIT.sub(" ", text)


def format_document(root: etree._Element) -> str:
    """Return the text of a whole file."""
    from lxml import etree

    etree.indent(root, " ")
    text: bytes = etree.tostring(root, xml_declaration=True, encoding="UTF-8")
    return text.decode()


def build_xml_root(tag: str, spaces: Mapping[str | None, str], **attributes: str) -> etree._Element:
    """Return the first element of a file, in the namespace that has no prefix."""
    from lxml import etree

    return etree.Element(f"{{{spaces[None]}}}{tag}", attributes, nsmap=dict(spaces))


def format_degrees(value: float) -> str:
    """Return degrees to a centimetre."""
    return f"{value:.7f}"


def format_height(position: Position) -> str:
    """Return the height of a position to a centimetre; 0 where it is not known."""
    return f"{position[2] or 0.0:.2f}"
