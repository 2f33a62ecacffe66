"""Conversion of any text into printable text.

Names of holders, reasons and log records come from other users.  On a terminal, their control
characters would change its title or contents, and others reverse the order of a line.
"""


def printable(text: str, keep: str = "") -> str:
    """Return a text with unprintable characters as escapes, except for those in `keep`.

    Unprintable are line ends, other control characters, and marks of the direction of writing, as
    by str.isprintable().
    """
    if text.isprintable():
        return text
    return "".join(
        each if each.isprintable() or each in keep else ascii(each)[1:-1] for each in text
    )
