"""Checks names of classes, ports, parameters and states against the rules of ROS."""

import re
import unicodedata

_LONGEST = 64  # characters; rtcfd does not load a type with a longer name
_WORDS = {"ß": "ss", "ẞ": "SS"}


def class_name_error(name: str) -> str:
    """Return why rtcfd does not load a class of that name, with a remedy; "" if it does."""
    if not name.isascii():
        return f"is not a valid name in ROS (ASCII letters only): {advice(name)}"
    if len(name) > _LONGEST:
        return f"has {len(name)} characters: choose a name of at most {_LONGEST}"
    return ""


def is_member_name(name: str) -> bool:
    """Return True if a port, a parameter or a state may have the name."""
    return "__" not in name and re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name) is not None


def advice(name: str) -> str:
    """Return a remedy for a name: its transliteration to ASCII if there is one."""
    plain = "".join(_WORDS.get(each) or _letter(each) for each in name)
    is_name = is_member_name(plain.removeprefix("_"))
    return f"write {plain}" if is_name else "take another name"


def _letter(character: str) -> str:
    """Return `o` for `ö`, `theta` for `θ`, `Delta` for `Δ`; "" without a transliteration."""
    if character.isascii():
        return character
    # LATIN SMALL LETTER O WITH DIAERESIS, GREEK CAPITAL LETTER DELTA
    found = re.match(
        r"(?:LATIN|GREEK) (SMALL|CAPITAL) LETTER (\w+)(?: WITH .*)?$",
        unicodedata.name(character, ""),
    )
    if found is None:
        return ""
    return found[2].lower() if found[1] == "SMALL" else found[2].capitalize()
