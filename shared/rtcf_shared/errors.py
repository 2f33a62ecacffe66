"""The base of what goes wrong for people, in one line."""


class RtcfError(Exception):
    """A call failed, or a text is not valid; the message is one line for people."""
