"""The schemas of KML, from a library that carries them."""

from __future__ import annotations

from importlib.resources import files

from lxml import etree


def kml_schema() -> etree.XMLSchema:
    """Return the schema of KML 2.2 with Google's extensions."""
    return etree.XMLSchema(etree.parse(str(files("fastkml") / "schema" / "kml22gx.xsd")))
