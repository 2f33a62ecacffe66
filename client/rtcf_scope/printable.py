"""Conversion of any text into one printable line."""


def printable(text: str) -> str:
    """Return a text with unprintable characters, including line ends, as escapes."""
    return "".join(each if each.isprintable() else ascii(each)[1:-1] for each in text)
