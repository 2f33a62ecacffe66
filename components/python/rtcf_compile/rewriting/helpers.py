"""What `@`, assignment, np.linalg and np.where become: functions for small arrays of fixed size.

Each exists twice with the same operations in the same order: the function itself is for the
interpreter, its overload is compiled. Neither calls BLAS or LAPACK, whose sums depend on the
machine and which allocate; np.where of numba from 0.57 on makes lists of shapes.
"""

from typing import Any

import numpy as np

Array = np.ndarray[Any, Any]


def rtcf_matmul(a: Any, b: Any) -> Any:
    """Return a @ b, each sum from the first element to the last."""
    a, b = np.asarray(a), np.asarray(b)
    if not a.ndim or not b.ndim or a.shape[-1] != b.shape[0]:
        raise ValueError(f"@ of shapes {a.shape} and {b.shape}")
    left = a if a.ndim == 2 else a[None, :]
    right = b if b.ndim == 2 else b[:, None]
    result = np.zeros((left.shape[0], right.shape[1]))
    for k in range(left.shape[1]):
        result = result + left[:, k, None] * right[None, k, :]
    if a.ndim == 1:
        result = result[0]
    if b.ndim == 1:
        result = result[..., 0]
    return float(result) if result.ndim == 0 else result


def rtcf_assign(target: Any, value: Any) -> None:
    """Set all elements of an array, from one of the same shape or a number."""
    new = np.asarray(value)
    if new.shape not in (target.shape, ()):
        raise ValueError(f"an array of shape {target.shape} is set to one of shape {new.shape}")
    if new.dtype.kind == "f" and target.dtype.kind != "f":
        raise TypeError(f"elements are {target.dtype.name}, not {new.dtype.name}")
    target[...] = new


def rtcf_float(value: Any) -> Any:
    """Return a float, of a float or an int."""
    return float(value)


def rtcf_int(value: Any) -> Any:
    """Return an int, of an int or an enum."""
    return int(value)


def rtcf_bool(value: Any) -> Any:
    """Return a bool."""
    return bool(value)


def rtcf_front(ring: Any, oldest: Any, count: Any) -> Any:
    """Return the oldest message of a queue."""
    if count == 0:
        raise IndexError("front of an empty queue")
    return ring[oldest]


def rtcf_age(now: Any, written: Any, oldest: Any, count: Any) -> Any:
    """Return how long ago the oldest message of a queue was written, ns; -1 without one."""
    return max(0, now - written[oldest]) if count else -1


def rtcf_after(place: Any, size: Any) -> Any:
    """Return the place behind another in a ring."""
    return (place + 1) % size


def rtcf_where(condition: Any, x: Any, y: Any) -> Any:
    """Return x where the condition holds, else y: arrays of one shape, or numbers."""
    shapes = {np.shape(each) for each in (condition, x, y)} - {()}
    if len(shapes) > 1:
        raise ValueError(f"np.where of shapes {sorted(shapes)}")
    return np.where(condition, x, y)[()]


def rtcf_solve(a: Any, b: Any) -> Any:
    """Return x of a x = b, by elimination with row pivots."""
    matrix, x = np.array(a, np.float64), np.array(b, np.float64)
    n = matrix.shape[0]
    if matrix.ndim != 2 or matrix.shape[1] != n or x.shape[0] != n:
        raise ValueError(f"solve of shapes {matrix.shape} and {x.shape}")
    for k in range(n):
        pivot = k + int(np.argmax(np.abs(matrix[k:, k])))
        if matrix[pivot, k] == 0.0:
            raise ValueError("solve: the matrix is singular")
        matrix[[k, pivot]], x[[k, pivot]] = matrix[[pivot, k]], x[[pivot, k]]
        for i in range(k + 1, n):
            factor = matrix[i, k] / matrix[k, k]
            matrix[i, k + 1 :] = matrix[i, k + 1 :] - factor * matrix[k, k + 1 :]
            x[i] = x[i] - factor * x[k]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] = x[i] - matrix[i, k] * x[k]
        x[i] = x[i] / matrix[i, i]
    return x


def rtcf_inv(a: Any) -> Any:
    """Return the inverse, by solving for each unit vector."""
    return rtcf_solve(a, np.eye(len(a)))


def rtcf_cholesky(a: Any) -> Any:
    """Return the lower triangle L of a = L L'."""
    a = np.asarray(a)
    n = a.shape[0]
    if a.ndim != 2 or a.shape[1] != n:
        raise ValueError(f"cholesky of shape {a.shape}")
    result = np.zeros((n, n))
    for i in range(n):
        for j in range(i + 1):
            total = a[i, j]
            for k in range(j):
                total = total - result[i, k] * result[j, k]
            if i != j:
                result[i, j] = total / result[j, j]
            elif total <= 0.0:
                raise ValueError("cholesky: the matrix is not positive definite")
            else:
                result[i, i] = np.sqrt(total)
    return result


INSTEAD = {
    np.linalg.solve: rtcf_solve,
    np.linalg.inv: rtcf_inv,
    np.linalg.cholesky: rtcf_cholesky,
    np.dot: rtcf_matmul,
    np.matmul: rtcf_matmul,
    np.where: rtcf_where,
}
BY_NAME = {
    each.__name__: each
    for each in (
        *(rtcf_matmul, rtcf_assign, rtcf_float, rtcf_int, rtcf_bool),
        *(rtcf_front, rtcf_age, rtcf_after),
        *INSTEAD.values(),
    )
}
