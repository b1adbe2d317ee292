"""A failed test is tried again only where the test itself says why."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from support.reruns import HOST_STALLS


def hook(request):
    """The hook of tests/conftest.py."""
    conftest = str(Path(__file__).with_name("conftest.py"))
    plugins = request.config.pluginmanager.get_plugins()
    (found,) = [each for each in plugins if getattr(each, "__file__", "") == conftest]
    return found.pytest_collection_modifyitems


def item_with(mark):
    added = []
    return SimpleNamespace(
        nodeid="a test",
        path=Path(__file__),  # which has the word `system`
        get_closest_marker=lambda name: mark.mark if mark and mark.mark.name == name else None,
        add_marker=added.append,
        added=added,
    )


def test_nothing_is_tried_again_without_a_reason(request):
    system, named = item_with(pytest.mark.system), item_with(pytest.mark.rerun_because(HOST_STALLS))
    hook(request)([system, named])
    assert system.added == []
    assert [mark.mark.kwargs for mark in named.added] == [{"reruns": 2}]


@pytest.mark.parametrize("arguments", [(), ("",), ("slow",)])
def test_a_reason_is_a_sentence(request, arguments):
    with pytest.raises(pytest.UsageError, match="reason as a sentence"):
        hook(request)([item_with(pytest.mark.rerun_because(*arguments))])


def test_every_test_of_this_run_that_is_tried_again_has_a_reason(request):
    for item in request.session.items:
        again = item.get_closest_marker("flaky") is not None
        assert again == (item.get_closest_marker("rerun_because") is not None), item.nodeid
