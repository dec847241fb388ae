"""The last test first: what a test finds must not rest on those before it. A pytest plugin, loaded by hand.

PYTHONPATH=tests/harness python -m pytest -p reverse_order
"""

import pytest


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The same tests, in reverse."""
    items.reverse()
