"""Converts NumPy arrays to lists."""

from typing import TYPE_CHECKING, Any, cast

if TYPE_CHECKING:
    from numpy.typing import NDArray


def as_list(array: "NDArray[Any]") -> list[Any]:
    """Return an array as a list of Python numbers, or of nested lists.

    The cast is needed because the type annotation of tolist() differs between NumPy releases.
    """
    return cast("list[Any]", array.tolist())
