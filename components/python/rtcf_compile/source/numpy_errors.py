"""Rewords NumPy's errors about shapes and indices, and adds a remedy."""

import ast
import re

import numpy as np

_FIT = "make the shapes fit"
# `{0}` is the whole match, `{1}` its first group.
_KNOWN: tuple[tuple[type[Exception], str, str, str], ...] = (
    (
        ValueError,
        "inhomogeneous|setting an array element with a sequence",
        "the rows of an array have different lengths",
        "make the rows equally long",
    ),
    (
        ValueError,
        "must have same number of dimensions",
        "vectors are joined with matrices",
        "give all the same number of dimensions",
    ),
    (
        ValueError,
        r"matmul: .* \(size (\d+) is different from (\d+)\)",
        "@ of sizes {2} and {1}, which do not fit",
        _FIT,
    ),
    (
        ValueError,
        "matmul: .* does not have enough dimensions",
        "@ of a number",
        "use * for numbers",
    ),
    (
        ValueError,
        r"(solve|inv|det)\d?: .* \(size (\d+) is different from (\d+)\)",
        "np.linalg.{1} of sizes {3} and {2}, which do not fit",
        _FIT,
    ),
    (
        ValueError,
        "truth value of an array",
        "an array is not a condition",
        "use np.any(…) or np.all(…), & and | instead of `and` and `or`",
    ),
    (ValueError, ".*values to unpack.*", "{0}", "use as many names"),
    (ValueError, "fp and xp .*", "np.interp: {0}", "give xp and fp the same number of points"),
    (ValueError, r"cannot reshape array of size \d+ into shape .*", "{0}", _FIT),
    (ValueError, "incompatible dimensions for cross product.*", "{0}", "use three elements"),
    (ValueError, "slice step cannot be zero", "the step is 0", "use a step of 1 or more, or -1"),
    (
        ValueError,
        r"all the input array dimensions .* must match exactly, but along dimension \d, (.*)",
        "the joined arrays do not fit: {1}",
        _FIT,
    ),
    (
        np.linalg.LinAlgError,
        r"(\d)-dimensional array given.*",
        "np.linalg of a vector",
        "use a square matrix",
    ),
    (np.linalg.LinAlgError, "must be square", "the matrix is not square", "use a square matrix"),
    (
        IndexError,
        "boolean index did not match .*; (.*)",
        "a mask of a different size: {1}",
        "make the sizes the same",
    ),
    (TypeError, "slice indices must be integers.*", "a bound is not an int", "use int(…)"),
    (
        ValueError,
        "diag requires an array of at least two.*",
        "the trace of a vector",
        "give it a matrix",
    ),
    (ValueError, ".*(?:broadcast|shape|dimension|aligned).*", "{0}", _FIT),
)
# The compiler reports a number set to an array from the types, with better words.
_BY_TYPES = re.compile(r"has shape \(\), not ")


def explained(error: BaseException, source: str) -> tuple[str, str] | None:
    """Return the error of a line and the remedy; None for other errors, and for those that depend
    on inputs.
    """
    text = " ".join(str(error).split())
    by_input = isinstance(error, ValueError | IndexError) and _has_variable_slice(source)
    if _BY_TYPES.search(text) or by_input:
        return None
    for kind, pattern, what, remedy in _KNOWN:
        if isinstance(error, kind) and (found := re.search(pattern, text, re.IGNORECASE)):
            return what.format(found[0], *found.groups()), remedy
    return None


def _has_variable_slice(source: str) -> bool:
    """Tell whether a slice in a line depends on variables; names in capitals are constants."""
    for text in (source, f"{source} pass"):
        try:
            tree = ast.parse(text)
        except SyntaxError:
            continue
        slices = [each for each in ast.walk(tree) if isinstance(each, ast.Slice)]
        names = [each for part in slices for each in ast.walk(part) if isinstance(each, ast.Name)]
        return any(not each.id.isupper() for each in names)
    return False
