"""Which cases of a sweep are quick."""

from collections import Counter

import pytest


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Mark as slow all cases of a test marked ``sweep(k)`` but the first, the (k + 1)th, ..."""
    seen = Counter()
    for item in items:
        mark = item.get_closest_marker("sweep")
        if mark is None:
            continue
        if seen[item.function] % mark.args[0]:
            item.add_marker(pytest.mark.slow)
        seen[item.function] += 1
