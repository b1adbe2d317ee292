"""What `make test` leaves to `make test-all` has a reason in writing, and stands on the page."""

import importlib.util
from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import pytest

from support.long_run import mark_the_long_run, representative

pytest_plugins = ["pytester"]
ROOT = Path(__file__).parents[1]
REASON = "one case of each kind stands for all"


def cases(marker, **parameters):
    """Items of one parametrised test with every combination of the parameters' values."""
    items = []
    places = [{}]
    for name, values in parameters.items():
        places = [{**place, name: k} for place in places for k in range(len(values))]
    for place in places:
        params = {name: parameters[name][k] for name, k in place.items()}
        item = SimpleNamespace(
            nodeid=f"test_it[{params}]",
            callspec=SimpleNamespace(params=params, _idlist=list(map(str, params.values()))),
            own=[marker.mark],
        )
        item.get_closest_marker = lambda name, item=item: next(
            (mark for mark in item.own if mark.name == name), None
        )
        item.add_marker = lambda added, item=item: item.own.append(added.mark)
        items.append(item)
    return items


def kept(items):
    mark_the_long_run(items)
    return [item.callspec.params for item in items if not item.get_closest_marker("long")]


def test_every_value_of_every_parameter_stays_in_one_case_at_least():
    found = kept(cases(pytest.mark.sampled(REASON), letter="abc", number=[1, 2, 3, 4, 5]))
    assert {case["letter"] for case in found} == set("abc")
    assert {case["number"] for case in found} == {1, 2, 3, 4, 5}
    assert len(found) == 5


def test_a_number_of_cases_has_as_many_values_as_possible():
    found = kept(cases(pytest.mark.sampled(REASON, cases=4), letter="abcd", number=[1, 2, 3]))
    assert len(found) == len({case["letter"] for case in found}) == 4
    assert {case["number"] for case in found} == {1, 2, 3}


def test_one_case_of_each_kind_stays():
    marker = pytest.mark.sampled(REASON, alike=lambda number: number % 3)
    found = kept(cases(marker, number=list(range(20))))
    assert Counter(case["number"] % 3 for case in found) == {0: 1, 1: 1, 2: 1}


def test_the_choice_is_the_same_in_every_process():
    places = [{0: k} for k in range(1000)]
    assert representative(places, 5, "test_it") == representative(places, 5, "test_it")
    assert representative(places, 5, "test_it") != representative(places, 5, "test_other")


@pytest.mark.parametrize("name", ["long", "sampled"])
@pytest.mark.parametrize("arguments", [(), ("",), ("slow",)])
def test_a_reason_is_a_sentence(name, arguments):
    with pytest.raises(pytest.UsageError, match="reason as a sentence"):
        mark_the_long_run(cases(getattr(pytest.mark, name)(*arguments), number=[1]))


def test_the_page_for_contributors_names_what_is_left_to_the_long_run():
    spec = importlib.util.spec_from_file_location("long_tests", ROOT / "tools/long_tests.py")
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    page = tool.PAGE.read_text(encoding="utf-8")
    assert tool.written_into(page) == page, "run .venv/bin/python tools/long_tests.py"


def test_the_cases_of_a_real_test_are_told_apart(pytester):
    """By what pytest keeps of a case, which is not public."""
    pytester.makeconftest(
        "from support.long_run import mark_the_long_run\n"
        "def pytest_collection_modifyitems(items):\n"
        "    mark_the_long_run(items)\n"
        "    items[:] = [item for item in items if not item.get_closest_marker('long')]\n"
    )
    pytester.makepyfile(
        "import pytest\n"
        f"@pytest.mark.sampled({REASON!r})\n"
        "@pytest.mark.parametrize(('a', 'b'), [(1, 1), (1, 2), (2, 1)])\n"
        "@pytest.mark.parametrize('c', [1, 2, 3])\n"
        "def test_it(a, b, c): pass\n"
    )
    assert pytester.runpytest("-q", "-p", "no:cacheprovider").parseoutcomes() == {"passed": 3}


def test_make_test_leaves_out_what_is_marked_and_make_test_all_does_not():
    script = (ROOT / "tools/test.sh").read_text(encoding="utf-8")
    assert 'short="and not long"' in script
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert "@tools/test.sh\n" in makefile
    assert "@tools/test.sh all\n" in makefile
