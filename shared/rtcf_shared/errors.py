"""The base class of all errors with a message of one line."""


class RtcfError(Exception):
    """A call failed, or a text is not valid; the message is one line."""
