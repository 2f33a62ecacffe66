"""Any text as one line that can be printed."""


def line(text: str) -> str:
    """Return a text with line ends, control characters and what is no character as escapes."""
    return "".join(each if each.isprintable() else ascii(each)[1:-1] for each in text)
