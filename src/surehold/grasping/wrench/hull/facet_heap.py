"""A binary heap of facets, ordered by (offset, number of the facet), in two arrays that the caller keeps (compiled)."""

from surehold.store.kernels import njit

__all__ = ["pop", "push"]


@njit(cache=True)
def push(keys, ids, size, key, item):
    """Push onto a binary heap ordered by (key, item)."""
    k = size
    while k > 0:
        parent = (k - 1) >> 1
        if keys[parent] < key or (keys[parent] == key and ids[parent] < item):
            break
        keys[k], ids[k] = keys[parent], ids[parent]
        k = parent
    keys[k], ids[k] = key, item


@njit(cache=True)
def pop(keys, ids, size):
    """Remove the top of a binary heap."""
    last = size - 1
    key, item = keys[last], ids[last]
    k = 0
    while True:
        child = 2 * k + 1
        if child >= last:
            break
        if child + 1 < last and (
            keys[child + 1] < keys[child] or (keys[child + 1] == keys[child] and ids[child + 1] < ids[child])
        ):
            child += 1
        if key < keys[child] or (key == keys[child] and item < ids[child]):
            break
        keys[k], ids[k] = keys[child], ids[child]
        k = child
    keys[k], ids[k] = key, item
