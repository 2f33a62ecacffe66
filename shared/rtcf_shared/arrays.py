"""NumPy's arrays as lists."""

from typing import TYPE_CHECKING, Any, cast

if TYPE_CHECKING:
    from numpy.typing import NDArray


def as_list(array: "NDArray[Any]") -> list[Any]:
    """Return the elements of the first dimension, as Python's own numbers and lists of them.

    NumPy's own type of this depends on its release and on what it knows of the dimensions.
    """
    return cast("list[Any]", array.tolist())
