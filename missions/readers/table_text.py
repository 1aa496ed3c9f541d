"""Text of tables as programs write it: UTF-8, UTF-16, or a code page of Windows, which no file names: it is tried."""

from __future__ import annotations

import codecs
import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence

from missions.errors import NetworkError
from missions.files import to_printable

MARKS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))
PAGES: Mapping[str, Sequence[str]] = {
    "cp1252": (
        "üäöß", "éèàêçôâîûùïëœæüÿ", "óíáéñúüªº", "ãçáéíóêâõúàªº", "èàòùéìíó", "äåöéšž", "åøæéöäü", "áíðéöóúþýæ",
        "ëéïóöüèá", "àèéíóòçúïü·",
    ),
    "cp1250": (
        "íáěéřčžýšůúóňďť", "áíčéýžšťúľňôóďäŕĺ", "łążęóśćńź", "áéöóőíüúű", "čšžćđ", "ăîâşţ", "üäöß", "ëç",
    ),
    "cp1257": ("āīēšžļņķūčģ", "ėšžųįūčęą", "õäüöšž"),
    "cp1254": ("ıüşçğöâîû",),
    "cp1251": (
        "оеаинтсрвлкмдпуяыьгзбчйхжшюцщэфъё", "оанівиертслкдупмязьбгйчхцжіїшющєґф", "аоиенртсвкудмјлпзгшбчцћхжњљђфџ",
    ),
    "cp1253": ("αοιετσνρκπμλςυδγήάόίθώέχφβύηωξζψϊϋΐΰ",),
}  # fmt: skip
"""Code pages of Europe, and of languages that are written in each the letters that ASCII has not, the usual first."""
APART = ("cp1251", "cp1253")
"""No word there mixes the page's own letters with those of ASCII."""
SIGNS = frozenset("°±§©®«»„“”‚‘’‹›–—…·•€£µ²³½¼¾\u00a0№")
_WORD = re.compile(r"[^\W\d_]+")
_CONTROL = re.compile(rb"[\x00-\x08\x0e-\x1f]")
NAMED = 3
SIGN, NEVER = 0.02, 1e-4
"""How likely a usual sign is among letters, and what a language does not have."""


def decode_table(content: bytes, source: str, encoding: str | None) -> tuple[str, str]:
    """Return the text that bytes are, and what is to be said of it; empty where the bytes are UTF-8 or say it.

    Args:
        content: The file's.
        source: Its name, for messages.
        encoding: What its people say; None to try.

    Raises:
        NetworkError: it is unknown, or the bytes are something else.
    """
    marked = next((mark for begin, mark in MARKS if content.startswith(begin)), None)
    if marked is not None or encoding is not None:
        return _decode_as(content, source, marked or str(encoding)), ""
    if content[:2].count(b"\x00") == 1:
        mark = "utf-16-le" if content[1] == 0 else "utf-16-be"
        return _decode_as(content, source, mark), f"no encoding is said: read as {mark}"
    try:
        return content.decode("utf-8"), ""
    except UnicodeDecodeError as reason:
        if _CONTROL.search(content):
            raise NetworkError(f"{source}: encoding: expected text, found other bytes at {reason.start}") from reason
    page, names = guess_code_page(content)
    return content.decode(page, "replace"), f"no encoding is said: read as {page}{names}; encoding says another"


def _decode_as(content: bytes, source: str, encoding: str) -> str:
    try:
        return content.decode(encoding)
    except (LookupError, ValueError) as reason:
        raise build_encoding_error(source, encoding, reason) from reason


def build_encoding_error(source: str, encoding: str, reason: Exception) -> NetworkError:
    """Return what is said of an encoding that is unknown, or is not that of the bytes."""
    return NetworkError(
        f"{source}: encoding: expected the table's own, such as 'cp1250' or 'utf-16', got {encoding!r}: "
        f"{to_printable(str(reason))}"
    )


def guess_code_page(content: bytes) -> tuple[str, str]:
    """Return the code page one of whose languages has a text's letters most likely, and words with such names."""
    page = max(PAGES, key=lambda one: _log_likelihood(content.decode(one, "replace"), one))
    text = content.decode(page, "replace")
    names = list(dict.fromkeys(word for word in _WORD.findall(text) if not word.isascii()))[:NAMED]
    return page, f", with names such as {', '.join(map(repr, names))}" if names else ""


def _log_likelihood(text: str, page: str) -> float:
    """Return how likely a text is in the language of a page that fits best, as a logarithm."""
    signs = sum(
        math.log(SIGN if letter in SIGNS else NEVER) for letter in text if not (letter.isascii() or letter.isalpha())
    )
    words = [word.replace("İ", "i").lower() for word in _WORD.findall(text) if not word.isascii()]
    odd = [word for word in words if page in APART and any(map(str.isascii, word))]
    letters = Counter(letter for word in words for letter in word if not letter.isascii())
    return signs + len(odd) * math.log(NEVER) + max(_log_likelihood_in(letters, own) for own in PAGES[page])


def _log_likelihood_in(letters: Counter[str], own: str) -> float:
    """Return the logarithm of the likelihood of letters in a language: the second as likely by half as the first."""
    of_all = sum(1.0 / rank for rank in range(1, len(own) + 1))
    shares = {letter: 1.0 / rank / of_all for rank, letter in enumerate(own, start=1)}
    return sum(count * math.log(shares.get(letter, NEVER)) for letter, count in letters.items())
