"""Names that ROS allows: of classes, ports, parameters and states, as for components in C++."""

import re
import unicodedata

_LONGEST = 64  # characters of a class's name; rtcfd loads no type with a longer one
_WORDS = {"ß": "ss", "ẞ": "SS"}


def class_name_error(name: str) -> str:
    """Return why rtcfd loads no class of that name, and the way out; "" if it does."""
    if not name.isascii():
        return f"is no name in ROS, which has ASCII letters alone: {advice(name)}"
    if len(name) > _LONGEST:
        return f"has {len(name)} characters: take a name of at most {_LONGEST}"
    return ""


def is_member_name(name: str) -> bool:
    """Tell whether a port, a parameter or a state may have a name."""
    return "__" not in name and re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name) is not None


def advice(name: str) -> str:
    """Return the advice to take another name: that of its letters where Unicode knows them."""
    plain = "".join(_WORDS.get(each) or _letter(each) for each in name)
    return f"write {plain}" if is_member_name(plain) else "take another name"


def _letter(character: str) -> str:
    """Return `o` for `ö`, `theta` for `θ`, `Delta` for `Δ`; "" for others."""
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
