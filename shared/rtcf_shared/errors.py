"""The base class of all errors with a message of one line."""


class RtcfError(Exception):
    """A call failed, or a text is not valid; the message is one line."""

    @property
    def lines(self) -> list[str]:
        """The message, or one message for each of several errors."""
        return [str(self)]
